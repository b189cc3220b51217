//! A lobe under one incoming direction: its values, and what is drawn from it.

use super::around::Around;
use super::centre::LobeCentre;
use super::parameters::{LARGEST_LOG, LARGEST_VALUE, LobeParameters};
use super::profile::Profile;
use crate::domain::direction::Direction;
use crate::domain::vector::{Vector, dot};
use std::f64::consts::TAU;

/// Ratio of the roughness α of a GGX surface to the half-width of its lobe in slopes of half vectors: (1 + tan²/α²)² is
/// 2 at tan = 0.6436 α.
const ROUGHNESS_OF_WIDTH: f64 = 1.553_773_974_030_037_3;

/// Lobe under one incoming direction, with all values precomputed that do not depend on the outgoing one.
#[derive(Clone, Copy, Debug)]
pub struct LobeUnder {
    around: Around,
    profile: Profile,
    peak: f64,
    /// Rows of the matrix that maps plane coordinates to half-widths along both axes.
    to_widths: [[f64; 2]; 2],
    widths: [f64; 2],
    /// Cosine and sine of the angle of the axes.
    turn: [f64; 2],
    /// Roughness a in G; `None` if G is 1.
    roughness: Option<f64>,
    cos_i: f64,
}

/// Logarithm of the factor by which f·cos θo may grow beyond the last measured incidence: 1.5.
const LARGEST_GROWTH: f64 = 0.405_465_108_108_164_4;

/// Returns the change of the logarithm of the peak of a microfacet lobe at a distance in t from the measured range.
///
/// The peak of such a lobe goes with 1/cos² θi, so that its albedo stays. Towards grazing incidence f·cos θo grows to
/// 1.5 times its last value at most.
#[inline]
fn beyond_range(distance: f64) -> f64 {
    if distance > 0.0 { (2.0 * distance).min(distance + LARGEST_GROWTH) } else { 2.0 * distance }
}

impl LobeUnder {
    /// The lobe of `parameters` under `wi`; `None` where light does not come from above.
    #[inline]
    pub(super) fn new(parameters: &LobeParameters, wi: Vector) -> Option<Self> {
        let LobeParameters { centre, peak: [p0, p1, p2], range, widths, angle, tail, .. } = *parameters;
        let cos_i = wi[2];
        if cos_i.is_nan() || cos_i <= 0.0 {
            return None;
        }
        let asked = -libm::log(cos_i);
        let t = asked.max(range[0]).min(range[1]);
        let beyond = if centre == LobeCentre::HalfVector { beyond_range(asked - t) } else { 0.0 };
        let (sin, cos) = if angle == 0.0 { (0.0, 1.0) } else { libm::sincos(angle) };
        let [w0, w1] = widths;
        let roughness = (centre == LobeCentre::HalfVector).then(|| ROUGHNESS_OF_WIDTH * (w0 * w1).sqrt());
        Some(Self {
            around: Around::new(centre, wi),
            profile: Profile::new(tail),
            peak: libm::exp((p0 + t * (p1 + t * p2) + beyond).min(LARGEST_LOG)),
            to_widths: [[cos / w0, sin / w0], [-sin / w1, cos / w1]],
            widths,
            turn: [cos, sin],
            roughness,
            cos_i,
        })
    }

    /// The direction of the centre.
    pub(super) fn centre(&self) -> Vector {
        self.around.centre()
    }

    /// The least half-width in outgoing directions, in radians, and its part of the largest one.
    pub(super) fn least_width(&self) -> (f64, f64) {
        let [a, b] = self.widths;
        let (least, foreshortened) =
            if self.roughness.is_some() { (2.0 * a.min(b), self.cos_i) } else { (a.min(b), 1.0) };
        (least * foreshortened, a.min(b) / a.max(b) * foreshortened)
    }

    /// Returns the value at the centre, in sr⁻¹.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Returns the value at an outgoing direction for a colour of 1, in sr⁻¹; 0 below the horizon.
    #[inline]
    pub fn shape(&self, wo: Direction) -> f64 {
        self.shape_at(wo.xyz())
    }

    /// As [`LobeUnder::shape`].
    #[inline]
    pub(super) fn shape_at(&self, wo: Vector) -> f64 {
        // Written so that what is no number is 0, too.
        if wo[2] >= 0.0 {
            let place = self.around.place(wo);
            let value = self.peak * self.profile.at(self.distance(place)) * self.factor(place, wo[2]);
            // Where both directions are at the horizon, the tail is 0 and the factor has no bound.
            if value.is_nan() { 0.0 } else { value.min(LARGEST_VALUE) }
        } else {
            0.0
        }
    }

    /// Returns the squared distance from the centre, in half-widths, at plane coordinates.
    #[inline]
    fn distance(&self, place: [f64; 2]) -> f64 {
        let [a, b] = self.to_widths.map(|[x, y]| x * place[0] + y * place[1]);
        a * a + b * b
    }

    /// Returns the factor G of the lobe.
    #[inline]
    fn factor(&self, [x, y]: [f64; 2], cos_o: f64) -> f64 {
        let Some(a) = self.roughness else { return 1.0 };
        let m = |c: f64| c + (a * a + (1.0 - a * a) * c * c).max(0.0).sqrt();
        let squared = 1.0 + x * x + y * y;
        m(self.cos_i) / m(cos_o) * squared * squared
    }

    /// Converts half-widths along both axes to plane coordinates.
    #[inline]
    fn spread(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let ([a, b], [cos, sin]) = ([a * self.widths[0], b * self.widths[1]], self.turn);
        [cos * a - sin * b, sin * a + cos * b]
    }

    /// Returns the squared distance to the horizon, in half-widths, in the direction given by cosine and sine.
    #[inline]
    fn reach(&self, towards: [f64; 2]) -> f64 {
        let [x, y] = self.spread(towards);
        let length = dot([x, y, 0.0], [x, y, 0.0]).sqrt();
        let reach = self.around.horizon([x / length, y / length]) / length;
        reach * reach
    }

    /// Samples a direction above the horizon from a point of the unit square. The first coordinate is the share of the
    /// lobe nearer to its centre, the second the fraction of a turn about it.
    pub fn draw(&self, [share, turn]: [f64; 2]) -> Direction {
        let (sin, cos) = libm::sincos(TAU * turn);
        let towards = [cos, sin];
        let inside = self.profile.enclosed(self.reach(towards));
        let distance = self.profile.enclosing((share * inside).min(LARGEST_SHARE)).sqrt();
        let [x, y, z] = self.around.direction(self.spread(towards.map(|x| x * distance)));
        Direction::new(x, y, z.max(0.0)).unwrap_or_else(|| Direction::from_unit(self.around.centre()))
    }

    /// Returns the probability density, in sr⁻¹, with which [`LobeUnder::draw`] samples a direction; 0 below the
    /// horizon. It integrates to 1 above the horizon.
    pub fn density(&self, wo: Direction) -> f64 {
        let wo = wo.xyz();
        if wo[2] >= 0.0 {
            let place = self.around.place(wo);
            let [a, b] = self.to_widths.map(|[x, y]| x * place[0] + y * place[1]);
            let distance = a * a + b * b;
            let inside = self.profile.enclosed(self.reach(towards(a, b)));
            let area = self.profile.area() * self.widths[0] * self.widths[1] * self.around.solid_angle(place);
            let density = self.profile.at(distance) / (area * inside);
            if density.is_finite() { density.max(0.0) } else { 0.0 }
        } else {
            0.0
        }
    }

    /// Returns the point of the unit square that [`LobeUnder::draw`] maps to a direction.
    pub fn point_of(&self, wo: Direction) -> [f64; 2] {
        let place = self.around.place(wo.xyz());
        let [a, b] = self.to_widths.map(|[x, y]| x * place[0] + y * place[1]);
        let inside = self.profile.enclosed(self.reach(towards(a, b)));
        let turn = libm::atan2(b, a) / TAU;
        let share = self.profile.enclosed(a * a + b * b) / inside;
        [share.clamp(0.0, 1.0), if turn < 0.0 { turn + 1.0 } else { turn }]
    }
}

/// Largest share of a lobe used for sampling; a Gaussian has only 1e-15 beyond it.
const LARGEST_SHARE: f64 = 1.0 - 1e-15;

/// Returns the unit vector in direction (a, b) of the plane; an arbitrary one for the origin.
#[inline]
fn towards(a: f64, b: f64) -> [f64; 2] {
    let length = (a * a + b * b).sqrt();
    if length > 0.0 { [a / length, b / length] } else { [1.0, 0.0] }
}
