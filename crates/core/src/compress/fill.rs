//! Fills uncoded entries with smooth values: NaN becomes the mean of live siblings, then of neighbours.
//!
//! Filled values are never scored: the classes mark the samples that are zero or masked. A good filling only makes the
//! coefficients around it small.

use super::rows::live_entries;
use crate::codec::Class;
use crate::domain::{Axis, TriangleMesh};

/// Replaces every NaN in `values` (row-major on `axes`) by a smooth value.
pub(crate) fn fill(axes: &[Axis], values: &mut [f32]) {
    if !values.iter().any(|v| v.is_nan()) {
        return;
    }
    let mut triangles = (0..axes.len()).rev().filter(|&axis| matches!(axes[axis], Axis::Triangles(_)));
    let fill_axis = |axis: usize, values: &mut [f32]| {
        let inner: usize = axes[axis + 1..].iter().map(Axis::len).product();
        for block in values.chunks_exact_mut(axes[axis].len() * inner) {
            fill_tree(block, inner);
        }
    };
    if let Some(axis) = triangles.next() {
        fill_axis(axis, values);
    }
    let lanes = axes.last().map_or(1, Axis::len);
    for row in values.chunks_exact_mut(lanes) {
        fill_line(row);
    }
    // An entry of an earlier axis is now either complete or dead as a whole. Dead ones are filled as nodes without
    // details decode.
    for axis in triangles {
        fill_axis(axis, values);
    }
    // Means of samples near the float32 maximum can overflow.
    for value in values.iter_mut().filter(|v| v.is_infinite()) {
        *value = value.clamp(f32::MIN, f32::MAX);
    }
    let (sum, count) =
        values.iter().filter(|v| !v.is_nan()).fold((0.0, 0_u64), |(sum, n), &v| (sum + f64::from(v), n + 1));
    let mean = if count == 0 { 0.0 } else { (sum / count as f64) as f32 };
    for value in values.iter_mut().filter(|v| v.is_nan()) {
        *value = mean;
    }
}

/// Changes bio-Haar coefficients (row-major on `axes`) without changing live samples, so that triangle nodes with fewer
/// than two live children have no details. Dead (zero or masked) samples there become equal to their live sibling.
pub(crate) fn settle(axes: &[Axis], classes: &[Class], coefficients: &mut [f64]) {
    for (at, axis) in axes.iter().enumerate() {
        let Axis::Triangles(mesh) = axis else { continue };
        let inner: usize = axes[at + 1..].iter().map(Axis::len).product();
        let live = live_entries(axes, at, classes);
        for block in coefficients.chunks_exact_mut(mesh.len() * inner) {
            settle_tree(*mesh, inner, live.clone(), block);
        }
    }
}

/// Sets to 0 the bio-Haar details (differences of four sibling triangles from their mean) where fewer than two siblings
/// have nonzero, unmasked samples, as `live` marks.
///
/// It works from the finest triangles up, and adds the change of each mean to the parent. `block` is `[triangle,
/// inner]`.
fn settle_tree(mesh: TriangleMesh, inner: usize, mut live: Vec<bool>, block: &mut [f64]) {
    let mut areas = mesh.solid_angles();
    let mut growths: Vec<Option<Vec<f64>>> = vec![None; live.len()];
    let mut stride = 1;
    while live.len() > mesh.bases() {
        let mut above = Vec::with_capacity(live.len() / 4);
        for (node, alive) in live.chunks_exact(4).enumerate() {
            let growths = &growths[4 * node..][..4];
            let areas = &areas[4 * node..][..4];
            let survivor = alive.iter().position(|&child| child);
            let several = alive.iter().filter(|&&child| child).count() > 1;
            let place = |k: usize, j: usize| (4 * node + k) * stride * inner + j;
            let has_details = (1..4).any(|k| (0..inner).any(|j| block[place(k, j)] != 0.0));
            if growths.iter().all(Option::is_none) && (several || !has_details) {
                above.push(None);
                continue;
            }
            let total: f64 = areas.iter().sum();
            let mut growth = vec![0.0; inner];
            for (j, growth) in growth.iter_mut().enumerate() {
                let grown = |k: usize| growths[k].as_ref().map_or(0.0, |row| row[j]);
                let details = [1, 2, 3].map(|k| block[place(k, j)]);
                // Child 0 follows from the mean and the other three children.
                let first = -(1..4).map(|k| areas[k] / areas[0] * details[k - 1]).sum::<f64>();
                *growth = match survivor {
                    _ if several => (0..4).map(|k| areas[k] / total * grown(k)).sum(),
                    Some(0) => first + grown(0),
                    Some(k) => details[k - 1] + grown(k),
                    None => 0.0,
                };
                for k in 1..4 {
                    block[place(k, j)] = if several { details[k - 1] + grown(k) - *growth } else { 0.0 };
                }
            }
            above.push(Some(growth));
        }
        growths = above;
        live = live.chunks_exact(4).map(|children| children.contains(&true)).collect();
        areas = areas.chunks_exact(4).map(|children| children.iter().sum()).collect();
        stride *= 4;
    }
    for (base, growth) in growths.iter().enumerate() {
        let row = &mut block[base * stride * inner..][..inner];
        row.iter_mut().zip(growth.iter().flatten()).for_each(|(c, growth)| *c += growth);
    }
}

/// Fills NaN values (zero or masked samples) on a triangle mesh, from the coarsest level down: each takes the mean of
/// those of its siblings that have values, or else that of its parent's siblings, and so on.
///
/// `block` is `[triangle, inner]`, with `inner` values for each of the finest triangles.
fn fill_tree(block: &mut [f32], inner: usize) {
    let mut levels: Vec<Vec<f32>> = Vec::new();
    let mut rows = block.len() / inner;
    while rows.is_multiple_of(4) && rows > 4 {
        let children = levels.last().map_or(&*block, Vec::as_slice);
        let parents =
            children.chunks_exact(4 * inner).flat_map(|four| (0..inner).map(move |j| live_mean(four, inner, j)));
        let parents = parents.collect();
        levels.push(parents);
        rows /= 4;
    }
    for level in (0..levels.len()).rev() {
        let (below, here) = levels.split_at_mut(level);
        let children = below.last_mut().map_or(&mut *block, Vec::as_mut_slice);
        let Some(parents) = here.first() else { continue };
        for (four, parent) in children.chunks_exact_mut(4 * inner).zip(parents.chunks_exact(inner)) {
            for child in four.chunks_exact_mut(inner) {
                for (value, &mean) in child.iter_mut().zip(parent) {
                    if value.is_nan() {
                        *value = mean;
                    }
                }
            }
        }
    }
}

fn live_mean(four: &[f32], inner: usize, j: usize) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    for k in 0..4 {
        let value = four[k * inner + j];
        if !value.is_nan() {
            sum += value;
            count += 1.0;
        }
    }
    // 0 / 0 = NaN: a parent without live children is dead itself.
    sum / count
}

/// Fills gaps (NaN) in a row of values by linear interpolation between the nearest known ones, constant beyond the
/// first and the last.
fn fill_line(row: &mut [f32]) {
    let mut last: Option<usize> = None;
    for i in 0..row.len() {
        if row[i].is_nan() {
            continue;
        }
        let first_dead = last.map_or(0, |l| l + 1);
        let start = last.map_or(row[i], |l| row[l]);
        let span = (i + 1 - first_dead) as f32;
        let end = row[i];
        for (step, value) in row[first_dead..i].iter_mut().enumerate() {
            *value = start + (end - start) * ((step + 1) as f32 / span);
        }
        last = Some(i);
    }
    if let Some(l) = last {
        let end = row[l];
        row[l + 1..].fill(end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Domain, TriangleMesh};

    const N: f32 = f32::NAN;

    #[test]
    fn lines_interpolate_and_hold_their_ends() {
        let mut row = [N, 1.0, N, N, 4.0, N];
        fill_line(&mut row);
        assert_eq!(row, [1.0, 1.0, 2.0, 3.0, 4.0, 4.0]);
    }

    #[test]
    fn dead_triangles_take_the_mean_of_live_siblings() {
        let mesh = Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, 1).unwrap());
        let axes = [mesh, Axis::Index { count: 2, labels: vec![] }];
        let mut values = vec![1.0; 32];
        (values[0], values[2], values[4]) = (N, 3.0, 5.0);
        fill(&axes, &mut values);
        assert_eq!(values[0], 3.0);
        let mut dead = vec![N; 32];
        fill(&axes, &mut dead);
        assert_eq!(dead, vec![0.0; 32]);
    }

    /// Checks that incoming triangles without valid samples take those of their only valid sibling, because a file
    /// codes no differences between such siblings.
    #[test]
    fn dead_incoming_triangles_are_their_live_sibling() {
        let mesh = |level| Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap());
        let axes = [mesh(1), mesh(1), Axis::Rgb];
        let mut values: Vec<f32> = (0..16 * 48_u16).map(f32::from).collect();
        // The first node has one live child, the second none.
        values[..3 * 48].fill(N);
        values[4 * 48..8 * 48].fill(N);
        values[10 * 48 + 5] = N;
        fill(&axes, &mut values);
        let block = |i: usize| &values[i * 48..][..48];
        assert!((0..3).all(|i| block(i) == block(3)));
        assert!((5..8).all(|i| block(i) == block(4)));
        assert!(values.iter().all(|v| !v.is_nan()));
    }

    #[test]
    fn nothing_live_changes() {
        let axes = [Axis::Rgb];
        let mut values = [1.0, 2.0, 3.0];
        fill(&axes, &mut values);
        assert_eq!(values, [1.0, 2.0, 3.0]);
    }
}
