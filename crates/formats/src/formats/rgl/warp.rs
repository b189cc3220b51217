//! Mathematics of the adaptive parameterisation: angles to the unit square, bilinear maps, marginal–conditional warps.
//!
//! Dupuy & Jakob 2018, *An Adaptive Parameterization for Efficient Material Acquisition and Rendering*, section 4. A
//! point of the unit square is `[column, row]`, each 0..=1. A map holds values at nodes, including those on the
//! boundary.

use crate::numeric::bracket::Bracket;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Indices of stored incident directions with their weights of interpolation; weights of 0 are left out.
pub(super) type Weighted<'a> = &'a [(usize, f64)];

/// Weight of interpolation below which an angle counts as equal to a stored one, because the difference is a rounding
/// error.
const SNAP: f64 = 1e-9;

/// Maps a polar angle in radians to 0..=1, densely around the normal.
pub(super) fn elevation_to_unit(theta: f64) -> f64 {
    (theta / FRAC_PI_2).sqrt()
}

/// Maps 0..=1 to a polar angle in radians, densely around the normal.
pub(super) fn unit_to_elevation(u: f64) -> f64 {
    u * u * FRAC_PI_2
}

/// Maps an azimuth in radians, −π..=π, to 0..=1.
pub(super) fn azimuth_to_unit(phi: f64) -> f64 {
    (phi + PI) / TAU
}

/// Maps 0..=1 to an azimuth in radians, −π..=π.
pub(super) fn unit_to_azimuth(u: f64) -> f64 {
    (2.0 * u - 1.0) * PI
}

/// Returns the indices of the numbers in `nodes` around `x` with their weights of linear interpolation, clamped at the
/// ends.
pub(super) fn between(nodes: &[f64], x: f64) -> [(usize, f64); 2] {
    Bracket::held(nodes, x).snapped(SNAP).weights()
}

/// Returns the index of the interval that contains `u` (0..=1) among `nodes` evenly spaced nodes, and the position
/// within it (0..=1).
pub(super) fn cell(u: f64, nodes: usize) -> (usize, f64) {
    let scaled = u.clamp(0.0, 1.0) * (nodes - 1) as f64;
    let i = (scaled as usize).min(nodes - 2);
    (i, scaled - i as f64)
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + t * (b - a)
}

/// Bilinear function on the unit square, given at evenly spaced nodes.
#[derive(Debug)]
pub(super) struct Map {
    columns: usize,
    rows: usize,
    values: Vec<f32>,
}

impl Map {
    /// Creates a bilinear function from its values at the nodes, row by row, with at least two rows and columns.
    pub(super) fn new(rows: usize, columns: usize, values: Vec<f32>) -> Self {
        debug_assert!(rows >= 2 && columns >= 2 && values.len() == rows * columns, "checked by the reader");
        Self { columns, rows, values }
    }

    pub(super) fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let ((i, a), (j, b)) = (cell(x, self.columns), cell(y, self.rows));
        let value = |j: usize, i: usize| f64::from(self.values[j * self.columns + i]);
        mix(mix(value(j, i), value(j, i + 1), a), mix(value(j + 1, i), value(j + 1, i + 1), a), b)
    }
}

/// Invertible mapping between the unit square with a bilinear density and the square with uniform density, for each
/// stored incident direction. Between incident directions, densities and their integrals are interpolated with one set
/// of linear weights. Integrals take neighbouring nodes as 1 apart, since only their ratios matter.
#[derive(Debug)]
pub(super) struct Warp {
    columns: usize,
    rows: usize,
    density: Vec<f32>,
    /// Integrals of the density along each row of a density table, from the row's first node up to each node; 0 at the
    /// first node. The tables of all incident directions follow one another.
    conditional: Vec<f64>,
    /// Integrals of the density over the part of a density table between its first row of nodes and each row; 0 for the
    /// first row. The tables of all incident directions follow one another.
    marginal: Vec<f64>,
    /// Integral of the density table of each stored incident direction, by which its density is normalised.
    total: Vec<f64>,
}

impl Warp {
    /// Creates, for each incident direction, the invertible mapping between a unit square with bilinear density and one
    /// with uniform density. `density` holds numbers ≥ 0, incident direction by incident direction and row by row. The
    /// error is the index of the first incident direction whose density is 0 in total.
    pub(super) fn new(rows: usize, columns: usize, density: Vec<f32>) -> Result<Self, usize> {
        debug_assert!(rows >= 2 && columns >= 2, "checked by the reader");
        let mut conditional = Vec::with_capacity(density.len());
        for row in density.chunks_exact(columns) {
            let mut sum = 0.0;
            conditional.push(sum);
            for &[a, b] in row.array_windows() {
                sum += 0.5 * (f64::from(a) + f64::from(b));
                conditional.push(sum);
            }
        }
        let mut marginal = Vec::with_capacity(density.len() / columns);
        let mut total = Vec::with_capacity(density.len() / (rows * columns));
        for slice in conditional.chunks_exact(rows * columns) {
            let mass = |row: usize| slice[row * columns + columns - 1];
            let mut sum = 0.0;
            marginal.push(sum);
            for row in 1..rows {
                sum += 0.5 * (mass(row - 1) + mass(row));
                marginal.push(sum);
            }
            if sum <= 0.0 {
                return Err(total.len());
            }
            total.push(sum);
        }
        Ok(Self { columns, rows, density, conditional, marginal, total })
    }

    /// Maps a point of a unit square with bilinear density to one with uniform density. `None` if the density is 0 all
    /// along the line through the point that is parallel to the rows of nodes.
    pub(super) fn invert(&self, slices: Weighted<'_>, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let ((i, a), (j, b)) = (cell(x, self.columns), cell(y, self.rows));
        let rows = self.rows_at(slices, j);
        let mass = mix(rows.mass[0], rows.mass[1], b);
        if mass <= 0.0 {
            return None;
        }
        let edge =
            |i: usize| mix(self.sum(slices, j, i, Self::density_at), self.sum(slices, j + 1, i, Self::density_at), b);
        let (c0, c1) = (edge(i), edge(i + 1));
        let before =
            mix(self.sum(slices, j, i, Self::conditional_at), self.sum(slices, j + 1, i, Self::conditional_at), b);
        let column = (before + a * mix(c0, c1, 0.5 * a)) / mass;
        Some([column, rows.before + b * mix(rows.mass[0], rows.mass[1], 0.5 * b)])
    }

    /// Maps a point of the unit square with uniform density to one of the square with bilinear density. Also returns
    /// the bilinear density at the mapped point, normalised to integrate to 1.
    pub(super) fn warp(&self, slices: Weighted<'_>, [x, y]: [f64; 2]) -> ([f64; 2], f64) {
        let j = search(self.rows - 1, |j| self.rows_at(slices, j).before <= y);
        let rows = self.rows_at(slices, j);
        let b = solve(y - rows.before, rows.mass);
        let wanted = x * mix(rows.mass[0], rows.mass[1], b);
        let before = |i: usize| {
            mix(self.sum(slices, j, i, Self::conditional_at), self.sum(slices, j + 1, i, Self::conditional_at), b)
        };
        let i = search(self.columns - 1, |i| before(i) <= wanted);
        let edge =
            |i: usize| mix(self.sum(slices, j, i, Self::density_at), self.sum(slices, j + 1, i, Self::density_at), b);
        let ends = [edge(i), edge(i + 1)];
        let a = solve(wanted - before(i), ends);
        let (width, height) = ((self.columns - 1) as f64, (self.rows - 1) as f64);
        let point = [(i as f64 + a) / width, (j as f64 + b) / height];
        (point, mix(ends[0], ends[1], a) * width * height)
    }

    fn rows_at(&self, slices: Weighted<'_>, j: usize) -> Rows {
        let last = self.columns - 1;
        Rows {
            before: slices.iter().map(|&(s, w)| w * self.marginal[s * self.rows + j] / self.total[s]).sum(),
            mass: [j, j + 1].map(|j| self.sum(slices, j, last, Self::conditional_at)),
        }
    }

    /// Returns a value at node (row `j`, column `i`) of the density tables that `of` selects: the density, or its
    /// integral along row `j` up to the node. The value is divided by the integral over the table, and interpolated
    /// between incident directions.
    fn sum(&self, slices: Weighted<'_>, j: usize, i: usize, of: fn(&Self, usize) -> f64) -> f64 {
        slices.iter().map(|&(s, w)| w * of(self, (s * self.rows + j) * self.columns + i) / self.total[s]).sum()
    }

    fn density_at(&self, index: usize) -> f64 {
        f64::from(self.density[index])
    }

    fn conditional_at(&self, index: usize) -> f64 {
        self.conditional[index]
    }
}

/// Integrals of a density on the unit square that is given at rows of nodes: over the part before a strip between two
/// neighbouring rows, and along both edges of the strip.
struct Rows {
    /// Fraction of the integral of a density over the unit square that lies between its edge at coordinate 0 and a
    /// strip between two neighbouring rows of the density's nodes.
    before: f64,
    /// Integrals of the density along both edges of a strip between two neighbouring rows of nodes, as fractions of the
    /// integral over the unit square.
    mass: [f64; 2],
}

/// Returns by bisection the last index of `0..cells` for which `before` is true; 0 if there is none. `before` must be
/// true up to some index and false after it.
fn search(cells: usize, before: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, cells);
    while high - low > 1 {
        let middle = usize::midpoint(low, high);
        if before(middle) { low = middle } else { high = middle }
    }
    low
}

/// Returns the position (0..=1) at which the integral of a density, linear from `start` to `end`, reaches `area`. The
/// formula is stable for equal ends.
fn solve(area: f64, [start, end]: [f64; 2]) -> f64 {
    if start + end <= 0.0 || area <= 0.0 {
        return 0.0;
    }
    let root = (start * start - 2.0 * area * (start - end)).max(0.0).sqrt();
    (2.0 * area / (start + root)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a test mapping for densities of three incident directions on 5 × 7 nodes. The density of the second
    /// incident direction is 0 along one row of nodes.
    fn warp() -> Warp {
        let density = (0..105).map(|k| if k / 7 == 7 { 0.0 } else { 0.2 + (k * k % 11) as f32 }).collect();
        Warp::new(5, 7, density).unwrap()
    }

    #[test]
    fn angles_round_trip() {
        for u in [0.0, 0.1, 0.5, 0.77, 1.0] {
            assert!((elevation_to_unit(unit_to_elevation(u)) - u).abs() < 1e-15);
            assert!((azimuth_to_unit(unit_to_azimuth(u)) - u).abs() < 1e-15);
        }
        assert_eq!((unit_to_elevation(1.0), azimuth_to_unit(0.0)), (FRAC_PI_2, 0.5));
    }

    #[test]
    fn nodes_are_held_beyond_their_ends() {
        let nodes = [0.5, 1.0, 3.0];
        assert_eq!(between(&nodes, 0.0), [(0, 1.0), (0, 0.0)]);
        assert_eq!(between(&nodes, 0.5), [(0, 1.0), (1, 0.0)]);
        assert_eq!(between(&nodes, 1.0 + 1e-12), [(1, 1.0), (2, 0.0)]);
        assert_eq!(between(&nodes, 2.5), [(1, 0.25), (2, 0.75)]);
        assert_eq!(between(&nodes, 9.0), [(2, 1.0), (2, 0.0)]);
        assert_eq!(between(&[7.0], 9.0), [(0, 1.0), (0, 0.0)]);
        assert_eq!((cell(0.0, 5), cell(1.0, 5), cell(0.5, 2)), ((0, 0.0), (3, 1.0), (0, 0.5)));
    }

    #[test]
    fn a_map_is_bilinear_between_its_nodes() {
        let map = Map::new(2, 3, vec![0.0, 1.0, 2.0, 4.0, 5.0, 6.0]);
        assert_eq!(map.at([1.0, 1.0]), 6.0);
        assert_eq!(map.at([0.25, 0.5]), 2.5);
    }

    #[test]
    fn the_warp_and_its_inverse_meet() {
        let warp = warp();
        for slices in [&[(0, 1.0)][..], &[(1, 1.0)], &[(0, 0.3), (1, 0.7)], &[(0, 0.1), (1, 0.4), (2, 0.5)]] {
            for k in 0..400 {
                let s = [(f64::from(k % 20) + 0.37) / 20.0, (f64::from(k / 20) + 0.61) / 20.0];
                let (u, density) = warp.warp(slices, s);
                let back = warp.invert(slices, u).unwrap();
                assert!(
                    density > 0.0 && (back[0] - s[0]).abs() < 1e-9 && (back[1] - s[1]).abs() < 1e-9,
                    "{s:?} {back:?}"
                );
            }
        }
    }

    #[test]
    fn the_density_is_that_of_the_inverse() {
        let warp = warp();
        let slices = [(0, 0.4), (2, 0.6)];
        for s in [[0.3, 0.2], [0.71, 0.55], [0.12, 0.93]] {
            let (u, density) = warp.warp(&slices, s);
            let step = 1e-6;
            let at = |dx: f64, dy: f64| warp.invert(&slices, [u[0] + dx, u[1] + dy]).unwrap();
            let (x, y) = ([at(step, 0.0), at(-step, 0.0)], [at(0.0, step), at(0.0, -step)]);
            let d = |ends: [[f64; 2]; 2], k: usize| (ends[0][k] - ends[1][k]) / (2.0 * step);
            let jacobian = d(x, 0) * d(y, 1) - d(x, 1) * d(y, 0);
            assert!((jacobian / density - 1.0).abs() < 1e-6, "{jacobian} {density}");
        }
    }

    #[test]
    fn a_uniform_density_leaves_points_where_they_are() {
        let warp = Warp::new(3, 4, vec![0.7; 12]).unwrap();
        assert_eq!(warp.invert(&[(0, 1.0)], [0.0, 0.0]), Some([0.0, 0.0]));
        let [x, y] = warp.invert(&[(0, 1.0)], [0.43, 0.81]).unwrap();
        assert!((x - 0.43).abs() < 1e-15 && (y - 0.81).abs() < 1e-15);
    }

    #[test]
    fn nothing_divides_by_an_empty_row_or_slice() {
        let warp = warp();
        assert_eq!(warp.invert(&[(1, 1.0)], [0.5, 0.5]), None);
        let mut density = vec![1.0; 12];
        density[6..].fill(0.0);
        assert_eq!(Warp::new(2, 3, density).unwrap_err(), 1);
    }
}
