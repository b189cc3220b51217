//! Scattered directions as points: which samples belong to one incoming direction, and where they lie in its coordinates.

use super::tree::Tree;
use crate::domain::vector::{Vector, add, cross, norm, scale, sub, unit};
use crate::domain::{Direction, Quantity};
use crate::formats::Scattered;

/// Elevations, and incoming directions, that lie closer than this in degrees are one: instruments return to theirs so well.
const SAME: f64 = 0.05;
/// An incoming direction is fitted by itself if it has so many samples on average, else together with its neighbours.
const ALONE: usize = 24;
/// The height of a half vector below which its slope says nothing.
const STEEP: f64 = 1e-3;

/// A sample's directions and coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// The row of its values.
    pub(super) row: u32,
    pub(super) wi: Vector,
    pub(super) wo: Vector,
    /// hx/hz and hy/hz of the half vector; NaN where it has none.
    pub(super) slope: [f64; 2],
}

/// Samples that are fitted together.
#[derive(Clone, Debug)]
pub(super) struct Cloud {
    pub(super) points: Vec<Point>,
    pub(super) tree: Tree<6>,
    /// Where each point lies in the tree.
    pub(super) keys: Vec<[f64; 6]>,
    /// How much a difference of incoming directions counts against one of outgoing ones; 0 where they are all one.
    pub(super) stretch: f64,
    /// Whether slopes are the coordinates.
    pub(super) slopes: bool,
}

/// The samples by incoming direction.
#[derive(Clone, Debug)]
pub(super) enum Incoming {
    /// There are no incoming directions.
    None,
    /// Elevations of isotropic data, each with its own samples.
    Elevations(Vec<f64>, Vec<Vec<u32>>),
    /// Elevations that all samples serve.
    AllElevations(Vec<f64>),
    /// So many distinct directions.
    Directions(usize),
}

/// The slope of the half vector; NaN where it lies in the surface.
pub(super) fn slope(wi: Vector, wo: Vector) -> [f64; 2] {
    let h = add(wi, wo);
    if h[2] < STEEP { [f64::NAN; 2] } else { [h[0] / h[2], h[1] / h[2]] }
}

/// Two unit vectors that span the plane at right angles to `d`, the first away from `+z`.
pub(super) fn tangents(d: Vector) -> [Vector; 2] {
    let along = sub([0.0, 0.0, 1.0], scale(d, d[2]));
    let first = if norm(along) > 1e-6 { unit(along) } else { unit(sub([1.0, 0.0, 0.0], scale(d, d[0]))) };
    [first, cross(d, first)]
}

/// The directions of every sample; those of isotropic data are above the x axis.
pub(super) fn directions(scattered: &Scattered, isotropic: bool) -> Vec<(Vector, Vector)> {
    let up = [0.0, 0.0, 1.0];
    (0..scattered.directions())
        .map(|i| {
            let turned = if isotropic { scattered.incoming.get(i).map_or(0.0, |wi| wi[1]) } else { 0.0 };
            let of = |angles: &[[f64; 2]]| {
                angles.get(i).map_or(up, |&[theta, phi]| Direction::from_degrees(theta, phi - turned).vector())
            };
            (of(&scattered.incoming), of(&scattered.outgoing))
        })
        .collect()
}

/// Whether all incoming directions have one azimuth: nothing is known of others.
pub(super) fn one_azimuth(scattered: &Scattered) -> bool {
    let mut azimuths = scattered.incoming.iter().filter(|wi| wi[0] > SAME).map(|wi| wi[1].rem_euclid(360.0));
    let Some(first) = azimuths.next() else { return !scattered.incoming.is_empty() };
    azimuths.all(|phi| {
        let off = (phi - first).abs();
        off.min(360.0 - off) <= SAME
    })
}

/// Groups samples by incoming direction; `live` are the rows with any value.
pub(super) fn incoming(scattered: &Scattered, isotropic: bool, live: &[u32]) -> Incoming {
    if scattered.incoming.is_empty() {
        return Incoming::None;
    }
    if !isotropic {
        let steps = |degrees: f64| (degrees / SAME).round() as i64;
        let mut cells: Vec<[i64; 2]> = live
            .iter()
            .map(|&row| {
                let [theta, phi] = scattered.incoming[row as usize];
                [steps(theta), if theta < SAME { 0 } else { steps(phi.rem_euclid(360.0)) }]
            })
            .collect();
        cells.sort_unstable();
        cells.dedup();
        return Incoming::Directions(cells.len());
    }
    let theta = |row: u32| scattered.incoming[row as usize][0];
    let mut order = live.to_vec();
    order.sort_by(|&a, &b| theta(a).total_cmp(&theta(b)).then(a.cmp(&b)));
    let mut groups: Vec<Vec<u32>> = Vec::new();
    let mut last = f64::NEG_INFINITY;
    for row in order {
        match groups.last_mut().filter(|_| theta(row) - last <= SAME) {
            Some(group) => group.push(row),
            None => groups.push(vec![row]),
        }
        last = theta(row);
    }
    let spread = groups.iter().filter_map(|g| Some(theta(*g.last()?) - theta(*g.first()?))).fold(0.0, f64::max);
    if groups.len() > 1 && live.len() < ALONE * groups.len() || spread > 10.0 * SAME {
        return Incoming::AllElevations(even_elevations(scattered, live));
    }
    let mean = |group: &Vec<u32>| {
        let first = theta(group[0]);
        let offsets: f64 = group.iter().map(|&row| theta(row) - first).sum();
        let mean = first + offsets / group.len() as f64;
        // What instruments aim at has few digits.
        let rounded = (mean * 100.0).round() / 100.0;
        if (mean - rounded).abs() < 1e-3 { rounded } else { mean }.clamp(0.0, 90.0)
    };
    let elevations = groups.iter().map(mean).collect();
    for group in &mut groups {
        group.sort_unstable();
    }
    Incoming::Elevations(elevations, groups)
}

/// As many elevations, evenly between the ends, as three dimensions of samples make of each.
fn even_elevations(scattered: &Scattered, live: &[u32]) -> Vec<f64> {
    let theta = live.iter().map(|&row| scattered.incoming[row as usize][0]);
    let (low, high) = theta.fold((90.0_f64, 0.0_f64), |(l, h), t| (l.min(t), h.max(t)));
    let count = libm::cbrt(live.len() as f64 / 16.0).round().clamp(2.0, 46.0) as usize;
    (0..count).map(|i| low + (high - low) * i as f64 / (count - 1) as f64).collect()
}

impl Cloud {
    /// The samples of `rows`, and their mirror images in the plane of incidence if `mirrored`.
    pub(super) fn new(
        rows: impl Iterator<Item = u32>,
        directions: &[(Vector, Vector)],
        quantity: Quantity,
        stretch: f64,
        mirrored: bool,
    ) -> Self {
        let slopes = quantity == Quantity::Brdf;
        let mut points = Vec::new();
        for row in rows {
            let (wi, wo) = directions[row as usize];
            let images = [Some(wo), (mirrored && wo[1] != 0.0).then_some([wo[0], -wo[1], wo[2]])];
            for wo in images.into_iter().flatten() {
                points.push(Point { row, wi, wo, slope: if slopes { slope(wi, wo) } else { [f64::NAN; 2] } });
            }
        }
        let mut cloud = Self { points, tree: Tree::new(&[]), keys: Vec::new(), stretch, slopes };
        cloud.keys = cloud.points.iter().map(|p| cloud.key(p.wi, p.wo)).collect();
        cloud.tree = Tree::new(&cloud.keys);
        cloud
    }

    /// The samples `rows` with their mirror images, in the coordinates of `other`.
    pub(super) fn mirrored_like(
        other: &Self,
        rows: impl Iterator<Item = u32>,
        directions: &[(Vector, Vector)],
    ) -> Self {
        let quantity = if other.slopes { Quantity::Brdf } else { Quantity::Bsdf };
        Self::new(rows, directions, quantity, other.stretch, true)
    }

    /// Where directions lie in the tree: chords are as long as those between outgoing directions, and for reflection as those
    /// between half vectors, which move half as far but where both directions graze. There lobes are narrow across.
    pub(super) fn key(&self, wi: Vector, wo: Vector) -> [f64; 6] {
        if !self.slopes {
            let [a, b, c] = scale(wi, self.stretch);
            return [wo[0], wo[1], wo[2], a, b, c];
        }
        let h = scale(unit(add(add(wi, wo), [0.0, 0.0, 1e-9])), 2.0);
        if self.stretch > 0.0 {
            let [a, b, c] = scale(wi, self.stretch);
            return [h[0], h[1], h[2], a, b, c];
        }
        [wo[0], wo[1], wo[2], h[0], h[1], h[2]].map(|x| x * std::f64::consts::FRAC_1_SQRT_2)
    }
}
