//! What a fit is made of: the rows, light and certainty of samples, and their coordinates as terms.

use super::around::Around;
use super::cloud::{Cloud, slope};
use super::rows::Rows;
use super::system::{Columns, TERMS};
use super::tree::Found;
use crate::domain::vector::{Vector, dot, sub};
use crate::numeric::wide;

/// Parts of the square of the reach within which fits compete.
pub(super) const REACHES: [f64; 2] = [0.33, 1.0];
/// A sample counts at most so many times as much as the middle one.
const MOST_CERTAIN: f64 = 1e6;

/// The coordinates of a fit.
#[derive(Clone, Copy, Default)]
pub(super) struct Frame {
    /// Of the incoming direction and of the place, where the coordinates are slopes.
    pub(super) slopes: Option<(Vector, [f64; 2])>,
    /// Else along these.
    pub(super) axes: [Vector; 2],
    /// What coordinates are divided by.
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

/// Samples around a place, as columns of the system that is solved.
#[derive(Default)]
pub(super) struct Gathered {
    /// All rows gathered: within the first of [`REACHES`], then the rest.
    pub(super) rows: Vec<u32>,
    /// Whether logarithms are fitted: all values gathered are positive.
    pub(super) logarithms: bool,
    pub(super) counts: [usize; REACHES.len()],
    pub(super) joint: bool,
    pub(super) columns: Columns,
    /// Whether no sample has lost weight by lying off.
    pub(super) plain: bool,
    pub(super) sorted: Vec<f64>,
    order: Vec<Found>,
    pub(super) most_certain: f64,
    pub(super) nearest_incoming: f64,
}

impl Gathered {
    /// Puts what lies within the first of [`REACHES`] first.
    pub(super) fn order(&mut self, found: &[Found], reach: f64) {
        let inverse = 1.0 / reach;
        self.order.resize(found.len(), (0.0, 0));
        // The near ones from the front, the others from the back.
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

    /// Looks up rows, light and certainty.
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

    /// Takes slopes less that of the place as coordinates, if all have one.
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

    /// Takes tangents as coordinates.
    pub(super) fn tangents(&mut self, cloud: &Cloud, axes: &[Vector; 2]) {
        let [_, us, vs, ..] = &mut self.columns.basis;
        for ((u, v), &(_, item)) in us.iter_mut().zip(vs).zip(&self.order) {
            let wo = cloud.wo[item as usize];
            (*u, *v) = (dot(axes[0], wo), dot(axes[1], wo));
        }
    }

    /// Certainties in parts of their median; rows without any count as the median.
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

    /// Turns coordinates into the basis; the length that they are divided by.
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

    /// Whether every half plane has a sample.
    pub(super) fn surrounded(&self, cloud: &Cloud, axes: &[Vector; 2]) -> bool {
        let mut around = Around::default();
        self.order.iter().any(|&(_, item)| {
            let wo = cloud.wo[item as usize];
            around.add(axes.map(|axis| dot(axis, wo)))
        })
    }
}

/// The basis at an offset of the outgoing (u, v) and the incoming direction (a, b).
#[inline]
fn terms([u, v]: [f64; 2], [a, b]: [f64; 2], joint: bool) -> [f64; TERMS] {
    if joint { [1.0, u, v, a, b, u * u, u * v, v * v] } else { [1.0, u, v, u * u, u * v, v * v, 0.0, 0.0] }
}

/// The largest square of the length of a vector; not 0.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
fn largest(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * x + y * y).fold(1e-300, |most, square| if square > most { square } else { most })
}
