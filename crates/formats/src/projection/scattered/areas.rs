//! Solid angle that each sample of an incidence represents: the area of its Voronoi cell on the sphere.
//!
//! In the gnomonic projection about a sample, borders to other samples are straight lines. The cell starts as a square
//! as wide as the usual sample spacing. The border to each neighbour cuts it, nearest first, until no farther one can
//! reach it.
//!
//! The result is exact except at the edge of the scan: there the square bounds the cell, and the horizon does. Samples
//! of one direction share its cell. Samples of a plane of incidence weigh 1 each.

use super::cloud::tangents;
use super::tree::{Found, Tree, nearness};
use crate::domain::vector::{Vector, add, cross, dot, norm, scale, unit};
use crate::domain::{Domain, solid_angle};
use rayon::prelude::*;

/// Numbers of nearest samples tried in turn to bound a Voronoi cell, until no farther sample can cut it.
const NEIGHBOURS: [usize; 3] = [16, 64, 256];
/// Half the width of the square from which a Voronoi cell is cut, in sample spacings. In even scans the corners of
/// cells lie within 0.7 of them. Raising it lets cells at the edge of a scan grow larger.
const HALF_WIDTH: f64 = 1.5;
/// Upper bound in radians on half the width of the square from which a Voronoi cell is cut.
const WIDEST: f64 = 1.0;
/// Number of nearest neighbours of a direction: the distance to the farthest of them gives the sample spacing.
const DENSITY: usize = 6;
/// Squared chord (on the unit sphere) below which two sample directions count as equal.
const SAME: f64 = 1e-14;
/// Sine of the angle between a sample and a plane below which the sample counts as lying in the plane: 0.6°.
const IN_PLANE: f64 = 0.01;

/// Returns the solid angles in sr that `directions` represent: the areas of their Voronoi cells on the part `domain` of
/// the sphere. Returns `None` if all directions lie in one plane.
pub(in crate::projection) fn areas(directions: &[Vector], domain: Domain) -> Option<Vec<f64>> {
    if are_in_plane(directions) {
        return None;
    }
    let side = match domain {
        Domain::Hemisphere => 1.0,
        Domain::Lower => -1.0,
        Domain::Sphere => 0.0,
    };
    let whole = if side == 0.0 { 2.0 } else { 1.0 } * std::f64::consts::TAU;
    let usual = (whole / directions.len() as f64).sqrt();
    let (tree, order) = Tree::new(directions.iter().copied());
    let cell = |scratch: &mut Scratch, point: usize| scratch.cell(&tree, point as u32, usual, side);
    let found: Vec<f64> = (0..order.len()).into_par_iter().map_init(Scratch::default, cell).collect();
    let mut areas = vec![0.0; directions.len()];
    order.into_iter().zip(found).for_each(|(number, area)| areas[number as usize] = area);
    Some(areas)
}

/// Returns true if all directions lie in one plane through the origin.
fn are_in_plane(directions: &[Vector]) -> bool {
    let Some(&first) = directions.first() else { return true };
    let across = |d: &Vector| cross(first, *d);
    let farthest = directions.iter().map(across).fold([0.0; 3], |most, d| if norm(d) > norm(most) { d } else { most });
    if norm(farthest) < IN_PLANE {
        return true;
    }
    let normal = unit(farthest);
    directions.iter().all(|d| dot(*d, normal).abs() < IN_PLANE)
}

/// Scratch space of one task that computes Voronoi cells.
#[derive(Default)]
struct Scratch {
    found: Vec<Found>,
    cell: Vec<[f64; 2]>,
    cut: Vec<[f64; 2]>,
}

impl Scratch {
    fn cell(&mut self, tree: &Tree<3>, point: u32, usual: f64, side: f64) -> f64 {
        let own = tree.point(point);
        let axes = tangents(own);
        let mut area = 0.0;
        for count in NEIGHBOURS {
            self.found.clear();
            tree.nearest((&own, 0), count, |other| other != point, &mut self.found);
            self.found.sort_unstable_by_key(nearness);
            let at = DENSITY.min(self.found.len());
            let apart = at
                .checked_sub(1)
                .map_or(usual, |last| usual.max((std::f64::consts::PI * self.found[last].0 / at as f64).sqrt()));
            let half = (HALF_WIDTH * apart).min(WIDEST);
            self.cell.clear();
            self.cell.extend([[-half, -half], [half, -half], [half, half], [-half, half]]);
            if side != 0.0 {
                self.keep([side * own[2], side * axes[0][2], side * axes[1][2]]);
            }
            let mut same = 1.0;
            for near in 0..self.found.len() {
                let (square, other) = self.found[near];
                if square < SAME {
                    same += 1.0;
                } else {
                    let q = tree.point(other);
                    self.keep([1.0 - dot(q, own), -dot(q, axes[0]), -dot(q, axes[1])]);
                }
            }
            area = self.area(own, axes) / same;
            let corner = self.cell.iter().map(|[u, v]| u * u + v * v).fold(0.0, f64::max);
            let farthest = self.found.last().map_or(0.0, |farthest| farthest.0);
            // A chord on the sphere is shorter than its projection, so this test never stops too early.
            if self.found.len() < count || farthest > 4.0 * corner {
                break;
            }
        }
        area
    }

    /// Cuts the Voronoi cell to the half plane `c + a·u + b·v ≥ 0` in tangent coordinates (u, v).
    fn keep(&mut self, [c, a, b]: [f64; 3]) {
        let height = |[u, v]: [f64; 2]| c + a * u + b * v;
        self.cut.clear();
        for (i, &from) in self.cell.iter().enumerate() {
            let to = self.cell[(i + 1) % self.cell.len()];
            let (low, high) = (height(from), height(to));
            if low >= 0.0 {
                self.cut.push(from);
            }
            if (low < 0.0) != (high < 0.0) {
                let share = low / (low - high);
                self.cut.push([from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]);
            }
        }
        std::mem::swap(&mut self.cell, &mut self.cut);
    }

    fn area(&self, own: Vector, axes: [Vector; 2]) -> f64 {
        let at = |[u, v]: [f64; 2]| unit(add(own, add(scale(axes[0], u), scale(axes[1], v))));
        let Some((&first, others)) = self.cell.split_first() else { return 0.0 };
        let first = at(first);
        others.windows(2).map(|pair| solid_angle([first, at(pair[0]), at(pair[1])])).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Direction;
    use std::f64::consts::TAU;

    fn spiral(count: usize) -> Vec<Vector> {
        let at = |i: usize| {
            let z = 1.0 - (i as f64 + 0.5) / count as f64;
            let (sin, cos) = (2.399_963 * i as f64).sin_cos();
            let s = (1.0 - z * z).sqrt();
            [s * cos, s * sin, z]
        };
        (0..count).map(at).collect()
    }

    #[test]
    fn cells_cover_the_hemisphere_once() {
        for count in [50, 400, 3000] {
            let found = areas(&spiral(count), Domain::Hemisphere).unwrap();
            let (sum, usual) = (found.iter().sum::<f64>(), TAU / count as f64);
            assert!((sum / TAU - 1.0).abs() < 0.01, "{count}: {sum}");
            assert!(found.iter().all(|area| (0.3..3.0).contains(&(area / usual))), "{count}");
        }
        // A dense cap within sparse samples.
        let mut directions = spiral(500);
        directions.extend(spiral(40_000).into_iter().filter(|d| d[0] > 0.9 && d[2] < 0.4));
        let sum = areas(&directions, Domain::Hemisphere).unwrap().iter().sum::<f64>();
        assert!((sum / TAU - 1.0).abs() < 0.03, "{sum}");
    }

    #[test]
    fn equal_directions_share_a_cell_and_planes_weigh_alike() {
        let mut directions = spiral(300);
        let once = areas(&directions, Domain::Hemisphere).unwrap();
        directions.push(directions[7]);
        let twice = areas(&directions, Domain::Hemisphere).unwrap();
        assert!((twice[7] / once[7] - 0.5).abs() < 1e-9 && twice[300] == twice[7], "{} {}", once[7], twice[7]);
        let plane: Vec<Vector> = (-8..=8).map(|i| Direction::from_degrees(10.0 * f64::from(i), 0.0).xyz()).collect();
        for few in [&plane[..], &directions[..1], &[]] {
            assert_eq!(areas(few, Domain::Hemisphere), None);
        }
        // Three samples, two of them in one place, and one elsewhere.
        let few = areas(&[directions[0], directions[0], directions[200], [0.0, 1.0, 0.0]], Domain::Hemisphere).unwrap();
        assert!(few.iter().all(|area| *area > 0.0 && *area < TAU), "{few:?}");
    }
}
