//! Coding order of a transform plan's trees: coarse to fine, each row and lane after its neighbours.

use crate::codec::{Class, NONE, Rows};
use crate::domain::Axis;
use crate::transform::{AxisTransform, Plan};

/// Number of samples in a coding row: length of the last axis or, on a grid of angles, number of azimuths (of polar
/// angles if there is one azimuth). The row above then is the previous polar angle.
pub(crate) fn lanes(axes: &[Axis]) -> usize {
    match axes.last() {
        Some(Axis::Grid(grid)) => match grid.shape() {
            [polar, 1] => polar,
            [_, azimuths] => azimuths,
        },
        axis => axis.map_or(1, Axis::len),
    }
}

/// Coding order of the coefficients of a tensor on `axes`, transformed by `plan`: the last axis gives the positions in
/// a row, all others the rows.
///
/// With `classes`, triangles without a live sample in any row and lane are dead. No detail is coded below a node with
/// fewer than two live children, because the filled values have none there.
pub(crate) fn coding_order(axes: &[Axis], plan: &Plan, classes: Option<&[Class]>) -> Rows {
    let Some(last) = axes.len().checked_sub(1) else { return Rows::natural(1, 1) };
    let of = |axis| {
        let mut neighbours = AxisNeighbours::of(plan, axis);
        if let (Some(classes), AxisTransform::Sphere(_), Axis::Triangles(mesh)) =
            (classes, plan.transform(axis), &axes[axis])
        {
            let coded = coded_indices(&live_entries(axes, axis, classes), mesh.bases());
            neighbours.order.retain(|&i| coded[i as usize]);
        }
        neighbours
    };
    let lanes = of(last);
    let mut rows = Rows {
        order: vec![0],
        level: vec![0],
        neighbours: vec![[NONE; 3]],
        lane_level: plan.tree(last).level.clone(),
        lane_neighbours: lanes.parent.iter().zip(&lanes.before).map(|(&p, &b)| [p, b]).collect(),
        lane_order: lanes.order,
    };
    for axis in 0..last {
        rows = nest(rows, &of(axis), &plan.tree(axis).level);
    }
    rows
}

/// Marks the entries of an axis that have a sample neither zero nor masked.
pub(crate) fn live_entries(axes: &[Axis], axis: usize, classes: &[Class]) -> Vec<bool> {
    let inner: usize = axes[axis + 1..].iter().map(Axis::len).product();
    let n = axes[axis].len();
    let mut live = vec![false; n];
    for (i, block) in classes.chunks_exact(inner).enumerate() {
        let live = &mut live[i % n];
        *live = *live || block.iter().any(|class| matches!(class, Class::Positive | Class::Negative));
    }
    live
}

/// Marks the wavelet coefficients on a triangle mesh that a file codes: means over the `bases` base triangles, and
/// details of triangles with samples (neither zero nor masked) in two or more of their four children.
///
/// `live` marks the finest triangles with such samples.
fn coded_indices(live: &[bool], bases: usize) -> Vec<bool> {
    let mut coded = vec![true; live.len()];
    let mut live = live.to_vec();
    let mut stride = 1;
    while live.len() > bases {
        for (node, children) in live.chunks_exact(4).enumerate() {
            if children.iter().filter(|&&child| child).count() < 2 {
                for k in 1..4 {
                    coded[(4 * node + k) * stride] = false;
                }
            }
        }
        live = live.chunks_exact(4).map(|children| children.contains(&true)).collect();
        stride *= 4;
    }
    coded
}

/// Sets to 0 those elements of a coefficient tensor that a file does not code, as the decoder does.
pub(crate) fn clear_uncoded<T: Copy + Default>(rows: &Rows, values: &mut [T]) {
    let lanes = rows.lane_neighbours.len();
    if rows.order.len() * rows.lane_order.len() == values.len() {
        return;
    }
    let mut row_coded = vec![false; rows.neighbours.len()];
    let mut lane_coded = vec![false; lanes];
    rows.order.iter().for_each(|&r| row_coded[r as usize] = true);
    rows.lane_order.iter().for_each(|&j| lane_coded[j as usize] = true);
    for (row, row_coded) in values.chunks_exact_mut(lanes).zip(row_coded) {
        for (value, lane_coded) in row.iter_mut().zip(&lane_coded) {
            if !row_coded || !lane_coded {
                *value = T::default();
            }
        }
    }
}

struct AxisNeighbours {
    order: Vec<u32>,
    parent: Vec<u32>,
    /// For each entry of the transformed axis, the entry that comes just before it in coding order, if both are on the
    /// same level of the wavelet tree; otherwise `NONE`.
    before: Vec<u32>,
}

impl AxisNeighbours {
    fn of(plan: &Plan, axis: usize) -> Self {
        let tree = plan.tree(axis);
        let mut before = vec![NONE; tree.level.len()];
        for &[a, b] in tree.order.array_windows() {
            if tree.level[a as usize] == tree.level[b as usize] {
                before[b as usize] = a;
            }
        }
        let parent = tree.parent.iter().map(|p| p.unwrap_or(NONE)).collect();
        Self { order: tree.order.clone(), parent, before }
    }
}

/// Extends the coding order of a tensor's wavelet coefficients by one more axis, whose entries vary fastest.
///
/// `outer` holds the order on the axes before it, and the neighbours of each coefficient that are coded earlier.
fn nest(outer: Rows, axis: &AxisNeighbours, level: &[u8]) -> Rows {
    let n = axis.before.len() as u32;
    let mut order = Vec::with_capacity(outer.order.len() * axis.order.len());
    for &o in &outer.order {
        order.extend(axis.order.iter().map(|&i| o * n + i));
    }
    let count = outer.level.len() * axis.before.len();
    let mut levels = Vec::with_capacity(count);
    let mut neighbours = Vec::with_capacity(count);
    for (o, &outer_level) in (0..).zip(&outer.level) {
        let [before, parent, _] = outer.neighbours[o as usize];
        let earlier = if parent == NONE { before } else { parent };
        for i in 0..n {
            let same = |index: u32| if index == NONE { NONE } else { o * n + index };
            let other = if earlier == NONE { NONE } else { earlier * n + i };
            levels.push(level[i as usize].saturating_add(u8::from(outer_level > 0)));
            neighbours.push([same(axis.before[i as usize]), same(axis.parent[i as usize]), other]);
        }
    }
    Rows { order, level: levels, neighbours, ..outer }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Domain, TriangleMesh, WavelengthGrid};
    use crate::transform::{AxisTransform, LineBasis, SphereBasis, Weights};

    #[test]
    fn neighbours_are_coded_before_they_are_asked_for() {
        let mesh = |level| Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap());
        let axes = [mesh(1), mesh(2), Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 11).unwrap())];
        let sphere = AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Count));
        let plan = Plan::new(&axes, &[sphere, sphere, AxisTransform::line(LineBasis::BIOR44)]).unwrap();
        let rows = coding_order(&axes, &plan, None);
        assert_eq!(rows.order.len(), 16 * 64);
        let mut rank = vec![0; rows.order.len()];
        for (k, &r) in rows.order.iter().enumerate() {
            rank[r as usize] = k;
        }
        for (r, neighbours) in rows.neighbours.iter().enumerate() {
            for &n in neighbours.iter().filter(|&&n| n != NONE) {
                assert!(rank[n as usize] < rank[r]);
            }
        }
        let mut lane_rank = vec![0; rows.lane_order.len()];
        for (k, &j) in rows.lane_order.iter().enumerate() {
            lane_rank[j as usize] = k;
        }
        for (j, neighbours) in rows.lane_neighbours.iter().enumerate() {
            assert!(neighbours.iter().all(|&n| n == NONE || lane_rank[n as usize] < lane_rank[j]));
        }
        let mut all = rows.order.clone();
        all.sort_unstable();
        assert!(all.iter().enumerate().all(|(i, &r)| i == r as usize));
    }

    #[test]
    fn nothing_is_coded_below_dead_nodes() {
        let mesh = Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, 2).unwrap());
        let plan = Plan::new(std::slice::from_ref(&mesh), &[AxisTransform::Sphere(SphereBasis::BioHaar)]).unwrap();
        // The first octant has one live leaf, the second two under different nodes, the third only live ones, the
        // fourth none.
        let live = |i: usize| i == 5 || i == 16 || i == 20 || (32..48).contains(&i);
        let classes: Vec<Class> = (0..64).map(|i| if live(i) { Class::Positive } else { Class::Masked }).collect();
        let mut coded = coding_order(&[mesh], &plan, Some(&classes)).lane_order;
        coded.sort_unstable();
        let whole_third = (32..48).filter(|i| i % 16 != 0);
        let expected: Vec<u32> = [0, 16, 20, 24, 28, 32].into_iter().chain(whole_third).chain([48]).collect();
        assert_eq!(coded, expected);
        let mut values = vec![1; 64];
        let rows = Rows { lane_order: coded, lane_neighbours: vec![[NONE; 2]; 64], ..Rows::natural(1, 1) };
        clear_uncoded(&rows, &mut values);
        assert_eq!(values.iter().sum::<usize>(), 22);
    }

    #[test]
    fn the_smooth_part_of_a_sphere_is_coded_whatever_lives() {
        let mesh = Axis::Triangles(TriangleMesh::new(Domain::Sphere, 1).unwrap());
        let plan = Plan::new(std::slice::from_ref(&mesh), &[AxisTransform::Sphere(SphereBasis::BioHaar)]).unwrap();
        let classes: Vec<Class> = (0..32).map(|i| if i / 4 == 5 { Class::Positive } else { Class::Zero }).collect();
        let coded = coding_order(&[mesh], &plan, Some(&classes)).lane_order;
        assert_eq!(coded, [0, 4, 8, 12, 16, 20, 24, 28, 21, 22, 23]);
    }

    #[test]
    fn a_tensor_without_axes_is_one_row() {
        let plan = Plan::new(&[], &[]).unwrap();
        assert_eq!(coding_order(&[], &plan, None).order, vec![0]);
    }
}
