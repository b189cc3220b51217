//! Samples around a block of triangles, from which every place within selects its own.

use super::cloud::Cloud;
use super::tree::{Found, distance, nearness};
use crate::domain::Vertices;
use crate::domain::vector::Vector;
use crate::numeric::wide;

/// Upper bound on the attempts to find a radius about the point of a local fit that contains the wanted number of
/// samples.
const TRIES: usize = 4;
/// Factor by which the search for samples around a block of triangles is widened once, if it found too few for a local
/// fit, as at the edge of the measured directions. Raising it collects more samples.
const WIDER: f64 = 1.6;

/// Scratch space of one task that searches samples around a block of triangles.
#[derive(Default)]
pub(super) struct Nearby {
    found: Vec<Found>,
    items: Vec<u32>,
    /// Coordinates of the collected samples in the six-dimensional space in which nearest neighbours are sought, one
    /// column for each coordinate.
    keys: [Vec<f64>; 6],
    /// Squared distances of the collected samples from the point of a local fit, in the six-dimensional space in which
    /// nearest neighbours are sought.
    squares: Vec<f64>,
    centre: [f64; 6],
    /// Distance from the centre of a block of neighbouring triangles of outgoing directions to the farthest of their
    /// corners, in the six-dimensional space in which nearest neighbours are sought.
    size: f64,
    /// Radius about the centre of a block of neighbouring triangles within which all samples are collected, in the
    /// six-dimensional space in which nearest neighbours are sought.
    complete: f64,
    /// Squared radius, about the centre of a block of neighbouring triangles, that contains as many samples as a local
    /// fit needs. It is measured in the six-dimensional space in which nearest neighbours are sought.
    reach: f64,
    is_wide: bool,
}

impl Nearby {
    /// Collects the samples around some neighbouring triangles of outgoing directions, under the incoming direction
    /// `wi`. The local fit at each place in these triangles later selects its samples from them. `vertices` are the
    /// corners of the triangles; `wanted` returns true for samples that may be used.
    pub(super) fn gather(
        &mut self,
        (cloud, neighbours): (&Cloud, usize),
        wi: Vector,
        vertices: &[Vertices],
        wanted: impl Fn(u32) -> bool,
    ) {
        self.centre = middle(cloud, wi, vertices);
        let corners = vertices.iter().flatten();
        self.size = corners.map(|&corner| distance(&cloud.key(wi, corner), &self.centre)).fold(0.0, f64::max).sqrt();
        cloud.nearest(&self.centre, neighbours, &wanted, &mut self.found);
        self.reach = self.found.first().map_or(0.0, |farthest| farthest.0);
        self.is_wide = false;
        self.collect(cloud, self.reach.sqrt(), wanted);
    }

    /// Collects all samples within distance `reach` of any point of a block of neighbouring triangles, in the
    /// six-dimensional space in which nearest neighbours are sought.
    fn collect(&mut self, cloud: &Cloud, reach: f64, wanted: impl Fn(u32) -> bool) {
        self.complete = reach + self.size + 1e-9;
        cloud.within(&self.centre, self.complete * self.complete, wanted, &mut self.found);
        self.items.clear();
        self.items.extend(self.found.iter().map(|found| found.1));
        for (k, column) in self.keys.iter_mut().enumerate() {
            cloud.coordinates(k, &self.items, column);
        }
        self.squares.resize(self.items.len(), 0.0);
    }

    /// Selects into `found` the samples for a local fit at `key`, a point of the six-dimensional space in which nearest
    /// neighbours are sought. Takes all within a radius that contains about `neighbours` samples, otherwise the nearest
    /// ones.
    pub(super) fn select(
        &mut self,
        (cloud, neighbours): (&Cloud, usize),
        key: &[f64; 6],
        wanted: impl Fn(u32) -> bool,
        found: &mut Vec<Found>,
    ) {
        let dimensions = if cloud.slopes || cloud.stretch > 0.0 { 6 } else { 3 };
        self.measure(key, dimensions);
        let mut complete = self.complete_around(key);
        let mut square = self.reach.min(complete);
        for _ in 0..TRIES {
            let count = self.squares.iter().filter(|&&apart| apart <= square).count();
            if 4 * count > 5 * neighbours {
                square *= neighbours as f64 / count as f64;
            } else if 4 * count >= 3 * neighbours {
                self.take(square, count, found);
                return;
            } else if square < complete {
                square = (square * neighbours as f64 / count.max(1) as f64).min(complete);
            } else if self.is_wide || cloud.len() <= self.items.len() {
                break;
            } else {
                self.is_wide = true;
                self.collect(cloud, WIDER * self.reach.sqrt(), &wanted);
                self.measure(key, dimensions);
                complete = self.complete_around(key);
                square = (square * neighbours as f64 / count.max(1) as f64).min(complete);
            }
        }
        let count = self.squares.iter().filter(|&&apart| apart <= complete).count();
        if count >= neighbours {
            self.take(complete, count, found);
            found.select_nth_unstable_by_key(neighbours - 1, nearness);
            found.truncate(neighbours);
        } else {
            cloud.nearest(key, neighbours, wanted, found);
        }
    }

    /// Returns the square of the radius within which all samples have been collected about `key`, the point of a local
    /// fit in the six-dimensional space in which nearest neighbours are sought.
    fn complete_around(&self, key: &[f64; 6]) -> f64 {
        (self.complete - distance(key, &self.centre).sqrt()).max(0.0).powi(2)
    }

    /// Computes the squared distance of each collected sample from `key`, a point of the six-dimensional space in which
    /// nearest neighbours are sought. Uses the first `dimensions` coordinates, 3 or 6; with 3, the others are equal for
    /// all points.
    fn measure(&mut self, key: &[f64; 6], dimensions: usize) {
        let n = self.items.len();
        let squares = &mut self.squares[..n];
        let [a, b, c, d, e, f] = self.keys.each_ref().map(|column| &column[..n]);
        let square = |a: f64, b: f64| (a - b) * (a - b);
        wide(
            #[inline(always)]
            || {
                for i in 0..n {
                    squares[i] = square(key[0], a[i]) + square(key[1], b[i]) + square(key[2], c[i]);
                }
                if dimensions > 3 {
                    for i in 0..n {
                        squares[i] += square(key[3], d[i]) + square(key[4], e[i]) + square(key[5], f[i]);
                    }
                }
            },
        );
    }

    /// Takes all collected samples whose squared distance from the point of a local fit is at most `square`; there are
    /// `count` of them.
    fn take(&self, square: f64, count: usize, found: &mut Vec<Found>) {
        // One extra place is overwritten by samples that are not taken.
        found.resize(count + 1, (0.0, 0));
        let mut n = 0;
        for (&apart, &item) in self.squares.iter().zip(&self.items) {
            found[n] = (apart, item);
            n += usize::from(apart <= square);
        }
        found.truncate(count);
    }
}

/// Returns the centre of a block of outgoing triangles under the incoming direction `wi`: the mean of the points that
/// stand for their corners in the six-dimensional space in which nearest neighbours are sought.
fn middle(cloud: &Cloud, wi: Vector, vertices: &[Vertices]) -> [f64; 6] {
    let (mut sum, mut count) = ([0.0; 6], 0.0);
    for &corner in vertices.iter().flatten() {
        sum.iter_mut().zip(cloud.key(wi, corner)).for_each(|(sum, x)| *sum += x);
        count += 1.0;
    }
    sum.map(|sum| sum / count)
}
