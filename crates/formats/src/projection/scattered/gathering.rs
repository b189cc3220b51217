//! Input of a local fit: rows, light and certainty of the samples, and their coordinates.

use super::around::Around;
use super::cloud::{Cloud, slope};
use super::rows::Rows;
use super::system::{Columns, TERMS};
use super::tree::Found;
use crate::domain::vector::{Vector, dot, sub};
use crate::numeric::wide;

/// Squared radii within which samples take part in two competing fits, as fractions of the squared distance to the
/// farthest sample.
pub(super) const REACHES: [f64; 2] = [0.33, 1.0];
/// Upper bound on the weight of a sample by its stated uncertainty, relative to the median weight.
const MOST_CERTAIN: f64 = 1e6;

/// Local coordinates of the samples of a fit: half-vector slopes, or coordinates of their outgoing directions in a
/// tangent plane of the unit sphere.
#[derive(Clone, Copy, Default)]
pub(super) struct Frame {
    /// Incoming direction about which samples are fitted, and the half-vector slope (hx/hz, hy/hz) that is the origin
    /// of their coordinates. `None` if the coordinates are not slopes, but lie in the plane tangent to the unit sphere
    /// at the outgoing direction about which samples are fitted.
    pub(super) slopes: Option<(Vector, [f64; 2])>,
    /// Two perpendicular unit vectors tangent to the unit sphere at the outgoing direction about which samples are
    /// fitted. They are the coordinate axes of the samples if these are not given by half-vector slopes.
    pub(super) axes: [Vector; 2],
    /// Unit of length of the local coordinates: the distance of the farthest sample from their origin, which becomes 1.
    pub(super) length: f64,
}

impl Frame {
    pub(super) fn at(&self, wo: Vector, joint: bool) -> [f64; TERMS] {
        let [x, y] = match self.slopes {
            Some((wi, centre)) => {
                let [x, y] = slope(wi, wo);
                [x - centre[0], y - centre[1]]
            }
            None => self.axes.map(|axis| dot(axis, wo)),
        };
        terms([x / self.length, y / self.length], [0.0; 2], joint)
    }
}

/// Samples around the place of a local fit, as columns of its linear system.
#[derive(Default)]
pub(super) struct Gathered {
    /// Indices of all samples to which the local polynomial is fitted: first those near enough for a second, narrower
    /// fit, then the others.
    pub(super) rows: Vec<u32>,
    /// True if logarithms are fitted, because all gathered values are positive.
    pub(super) logarithms: bool,
    pub(super) counts: [usize; REACHES.len()],
    pub(super) joint: bool,
    pub(super) columns: Columns,
    /// True if no sample of the local fit has lost weight as an outlier.
    pub(super) plain: bool,
    pub(super) sorted: Vec<f64>,
    order: Vec<Found>,
    pub(super) most_certain: f64,
    pub(super) nearest_incoming: f64,
}

impl Gathered {
    /// Orders the samples of a local fit so that those near enough for the narrower of two competing fits come first.
    pub(super) fn order(&mut self, found: &[Found], reach: f64) {
        let inverse = 1.0 / reach;
        self.order.resize(found.len(), (0.0, 0));
        // Near samples fill the front, the others the back.
        let (mut front, mut back) = (0, found.len());
        for &(square, item) in found {
            let square = square * inverse;
            let near = square <= REACHES[0];
            back -= usize::from(!near);
            self.order[if near { front } else { back }] = (square, item);
            front += usize::from(near);
        }
        self.counts = [front, found.len()];
    }

    /// Looks up, for each sample of a local fit, its index in the table of measured values, its mean over bands, and
    /// the inverse of its stated variance.
    pub(super) fn gather(&mut self, cloud: &Cloud, rows: &Rows<'_>, wi: Vector) {
        self.columns.resize(self.order.len());
        self.plain = true;
        self.rows.clear();
        self.rows.extend(self.order.iter().map(|&(_, item)| cloud.rows[item as usize]));
        self.logarithms = true;
        for (((light, square), &row), ordered) in
            self.columns.light.iter_mut().zip(&mut self.columns.squares).zip(&self.rows).zip(&self.order)
        {
            *square = ordered.0;
            *light = rows.light[row as usize][0];
            self.logarithms &= !light.is_nan();
        }
        let scale = usize::from(!self.logarithms);
        if !self.logarithms {
            for (light, &row) in self.columns.light.iter_mut().zip(&self.rows) {
                *light = rows.light[row as usize][scale];
            }
        }
        let base = self.columns.light[0];
        self.columns.light[..self.order.len()].iter_mut().for_each(|light| *light -= base);
        self.nearest_incoming = 0.0;
        if self.joint {
            self.nearest_incoming = f64::INFINITY;
            for (i, &(_, item)) in self.order.iter().enumerate() {
                let incoming = sub(cloud.wi[item as usize], wi);
                (self.columns.basis[3][i], self.columns.basis[4][i]) = (incoming[0], incoming[1]);
                self.nearest_incoming = self.nearest_incoming.min(dot(incoming, incoming));
            }
            self.nearest_incoming = self.nearest_incoming.sqrt();
        }
        self.most_certain = 1.0;
        let certainty = &mut self.columns.certainty[..self.rows.len()];
        if rows.certainty.is_empty() {
            certainty.fill(1.0);
        } else {
            for (certainty, &row) in certainty.iter_mut().zip(&self.rows) {
                *certainty = rows.certainty[row as usize][usize::from(self.logarithms)];
            }
            self.count_certainty();
        }
    }

    /// Sets the coordinates of the samples to half-vector slopes relative to `centre`. Returns false if the half vector
    /// of some sample has no slope.
    pub(super) fn slopes(&mut self, cloud: &Cloud, centre: [f64; 2]) -> bool {
        let [_, us, vs, ..] = &mut self.columns.basis;
        let mut steep = false;
        for ((u, v), &(_, item)) in us.iter_mut().zip(vs).zip(&self.order) {
            let slope = cloud.slope[item as usize];
            steep |= slope[0].is_nan();
            (*u, *v) = (slope[0] - centre[0], slope[1] - centre[1]);
        }
        !steep
    }

    /// Sets the coordinates of the samples to their projections on the tangents `axes`.
    pub(super) fn tangents(&mut self, cloud: &Cloud, axes: &[Vector; 2]) {
        let [_, us, vs, ..] = &mut self.columns.basis;
        for ((u, v), &(_, item)) in us.iter_mut().zip(vs).zip(&self.order) {
            let wo = cloud.wo[item as usize];
            (*u, *v) = (dot(axes[0], wo), dot(axes[1], wo));
        }
    }

    /// Divides the inverse variances of the samples by their median; samples without a stated uncertainty get the
    /// weight 1.
    fn count_certainty(&mut self) {
        let certainty = &mut self.columns.certainty[..self.rows.len()];
        self.sorted.clear();
        self.sorted.extend(certainty.iter().copied().filter(|&certainty| certainty > 0.0));
        let middle = self.sorted.len() / 2;
        let median =
            if self.sorted.is_empty() { 1.0 } else { *self.sorted.select_nth_unstable_by(middle, f64::total_cmp).1 };
        for certainty in certainty {
            *certainty = if *certainty > 0.0 { (*certainty / median).clamp(1e-9, MOST_CERTAIN) } else { 1.0 };
            self.most_certain = self.most_certain.max(*certainty);
        }
    }

    /// Divides the coordinates (u, v) of the samples, relative to the centre of a local fit, by the distance of the
    /// farthest sample from it. Then computes the terms u², uv and v² of a quadratic at each sample. Returns the
    /// distance.
    pub(super) fn scale(&mut self) -> f64 {
        let joint = self.joint;
        let [_, u, v, c, d, e, f, g] = &mut self.columns.basis;
        let n = u.len();
        let [u, v, c, d, e, f, g] = [u, v, c, d, e, f, g].map(|column| &mut column[..n]);
        wide(
            #[inline(always)]
            || {
                let largest = largest(u, v);
                let length = 1.0 / largest.sqrt();
                u.iter_mut().zip(v.iter_mut()).for_each(|(u, v)| (*u, *v) = (*u * length, *v * length));
                if joint {
                    let stretch = 1.0 / self::largest(c, d).sqrt();
                    c.iter_mut().zip(d.iter_mut()).for_each(|(a, b)| (*a, *b) = (*a * stretch, *b * stretch));
                }
                let [uu, uv, vv] = if joint { [e, f, g] } else { [c, d, e] };
                for i in 0..n {
                    (uu[i], uv[i], vv[i]) = (u[i] * u[i], u[i] * v[i], v[i] * v[i]);
                }
                largest.sqrt()
            },
        )
    }

    /// Returns true if the samples of a local fit surround its centre: every half plane contains a sample.
    pub(super) fn surrounded(&self, cloud: &Cloud, axes: &[Vector; 2]) -> bool {
        let mut around = Around::default();
        self.order.iter().any(|&(_, item)| {
            let wo = cloud.wo[item as usize];
            around.add(axes.map(|axis| dot(axis, wo)))
        })
    }
}

/// Returns the values of the polynomial basis functions of a local fit, at an offset (u, v) of the outgoing direction
/// and (a, b) of the incoming direction from the centre of the fit.
#[inline]
fn terms([u, v]: [f64; 2], [a, b]: [f64; 2], joint: bool) -> [f64; TERMS] {
    if joint { [1.0, u, v, a, b, u * u, u * v, v * v] } else { [1.0, u, v, u * u, u * v, v * v, 0.0, 0.0] }
}

/// Returns the largest squared length of the two-dimensional vectors (x, y); never 0.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
fn largest(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * x + y * y).fold(1e-300, |most, square| if square > most { square } else { most })
}
