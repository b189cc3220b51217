//! Averages over cells as a sparse operator: samples and weights for each cell.

use super::angles::{Interpolant, finest_spacing};
use crate::domain::vector::{add, scale, unit};
use crate::domain::{Direction, TriangleMesh, Vertices, centroid, child, solid_angle};
use crate::formats::{Angles, Outside};
use rayon::prelude::*;

/// Lower bound on k, where a triangle of directions is split into 4^k parts to average over it. Raising it makes
/// averages more accurate and slower.
const MIN_DIVISIONS: u32 = 2;
/// Usual k, where a triangle of directions is split into 4^k parts to average over it, as long as the parts are coarser
/// than [`FINEST_LEVEL`]. A beam that peaks within one triangle then keeps its flux to a thousandth. Raising k is more
/// accurate and slower.
const USUAL_DIVISIONS: u32 = 3;
/// Finest subdivision level of the parts of a triangle that narrow sample spacings can demand. Raising it resolves
/// narrower spacings and takes longer.
const FINEST_LEVEL: u32 = 9;
/// Number of further times that parts of a triangle are split into four if the boundary of the covered range crosses
/// them. The jump at the boundary causes all error of these parts. Raising the number reduces this error and takes
/// longer.
const RIM_DIVISIONS: u32 = 4;
/// Fraction by which the vertices of a triangle are moved toward its centroid before the test whether the covered range
/// contains them. Vertices often lie exactly on its boundary.
const PULL: f64 = 1e-6;
/// Edge length in degrees of a square with the solid angle of an octant, π/2 sr.
pub(super) const OCTANT_DEGREES: f64 = 71.809_610_472_257_87;
/// Sum of sample weights (1 for a fully covered triangle) below which a triangle counts as not covered: only rounding
/// errors stay below it.
const COVERED: f64 = 1e-9;

/// Sparse weights for the average over each triangle: `value = Σ weight·sample / (Σ weight + zero)`. Missing samples
/// drop out of both sums (normalised averaging, Knutsson & Westin 1993). `zero` is the fraction of the triangle in
/// which the value is 0.
#[derive(Clone, Debug)]
pub(super) struct Averages {
    /// Position of the first (sample, weight) entry of each triangle, followed by the total number of entries.
    starts: Vec<usize>,
    samples: Vec<u32>,
    weights: Vec<f64>,
    zeros: Vec<f64>,
}

/// Sample weights of the average over one triangle, under construction.
struct Cell {
    entries: Vec<(u32, f64)>,
    zero: f64,
}

impl Averages {
    /// Creates the averages over the triangles of `mesh` of the bilinear interpolant on checked `angles`, by the
    /// midpoint rule. Every triangle is split into 4^k parts (see [`divisions`]), whose values at the centroids are
    /// weighted by solid angle. Parts on the boundary of the covered range are split further. If `is_parted`, nothing
    /// is interpolated across the horizon.
    pub(super) fn over_triangles(mesh: TriangleMesh, angles: &Angles, outside: Outside, is_parted: bool) -> Self {
        let interpolant = Interpolant::new(angles, is_parted);
        let divisions = divisions(mesh, angles);
        let cells: Vec<Cell> = mesh
            .all_vertices()
            .into_par_iter()
            .map(|vertices| {
                let mut tally = Tally::new(&interpolant, 0);
                tally.split(vertices, divisions);
                if tally.outside > 0.0 && tally.outside < tally.total {
                    tally = Tally::new(&interpolant, RIM_DIVISIONS);
                    tally.split(vertices, divisions);
                }
                tally.finish(outside)
            })
            .collect();
        Self::from_cells(&cells)
    }

    /// Creates the averages over the triangles of a mesh `depth` levels coarser than `fine`, from their `4^depth`
    /// children weighted by solid angle.
    pub(super) fn over_children(fine: TriangleMesh, depth: u8) -> Self {
        let children = 1_usize << (2 * u32::from(depth));
        let cells: Vec<Cell> = fine
            .solid_angles()
            .chunks(children)
            .enumerate()
            .map(|(parent, angles)| {
                let total: f64 = angles.iter().sum();
                let first = parent * children;
                let entries = angles.iter().enumerate().map(|(c, angle)| ((first + c) as u32, angle / total)).collect();
                Cell { entries, zero: 0.0 }
            })
            .collect();
        Self::from_cells(&cells)
    }

    fn from_cells(cells: &[Cell]) -> Self {
        let count = cells.iter().map(|cell| cell.entries.len()).sum();
        let mut averages = Self {
            starts: Vec::with_capacity(cells.len() + 1),
            samples: Vec::with_capacity(count),
            weights: Vec::with_capacity(count),
            zeros: cells.iter().map(|cell| cell.zero).collect(),
        };
        averages.starts.push(0);
        for cell in cells {
            averages.samples.extend(cell.entries.iter().map(|entry| entry.0));
            averages.weights.extend(cell.entries.iter().map(|entry| entry.1));
            averages.starts.push(averages.samples.len());
        }
        averages
    }

    pub(super) fn len(&self) -> usize {
        self.zeros.len()
    }

    /// Returns true if no sample takes part in the average over triangle number `cell`. The average then is 0 or NaN,
    /// independent of the values of the samples.
    pub(super) fn is_empty(&self, cell: usize) -> bool {
        self.starts[cell] == self.starts[cell + 1]
    }

    /// Writes into `sums` the averages over the triangle `cell`, one for each of `sums.len()` values of a sample, or
    /// NaN if nothing covers the triangle. Sample `s` starts at `offset + s · stride`. `missing` is true if there may
    /// be NaN among the values. `weights` is scratch space of equal length, overwritten before it is read.
    pub(super) fn average<T: Copy + Into<f64>>(
        &self,
        cell: usize,
        source: &[T],
        (offset, stride): (usize, usize),
        missing: bool,
        sums: &mut [f64],
        weights: &mut [f64],
    ) {
        let width = sums.len();
        let range = self.starts[cell]..self.starts[cell + 1];
        let entries = self.samples[range.clone()].iter().zip(&self.weights[range]);
        let zero = self.zeros[cell];
        sums.fill(0.0);
        if missing {
            weights.fill(zero);
            for (&sample, &weight) in entries {
                let row = &source[offset + sample as usize * stride..][..width];
                for ((sum, total), &value) in sums.iter_mut().zip(weights.iter_mut()).zip(row) {
                    let value: f64 = value.into();
                    if !value.is_nan() {
                        *sum += weight * value;
                        *total += weight;
                    }
                }
            }
            for (sum, &total) in sums.iter_mut().zip(weights.iter()) {
                *sum = if total > COVERED { *sum / total } else { f64::NAN };
            }
        } else {
            let mut total = zero;
            for (&sample, &weight) in entries {
                let row = &source[offset + sample as usize * stride..][..width];
                for (sum, &value) in sums.iter_mut().zip(row) {
                    *sum += weight * value.into();
                }
                total += weight;
            }
            if total > COVERED {
                for sum in sums.iter_mut() {
                    *sum /= total;
                }
            } else {
                sums.fill(f64::NAN);
            }
        }
    }
}

/// Returns how many times each triangle of `mesh` is split into four, so that its parts are at most half the finest
/// spacing of `angles`.
pub(super) fn divisions(mesh: TriangleMesh, angles: &Angles) -> u32 {
    let level = u32::from(mesh.level());
    let wanted = libm::ceil(libm::log2(2.0 * OCTANT_DEGREES / finest_spacing(angles)));
    let finest = wanted.clamp(0.0, f64::from(FINEST_LEVEL)) as u32;
    finest.max((level + USUAL_DIVISIONS).min(FINEST_LEVEL)).saturating_sub(level).max(MIN_DIVISIONS)
}

/// Running sums, over the parts of one triangle, of the weight of each sample in the average over the triangle.
struct Tally<'a> {
    interpolant: &'a Interpolant<'a>,
    entries: Vec<(u32, f64)>,
    /// Weights of the grid's rows at a pole, as (row, weight). The value at a pole is the mean of the row's samples
    /// over azimuth.
    poles: Vec<(usize, f64)>,
    outside: f64,
    total: f64,
    rim_divisions: u32,
}

impl<'a> Tally<'a> {
    fn new(interpolant: &'a Interpolant<'a>, rim_divisions: u32) -> Self {
        Self { interpolant, entries: Vec::new(), poles: Vec::new(), outside: 0.0, total: 0.0, rim_divisions }
    }

    fn split(&mut self, vertices: Vertices, divisions: u32) {
        if divisions > 0 {
            for c in 0..4 {
                self.split(child(vertices, c), divisions - 1);
            }
            // Neighbouring parts share samples: merging on the way up keeps the list as short as the cell's samples.
            merge(&mut self.entries);
        } else {
            self.split_at_rim(vertices, self.rim_divisions);
        }
    }

    fn split_at_rim(&mut self, vertices: Vertices, divisions: u32) {
        if divisions > 0 && self.is_on_rim(vertices) {
            for c in 0..4 {
                self.split_at_rim(child(vertices, c), divisions - 1);
            }
        } else {
            self.add(vertices);
        }
    }

    fn is_on_rim(&self, vertices: Vertices) -> bool {
        let centre = centroid(vertices).xyz();
        let covered = vertices.map(|v| {
            let pulled = unit(add(scale(v, 1.0 - PULL), scale(centre, PULL)));
            self.interpolant.covers(Direction::from_unit(pulled))
        });
        covered != [covered[0]; 3]
    }

    /// Adds one part of a triangle to the triangle's average: the interpolated value at the centroid of the part,
    /// weighted by its solid angle.
    fn add(&mut self, vertices: Vertices) {
        let angle = solid_angle(vertices);
        self.total += angle;
        let Some(stencil) = self.interpolant.at(centroid(vertices)) else {
            self.outside += angle;
            return;
        };
        for (row, row_weight) in stencil.rows {
            if row_weight == 0.0 {
                continue;
            }
            if self.interpolant.is_pole(row) {
                match self.poles.iter_mut().find(|pole| pole.0 == row) {
                    Some(pole) => pole.1 += angle * row_weight,
                    None => self.poles.push((row, angle * row_weight)),
                }
                continue;
            }
            for (column, column_weight) in stencil.columns {
                if column_weight > 0.0 {
                    let sample = (row * self.interpolant.columns() + column) as u32;
                    self.entries.push((sample, angle * row_weight * column_weight));
                }
            }
        }
    }

    fn finish(mut self, outside: Outside) -> Cell {
        for (row, weight) in self.poles {
            let first = row * self.interpolant.columns();
            let mean = self.interpolant.azimuth_mean();
            self.entries.extend(mean.iter().enumerate().map(|(c, share)| ((first + c) as u32, weight * share)));
        }
        merge(&mut self.entries);
        let total = self.total;
        self.entries.iter_mut().for_each(|entry| entry.1 /= total);
        let zero = if outside == Outside::Zero { self.outside / total } else { 0.0 };
        Cell { entries: self.entries, zero }
    }
}

/// Sorts (sample, weight) entries by sample, and sums the weights of equal samples in their order of arrival.
fn merge(entries: &mut Vec<(u32, f64)>) {
    entries.sort_by_key(|entry| entry.0);
    entries.dedup_by(|later, kept| {
        let same = later.0 == kept.0;
        if same {
            kept.1 += later.1;
        }
        same
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Domain;
    use crate::formats::{AzimuthExtent, Azimuths};

    fn even(step: f64, to: f64) -> Vec<f64> {
        (0..=(to / step).round() as usize).map(|i| i as f64 * step).collect()
    }

    fn grid(theta_step: f64, phi_step: f64, top: f64) -> Angles {
        let mut phi = even(phi_step, 360.0);
        phi.pop();
        Angles {
            theta: even(theta_step, top),
            covers: (0.0, top),
            phi: Some(Azimuths { phi, extent: AzimuthExtent::Circle }),
        }
    }

    fn mesh(domain: Domain, level: u8) -> TriangleMesh {
        TriangleMesh::new(domain, level).unwrap()
    }

    fn averages(mesh: TriangleMesh, angles: &Angles, outside: Outside, samples: &[f64]) -> Vec<f64> {
        let operator = Averages::over_triangles(mesh, angles, outside, false);
        let missing = samples.iter().any(|s| s.is_nan());
        let mut value = [0.0];
        let mut scratch = [0.0];
        (0..operator.len())
            .map(|cell| {
                operator.average(cell, samples, (0, 1), missing, &mut value, &mut scratch);
                value[0]
            })
            .collect()
    }

    fn sampled(angles: &Angles, f: impl Fn(Direction) -> f64) -> Vec<f64> {
        let phi = angles.phi.as_ref().unwrap();
        angles.theta.iter().flat_map(|&t| phi.phi.iter().map(move |&p| Direction::from_degrees(t, p))).map(f).collect()
    }

    #[test]
    fn an_octant_has_the_size_stated() {
        let size = mesh(Domain::Sphere, 0).solid_angle(0).sqrt().to_degrees();
        assert!((size - OCTANT_DEGREES).abs() < 1e-12, "{size}");
    }

    #[test]
    fn weights_and_zeros_fill_every_cell() {
        for (angles, outside) in [(grid(10.0, 30.0, 180.0), Outside::Masked), (grid(7.0, 45.0, 77.0), Outside::Zero)] {
            for level in 0..4 {
                let operator = Averages::over_triangles(mesh(Domain::Sphere, level), &angles, outside, false);
                for cell in 0..operator.len() {
                    let weights = &operator.weights[operator.starts[cell]..operator.starts[cell + 1]];
                    let total = weights.iter().sum::<f64>() + operator.zeros[cell];
                    assert!(
                        (total - 1.0).abs() < 1e-12 && weights.iter().all(|&w| w >= 0.0),
                        "{level} {cell}: {total}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_mean_of_z_over_a_cell_is_its_projected_solid_angle() {
        // The average of z over a triangle is known exactly; the interpolant's error falls with the square of the
        // step.
        let m = mesh(Domain::Hemisphere, 2);
        let exact: Vec<f64> = (0..m.len()).map(|i| m.projected_solid_angle(i) / m.solid_angle(i)).collect();
        let mut before = f64::MAX;
        for step in [30.0, 15.0, 7.5, 3.75] {
            let angles = grid(step, 2.0 * step, 90.0);
            let found = averages(m, &angles, Outside::Masked, &sampled(&angles, Direction::cos_theta));
            let worst = found.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 0.4 * before, "{step}: {worst} after {before}");
            before = worst;
        }
        assert!(before < 1e-3, "{before}");
    }

    #[test]
    fn smooth_functions_average_to_fine_quadrature() {
        let f = |d: Direction| {
            let [x, y, z] = d.xyz();
            1.0 + x * y + 0.5 * z * z * z - 0.3 * x
        };
        let (m, fine) = (mesh(Domain::Sphere, 1), mesh(Domain::Sphere, 6));
        let angles = grid(2.0, 4.0, 180.0);
        let found = averages(m, &angles, Outside::Masked, &sampled(&angles, f));
        let share = fine.len() / m.len();
        for (cell, value) in found.iter().enumerate() {
            let children = cell * share..(cell + 1) * share;
            let exact: f64 =
                children.map(|i| fine.solid_angle(i) * f(fine.centroid(i))).sum::<f64>() / m.solid_angle(cell);
            assert!((value - exact).abs() < 2e-3, "{cell}: {value} vs {exact}");
        }
    }

    #[test]
    fn poles_are_the_mean_over_azimuth() {
        let angles = grid(90.0, 90.0, 90.0);
        let samples = [1.0, 3.0, 5.0, 7.0, 4.0, 4.0, 4.0, 4.0];
        for value in averages(mesh(Domain::Hemisphere, 3), &angles, Outside::Masked, &samples) {
            assert!((value - 4.0).abs() < 1e-12);
        }
    }

    #[test]
    fn missing_samples_drop_out_and_cells_without_any_are_masked() {
        let angles = grid(5.0, 10.0, 90.0);
        let hole = |d: Direction| if d.xyz()[0] < 0.0 { f64::NAN } else { 2.0 };
        let m = mesh(Domain::Hemisphere, 3);
        let found = averages(m, &angles, Outside::Masked, &sampled(&angles, hole));
        assert!(found.iter().all(|v| v.is_nan() || (v - 2.0).abs() < 1e-12));
        for (cell, value) in found.iter().enumerate() {
            let x = m.centroid(cell).xyz()[0];
            assert!(value.is_nan() || x > -0.3, "{cell}");
            assert!(!value.is_nan() || x < 0.0, "{cell}");
        }
    }

    #[test]
    fn children_average_by_solid_angle() {
        let fine = mesh(Domain::Lower, 3);
        let operator = Averages::over_children(fine, 2);
        let samples: Vec<f64> = (0..fine.len()).map(|i| if i == 5 { f64::NAN } else { i as f64 }).collect();
        assert_eq!(operator.len(), 16);
        let (mut value, mut scratch) = ([0.0], [0.0]);
        operator.average(1, &samples, (0, 1), true, &mut value, &mut scratch);
        let range = 16..32;
        let total: f64 = range.clone().map(|i| fine.solid_angle(i)).sum();
        let expected: f64 = range.map(|i| fine.solid_angle(i) * i as f64).sum::<f64>() / total;
        assert!((value[0] - expected).abs() < 1e-12);
        operator.average(0, &samples, (0, 1), true, &mut value, &mut scratch);
        assert!(value[0].is_finite());
    }

    #[test]
    fn parts_are_at_most_half_the_finest_spacing() {
        for level in 0..=6 {
            for step in [1.0, 2.5, 10.0, 45.0] {
                let angles = grid(step, 2.0 * step, 90.0);
                let k = divisions(mesh(Domain::Hemisphere, level), &angles);
                let part = OCTANT_DEGREES / 2.0_f64.powi(i32::from(level) + k as i32);
                assert!(k >= MIN_DIVISIONS && part <= 0.5 * step, "{level} {step}: {k}");
            }
        }
    }
}
