//! Scattered directions as points: grouping by incoming direction, and coordinates for nearest-neighbour search.

use super::tree::{Found, Tree};
use crate::domain::vector::{Vector, add, cross, norm, scale, sub, unit};
use crate::domain::{Direction, Quantity};
use crate::formats::Scattered;
use std::sync::Arc;

/// Largest difference in degrees at which incoming polar angles, or incoming directions, count as equal: the
/// repeatability of instruments. Raising it groups more samples.
const SAME: f64 = 0.05;
/// Least mean number of samples per incoming direction at which each incoming direction is fitted separately. With
/// fewer samples, neighbouring incoming directions are fitted together.
const ALONE: usize = 24;
/// Number of consecutive samples of which one is withheld from fits for validation.
const TENTH: u32 = 10;
/// Height (z of `wi + wo`) below which the half vector is so close to the surface that its slope is undefined.
const STEEP: f64 = 1e-3;

/// Samples that are fitted together, in the order of a k-d tree, with one column for each property. Mirror images in
/// the plane of incidence follow, if they are used.
#[derive(Clone, Debug)]
pub(super) struct Cloud {
    /// Index of each sample of the group in the table of measured values of the file.
    pub(super) rows: Vec<u32>,
    pub(super) wi: Vec<Vector>,
    pub(super) wo: Vec<Vector>,
    /// Slopes hx/hz and hy/hz of the half vector of each sample; NaN if the half vector is too close to the surface.
    pub(super) slope: Vec<[f64; 2]>,
    pub(super) is_withheld: Vec<bool>,
    tree: Arc<Tree<6>>,
    /// Factor by which distances between incoming directions count relative to those between outgoing ones. It is 0 if
    /// all samples have one incoming direction.
    pub(super) stretch: f64,
    /// True if local fits use half-vector slopes as coordinates.
    pub(super) slopes: bool,
}

/// Grouping of scattered samples by incoming direction.
#[derive(Clone, Debug)]
pub(super) enum Incoming {
    /// The samples have no incoming directions.
    None,
    /// Incoming polar angles of isotropic data in degrees, each with the indices of its samples.
    Elevations(Vec<f64>, Vec<Vec<u32>>),
    /// Incoming polar angles of isotropic data in degrees. Too few samples share an angle, so the local fits for each
    /// angle use the samples of all angles.
    AllElevations(Vec<f64>),
    /// Number of distinct incoming directions of anisotropic data.
    Directions(usize),
}

/// Returns the slope (x/z, y/z) of the half vector of a pair of directions; NaN if the half vector lies near the
/// surface.
pub(super) fn slope(wi: Vector, wo: Vector) -> [f64; 2] {
    let h = add(wi, wo);
    if h[2] < STEEP { [f64::NAN; 2] } else { [h[0] / h[2], h[1] / h[2]] }
}

/// Returns true if a sample is withheld from fits for validation: one of every ten consecutive samples, at irregular
/// distances.
pub(super) fn is_withheld(row: u32) -> bool {
    let mixed = (row / TENTH).wrapping_mul(0x9e37_79b9);
    (mixed ^ (mixed >> 15)) % TENTH == row % TENTH
}

/// Returns two unit vectors that span the plane perpendicular to `d`; the first lies in the plane of `d` and the z
/// axis.
pub(super) fn tangents(d: Vector) -> [Vector; 2] {
    let along = sub([0.0, 0.0, 1.0], scale(d, d[2]));
    let first = if norm(along) > 1e-6 { unit(along) } else { unit(sub([1.0, 0.0, 0.0], scale(d, d[0]))) };
    [first, cross(d, first)]
}

/// Returns the incoming and the outgoing direction of every sample. Incoming directions of isotropic data are rotated
/// to azimuth 0.
pub(in crate::projection) fn directions(scattered: &Scattered, isotropic: bool) -> Vec<(Vector, Vector)> {
    let up = [0.0, 0.0, 1.0];
    let of = |[theta, phi]: [f64; 2], turned: f64| Direction::from_degrees(theta, phi - turned).xyz();
    let (mut incoming, mut wi) = (None, up);
    (0..scattered.directions())
        .map(|i| {
            let angles = scattered.incoming.get(i).copied();
            let turned = angles.filter(|_| isotropic).map_or(0.0, |angles| angles[1]);
            // Reuses the previous incoming direction: many samples share it.
            if angles != incoming {
                (incoming, wi) = (angles, angles.map_or(up, |angles| of(angles, turned)));
            }
            (wi, scattered.outgoing.get(i).map_or(up, |&angles| of(angles, turned)))
        })
        .collect()
}

/// Returns true if all incoming directions of a scan have one azimuth, so that nothing is known of other azimuths.
pub(super) fn one_azimuth(scattered: &Scattered) -> bool {
    let mut azimuths = scattered.incoming.iter().filter(|wi| wi[0] > SAME).map(|wi| wi[1].rem_euclid(360.0));
    let Some(first) = azimuths.next() else { return !scattered.incoming.is_empty() };
    azimuths.all(|phi| {
        let off = (phi - first).abs();
        off.min(360.0 - off) <= SAME
    })
}

/// Groups scattered samples by incoming direction. `live` are the indices of the samples that have a value in any band.
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
        // Nominal angles of instruments have few digits.
        let rounded = (mean * 100.0).round() / 100.0;
        if (mean - rounded).abs() < 1e-3 { rounded } else { mean }.clamp(0.0, 90.0)
    };
    let elevations = groups.iter().map(mean).collect();
    for group in &mut groups {
        group.sort_unstable();
    }
    Incoming::Elevations(elevations, groups)
}

/// Returns evenly spaced incoming polar angles from the smallest to the largest measured one, in degrees. Their number
/// grows with the cube root of the number of samples, which are spread over three angles: one incoming, two outgoing.
fn even_elevations(scattered: &Scattered, live: &[u32]) -> Vec<f64> {
    let theta = live.iter().map(|&row| scattered.incoming[row as usize][0]);
    let (low, high) = theta.fold((90.0_f64, 0.0_f64), |(l, h), t| (l.min(t), h.max(t)));
    let count = libm::cbrt(live.len() as f64 / 16.0).round().clamp(2.0, 46.0) as usize;
    (0..count).map(|i| low + (high - low) * i as f64 / (count - 1) as f64).collect()
}

impl Cloud {
    /// Builds a k-d tree of measured samples, in which the samples nearest to a pair of directions are sought. `rows`
    /// are the indices of these samples, `directions` the incoming and outgoing directions of all samples of the file.
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

    /// Returns the samples together with their mirror images in the plane of incidence, which must contain all incoming
    /// directions.
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

    /// Returns the number of samples of the group, not counting mirror images.
    pub(super) fn own(&self) -> usize {
        self.tree.len()
    }

    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns the point that stands for a sample, or for the mirror image of one, in the six-dimensional space in
    /// which nearest neighbours are sought.
    pub(super) fn place(&self, item: u32) -> [f64; 6] {
        match (item as usize).checked_sub(self.tree.len()) {
            None => self.tree.point(item),
            Some(item) => mirror(&self.tree.point(item as u32)),
        }
    }

    /// Writes one coordinate of the samples `items` into `out`: number `k`, 0 to 5, in the space in which nearest
    /// neighbours are sought.
    pub(super) fn coordinates(&self, k: usize, items: &[u32], out: &mut Vec<f64>) {
        let (own, sign) = (self.tree.len() as u32, mirror(&[1.0; 6])[k]);
        let column = self.tree.column(k);
        let of = |&item: &u32| if item < own { column[item as usize] } else { sign * column[(item - own) as usize] };
        out.clear();
        out.extend(items.iter().map(of));
    }

    /// Finds the `count` samples nearest to `centre` that `wanted` accepts; the lower index wins ties. The farthest
    /// sample comes first in `found`, the others are unordered.
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

    /// Finds all samples that `wanted` accepts within distance √`square` of `centre`.
    pub(super) fn within(&self, centre: &[f64; 6], square: f64, wanted: impl Fn(u32) -> bool, found: &mut Vec<Found>) {
        found.clear();
        for (centre, first) in self.sides(centre) {
            self.tree.within((&centre, first), square, |item| self.is_there(item) && wanted(item), found);
        }
    }

    /// Yields the points about which the k-d tree is searched: `centre` and, if mirror images are used, its mirror
    /// image. Each comes with the number that the first sample of the tree gets in the results: 0 or, for the mirror
    /// image, the number of samples.
    fn sides(&self, centre: &[f64; 6]) -> impl Iterator<Item = ([f64; 6], u32)> + use<> {
        let own = self.tree.len();
        let images = (self.len() > own).then(|| (mirror(centre), own as u32));
        [Some((*centre, 0)), images].into_iter().flatten()
    }

    /// Returns false if `item` is a mirror image that coincides with its sample, which would count twice; otherwise
    /// true.
    fn is_there(&self, item: u32) -> bool {
        (item as usize) < self.tree.len() || self.wo[item as usize][1] != 0.0
    }

    /// Returns the point that stands for a pair of directions in the six-dimensional space in which nearest neighbours
    /// are sought. Distances there are chords between outgoing directions.
    ///
    /// For reflection, doubled half vectors contribute or replace the outgoing directions. They move as far as outgoing
    /// directions, except where both directions are grazing: lobes are narrow across there.
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

/// Mirrors a sample in the plane of incidence: returns the point that stands for the image in the six-dimensional space
/// in which nearest neighbours are sought.
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
        // In the plane of incidence a sample is its own mirror image.
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
