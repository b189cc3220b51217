//! A lobe under one incoming direction: its values, and what is drawn from it.

use super::around::Around;
use super::centre::LobeCentre;
use super::microfacets::{ROUGHNESS_OF_WIDTH, microfacets};
use super::parameters::{LARGEST_LOG, LARGEST_VALUE, LobeParameters};
use super::profile::Profile;
use crate::domain::direction::Direction;
use crate::domain::vector::{Vector, norm};
use std::f64::consts::TAU;

/// Reflection lobe for one incoming direction, with all values precomputed that do not depend on the outgoing
/// direction.
#[derive(Clone, Copy, Debug)]
pub struct LobeUnder {
    around: Around,
    profile: Profile,
    peak: f64,
    /// Matrix, as rows, that maps points of the plane to which directions are projected to distances from the centre of
    /// the lobe along its two axes, in half-widths.
    to_widths: [[f64; 2]; 2],
    widths: [f64; 2],
    /// Cosine and sine of the angle from the axes of the plane to which directions are projected to the axes of the
    /// reflection lobe.
    turn: [f64; 2],
    /// GGX roughness a in the microfacet factor of the lobe; `None` if the lobe has no such factor.
    roughness: Option<f64>,
    cos_i: f64,
}

/// Natural logarithm of 1.5, the factor by which f·cos θo of a lobe may grow beyond the last measured incidence.
const LARGEST_GROWTH: f64 = 0.405_465_108_108_164_4;

/// Returns the change of the logarithm of a microfacet lobe's peak beyond the measured incidences. `distance` is
/// counted in t = −ln cos θi from the end of the measured range.
///
/// The peak of such a lobe goes with 1/cos² θi, so that its albedo stays. Towards grazing incidence f·cos θo grows to
/// 1.5 times its last value at most.
#[inline]
fn beyond_range(distance: f64) -> f64 {
    if distance > 0.0 { (2.0 * distance).min(distance + LARGEST_GROWTH) } else { 2.0 * distance }
}

impl LobeUnder {
    /// Creates the lobe of `parameters` for the incoming direction `wi`; `None` if `wi` is not above the horizon.
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

    /// Returns the outgoing direction at the centre of this reflection lobe.
    pub(super) fn centre(&self) -> Vector {
        self.around.centre()
    }

    /// Returns the smallest half-width of the lobe in outgoing directions, in radians, and its ratio to the largest
    /// half-width.
    pub(super) fn least_width(&self) -> (f64, f64) {
        let [a, b] = self.widths;
        let (least, foreshortened) =
            if self.roughness.is_some() { (2.0 * a.min(b), self.cos_i) } else { (a.min(b), 1.0) };
        (least * foreshortened, a.min(b) / a.max(b) * foreshortened)
    }

    /// Returns the value of the lobe at an outgoing direction, for a colour factor of 1, in sr⁻¹; 0 below the horizon.
    #[inline]
    pub fn shape(&self, wo: Direction) -> f64 {
        self.shape_at(wo.xyz())
    }

    /// Returns the value of the lobe at an outgoing unit vector, like [`LobeUnder::shape`].
    #[inline]
    pub(super) fn shape_at(&self, wo: Vector) -> f64 {
        // Written so that what is no number is 0, too.
        if wo[2] >= 0.0 {
            let place = self.around.place(wo);
            let value = self.peak * self.profile.at(squared(self.half_widths(place))) * self.factor(place, wo[2]);
            // If both directions are at the horizon, the tail is 0 and the factor has no bound.
            if value.is_nan() { 0.0 } else { value.min(LARGEST_VALUE) }
        } else {
            0.0
        }
    }

    /// Converts a point of the plane to which directions are projected to distances from the centre of the lobe along
    /// its two axes, in half-widths.
    #[inline]
    fn half_widths(&self, place: [f64; 2]) -> [f64; 2] {
        self.to_widths.map(|[x, y]| x * place[0] + y * place[1])
    }

    /// Returns the microfacet factor G of the reflection lobe for both directions (masking and projection); 1 if the
    /// lobe has none.
    ///
    /// `place` is the slopes of the half vector, `cos_o` the cosine of the outgoing polar angle.
    #[inline]
    fn factor(&self, place: [f64; 2], cos_o: f64) -> f64 {
        self.roughness.map_or(1.0, |roughness| microfacets(roughness * roughness, [self.cos_i, cos_o], place))
    }

    /// Converts distances from the centre of the lobe along its two axes, in half-widths, to a point of the plane to
    /// which directions are projected.
    #[inline]
    fn spread(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let ([a, b], [cos, sin]) = ([a * self.widths[0], b * self.widths[1]], self.turn);
        [cos * a - sin * b, sin * a + cos * b]
    }

    /// Returns the fraction of a reflection lobe's radial profile, integrated over the projection plane, that lies
    /// nearer to its centre than the horizon does along one ray.
    ///
    /// `towards` is a unit vector along the ray, in coordinates along the lobe's axes with the half-widths as units.
    #[inline]
    fn inside(&self, towards: [f64; 2]) -> f64 {
        let [x, y] = self.spread(towards);
        let length = norm([x, y, 0.0]);
        let reach = self.around.horizon([x / length, y / length]) / length;
        self.profile.enclosed(reach * reach)
    }

    /// Samples an outgoing direction above the horizon from a point of the unit square. The first coordinate is the
    /// share of the lobe nearer to its centre, the second the fraction of a turn about the centre.
    pub fn draw(&self, [share, turn]: [f64; 2]) -> Direction {
        let (sin, cos) = libm::sincos(TAU * turn);
        let towards = [cos, sin];
        let inside = self.inside(towards);
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
            let at = self.half_widths(place);
            let inside = self.inside(towards(at));
            let area = self.profile.area() * self.widths[0] * self.widths[1] * self.around.solid_angle(place);
            let density = self.profile.at(squared(at)) / (area * inside);
            if density.is_finite() { density.max(0.0) } else { 0.0 }
        } else {
            0.0
        }
    }

    /// Returns the point of the unit square that [`LobeUnder::draw`] maps to the given outgoing direction.
    pub fn point_of(&self, wo: Direction) -> [f64; 2] {
        let place = self.around.place(wo.xyz());
        let at = self.half_widths(place);
        let turn = libm::atan2(at[1], at[0]) / TAU;
        let share = self.profile.enclosed(squared(at)) / self.inside(towards(at));
        [share.clamp(0.0, 1.0), if turn < 0.0 { turn + 1.0 } else { turn }]
    }
}

/// Largest share of a lobe's integral, counted outward from its centre, from which directions are drawn; the outermost
/// 1e-15 is left out. Raising it draws directions farther from the centre.
const LARGEST_SHARE: f64 = 1.0 - 1e-15;

/// Returns the squared length of a vector in the plane.
#[inline]
fn squared([a, b]: [f64; 2]) -> f64 {
    a * a + b * b
}

/// Returns the unit vector along a vector in the plane; any unit vector at the origin.
#[inline]
fn towards([a, b]: [f64; 2]) -> [f64; 2] {
    let length = norm([a, b, 0.0]);
    if length > 0.0 { [a / length, b / length] } else { [1.0, 0.0] }
}
