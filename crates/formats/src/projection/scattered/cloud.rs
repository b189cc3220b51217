//! Scattered directions as points: which samples belong to one incoming direction, and where they lie in its coordinates.

use super::tree::{Found, Tree};
use crate::domain::vector::{Vector, add, cross, norm, scale, sub, unit};
use crate::domain::{Direction, Quantity};
use crate::formats::Scattered;
use std::sync::Arc;

/// Elevations, and incoming directions, that lie closer than this in degrees are one: instruments return to theirs so well.
const SAME: f64 = 0.05;
/// An incoming direction is fitted by itself if it has so many samples on average, else together with its neighbours.
const ALONE: usize = 24;
/// One of so many samples is withheld.
const TENTH: u32 = 10;
/// The height of a half vector below which its slope says nothing.
const STEEP: f64 = 1e-3;

/// Samples that are fitted together: a column for each thing that is known of them, numbered as in the tree; then their mirror
/// images in the plane of incidence, if these count.
#[derive(Clone, Debug)]
pub(super) struct Cloud {
    /// The rows of their values.
    pub(super) rows: Vec<u32>,
    pub(super) wi: Vec<Vector>,
    pub(super) wo: Vec<Vector>,
    /// hx/hz and hy/hz of the half vector; NaN where it has none.
    pub(super) slope: Vec<[f64; 2]>,
    pub(super) is_withheld: Vec<bool>,
    tree: Arc<Tree<6>>,
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

/// Whether a row is one of the withheld tenth: one of every ten in a row, at no regular distance.
pub(super) fn is_withheld(row: u32) -> bool {
    let mixed = (row / TENTH).wrapping_mul(0x9e37_79b9);
    (mixed ^ (mixed >> 15)) % TENTH == row % TENTH
}

/// Two unit vectors that span the plane at right angles to `d`, the first away from `+z`.
pub(super) fn tangents(d: Vector) -> [Vector; 2] {
    let along = sub([0.0, 0.0, 1.0], scale(d, d[2]));
    let first = if norm(along) > 1e-6 { unit(along) } else { unit(sub([1.0, 0.0, 0.0], scale(d, d[0]))) };
    [first, cross(d, first)]
}

/// The directions of every sample; those of isotropic data are above the x axis.
pub(in crate::projection) fn directions(scattered: &Scattered, isotropic: bool) -> Vec<(Vector, Vector)> {
    let up = [0.0, 0.0, 1.0];
    let of = |[theta, phi]: [f64; 2], turned: f64| Direction::from_degrees(theta, phi - turned).xyz();
    let (mut incoming, mut wi) = (None, up);
    (0..scattered.directions())
        .map(|i| {
            let angles = scattered.incoming.get(i).copied();
            let turned = angles.filter(|_| isotropic).map_or(0.0, |angles| angles[1]);
            // Many samples have the incoming direction of the one before.
            if angles != incoming {
                (incoming, wi) = (angles, angles.map_or(up, |angles| of(angles, turned)));
            }
            (wi, scattered.outgoing.get(i).map_or(up, |&angles| of(angles, turned)))
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
    /// The samples of `rows`.
    pub(super) fn new(
        rows: impl Iterator<Item = u32>,
        directions: &[(Vector, Vector)],
        quantity: Quantity,
        stretch: f64,
    ) -> Self {
        let slopes = quantity == Quantity::Brdf;
        let given: Vec<u32> = rows.collect();
        let of = |row: &u32| directions[*row as usize];
        let (tree, order) = Tree::new(given.iter().map(|row| key(of(row), slopes, stretch)));
        let rows: Vec<u32> = order.into_iter().map(|place| given[place as usize]).collect();
        let (wi, wo): (Vec<Vector>, Vec<Vector>) = rows.iter().map(of).unzip();
        let slope = |(&wi, &wo)| if slopes { slope(wi, wo) } else { [f64::NAN; 2] };
        let slope = wi.iter().zip(&wo).map(slope).collect();
        let is_withheld = rows.iter().map(|&row| is_withheld(row)).collect();
        Self { rows, wi, wo, slope, is_withheld, tree: Arc::new(tree), stretch, slopes }
    }

    /// The same samples with their mirror images in the plane of incidence, in which all incoming directions lie.
    pub(super) fn mirrored(&self) -> Self {
        fn with<T: Copy>(own: &[T], image: impl Fn(T) -> T) -> Vec<T> {
            own.iter().copied().chain(own.iter().map(|&own| image(own))).collect()
        }
        let own = ..self.own();
        Self {
            rows: with(&self.rows[own], |row| row),
            wi: with(&self.wi[own], |wi| wi),
            wo: with(&self.wo[own], |[x, y, z]| [x, -y, z]),
            slope: with(&self.slope[own], |[x, y]| [x, -y]),
            is_withheld: with(&self.is_withheld[own], |is| is),
            tree: Arc::clone(&self.tree),
            ..*self
        }
    }

    /// How many samples there are without mirror images.
    pub(super) fn own(&self) -> usize {
        self.tree.len()
    }

    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Where a point lies in the tree.
    pub(super) fn place(&self, item: u32) -> [f64; 6] {
        match (item as usize).checked_sub(self.tree.len()) {
            None => self.tree.point(item),
            Some(item) => mirror(&self.tree.point(item as u32)),
        }
    }

    /// One of the coordinates of where points lie in the tree.
    pub(super) fn coordinates(&self, k: usize, items: &[u32], out: &mut Vec<f64>) {
        let (own, sign) = (self.tree.len() as u32, mirror(&[1.0; 6])[k]);
        let column = self.tree.column(k);
        let of = |&item: &u32| if item < own { column[item as usize] } else { sign * column[(item - own) as usize] };
        out.clear();
        out.extend(items.iter().map(of));
    }

    /// The `count` points nearest to `centre` that `wanted` takes, of equally near ones those of lower number; the farthest
    /// first, the others in no order.
    pub(super) fn nearest(
        &self,
        centre: &[f64; 6],
        count: usize,
        wanted: impl Fn(u32) -> bool,
        found: &mut Vec<Found>,
    ) {
        found.clear();
        for (centre, first) in self.sides(centre) {
            self.tree.nearest((&centre, first), count, |item| self.is_there(item) && wanted(item), found);
        }
    }

    /// All points within the root of `square` of `centre` that `wanted` takes.
    pub(super) fn within(&self, centre: &[f64; 6], square: f64, wanted: impl Fn(u32) -> bool, found: &mut Vec<Found>) {
        found.clear();
        for (centre, first) in self.sides(centre) {
            self.tree.within((&centre, first), square, |item| self.is_there(item) && wanted(item), found);
        }
    }

    /// The places in the tree that `centre` is near to samples at, and to their mirror images; the number that these begin
    /// with.
    fn sides(&self, centre: &[f64; 6]) -> impl Iterator<Item = ([f64; 6], u32)> + use<> {
        let own = self.tree.len();
        let images = (self.len() > own).then(|| (mirror(centre), own as u32));
        [Some((*centre, 0)), images].into_iter().flatten()
    }

    /// Whether a point is not its own mirror image.
    fn is_there(&self, item: u32) -> bool {
        (item as usize) < self.tree.len() || self.wo[item as usize][1] != 0.0
    }

    /// Where directions lie in the tree: chords are as long as those between outgoing directions, and for reflection as those
    /// between half vectors, which move half as far but where both directions graze. There lobes are narrow across.
    pub(super) fn key(&self, wi: Vector, wo: Vector) -> [f64; 6] {
        key((wi, wo), self.slopes, self.stretch)
    }
}

fn key((wi, wo): (Vector, Vector), slopes: bool, stretch: f64) -> [f64; 6] {
    if !slopes {
        let [a, b, c] = scale(wi, stretch);
        return [wo[0], wo[1], wo[2], a, b, c];
    }
    let h = scale(unit(add(add(wi, wo), [0.0, 0.0, 1e-9])), 2.0);
    if stretch > 0.0 {
        let [a, b, c] = scale(wi, stretch);
        return [h[0], h[1], h[2], a, b, c];
    }
    [wo[0], wo[1], wo[2], h[0], h[1], h[2]].map(|x| x * std::f64::consts::FRAC_1_SQRT_2)
}

/// Where the mirror image in the plane of incidence lies.
fn mirror(&[a, b, c, d, e, f]: &[f64; 6]) -> [f64; 6] {
    [a, -b, c, d, -e, f]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::projection::scattered::tree::nearness;

    #[test]
    fn mirror_images_are_found_as_if_they_had_been_measured() {
        let wi = Direction::from_degrees(40.0, 0.0).xyz();
        let at = |i: u32| (f64::from(i) * 0.37 % 89.0, f64::from(i) * 23.7 % 180.0 * f64::from(i % 7).min(1.0));
        let directions = |sides: &[f64]| -> Vec<(Vector, Vector)> {
            let of = |i| {
                let (theta, phi) = at(i);
                let [x, y, z] = Direction::from_degrees(theta, phi).xyz();
                sides.iter().map(move |side| (wi, [x, side * y, z]))
            };
            (0..400).flat_map(of).collect()
        };
        // In the plane of incidence both sides are one.
        let (half, both) = (directions(&[1.0]), directions(&[1.0, -1.0]));
        let apart = |row: &u32| row.is_multiple_of(2) || both[*row as usize].1[1] != 0.0;
        let mirrored = Cloud::new(0..400, &half, Quantity::Brdf, 0.0).mirrored();
        let whole = Cloud::new((0..800).filter(apart), &both, Quantity::Brdf, 0.0);
        let (mut found, mut expected) = (Vec::new(), Vec::new());
        let squares = |found: &mut Vec<Found>| -> Vec<f64> {
            found.sort_unstable_by_key(nearness);
            found.iter().map(|near| near.0).collect()
        };
        for (theta, phi) in [(0.0, 0.0), (30.0, 3.0), (60.0, -3.0), (80.0, 170.0), (40.0, -90.0)] {
            let key = mirrored.key(wi, Direction::from_degrees(theta, phi).xyz());
            mirrored.nearest(&key, 40, |_| true, &mut found);
            whole.nearest(&key, 40, |_| true, &mut expected);
            assert_eq!(squares(&mut found), squares(&mut expected));
            mirrored.within(&key, 0.1, |_| true, &mut found);
            whole.within(&key, 0.1, |_| true, &mut expected);
            assert_eq!(squares(&mut found), squares(&mut expected));
            for &(_, item) in &found {
                let wo = mirrored.wo[item as usize];
                assert_eq!(mirrored.place(item), mirrored.key(wi, wo));
                assert_eq!(mirrored.slope[item as usize], slope(wi, wo));
            }
        }
    }
}
