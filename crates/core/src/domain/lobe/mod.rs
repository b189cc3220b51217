//! A lobe of reflected light that is narrower than cells can hold: its function, what is drawn from it, and its integrals.

mod around;
mod bounds;
mod integrals;
mod profile;
#[cfg(test)]
mod tests;

pub use bounds::LobeError;

use super::direction::Direction;
use super::vector::{Vector, dot};
use around::Around;
use profile::Profile;
use serde::Serialize;
use std::f64::consts::TAU;

/// Roughness of a GGX surface over the half-width of its lobe in slopes of half vectors: (1 + tan²/α²)² is 2 at
/// tan = 0.6436 α.
const ROUGHNESS_OF_WIDTH: f64 = 1.553_773_974_030_037_3;

/// The direction that a lobe stays with, as the incoming direction moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LobeCentre {
    /// The mirror direction; distances are angles from it.
    Mirror,
    /// The mirror direction; distances are slopes of the half vector, as on surfaces of microfacets.
    HalfVector,
    /// The direction back to the source; distances are angles from it.
    Source,
}

/// All centres.
pub const CENTRES: [LobeCentre; 3] = [LobeCentre::Mirror, LobeCentre::HalfVector, LobeCentre::Source];

/// A lobe of a BRDF, in sr⁻¹ without the cosine:
///
/// f(wi, wo, λ) = colour(λ) · exp(p₀ + p₁·t + p₂·t²) · k(x) · G, with t = −ln cos θi held within the measured range.
///
/// x is the squared distance of wo from the centre in half-widths, along two axes of the surface where they differ, and k
/// falls from 1 to 1/2 at x = 1 and further as its tail says: 2^(−x) with tail 0, as the distribution of GGX with tail 1/2.
/// G is 1 but in half vectors, where it is m(cos θi) / (m(cos θo)·hz⁴) with m(c) = c + √(a² + (1 − a²)·c²) and
/// a = 1.5538 × the half-width, as on a surface of microfacets (Walter et al. 2007, equations 20, 33, 34): 1 at the mirror
/// direction. Below the horizon, on either side, the lobe is 0.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lobe {
    /// What it stays with.
    centre: LobeCentre,
    /// p₀, p₁, p₂.
    peak: [f64; 3],
    /// The least and the largest t that were measured.
    range: [f64; 2],
    /// Half-widths at half the maximum: radians for a direction, slopes for half vectors.
    widths: [f64; 2],
    /// Angle from the surface's x to the axis of the first width, in radians.
    angle: f64,
    /// 0 … 1/2.
    tail: f64,
    /// One factor for each sample of a spectrum, their mean about 1.
    colours: Vec<f32>,
}

/// Numbers that a lobe is made of, as [`Lobe`] names them.
#[derive(Clone, Debug, PartialEq)]
pub struct LobeParameters {
    /// What it stays with.
    pub centre: LobeCentre,
    /// p₀, p₁, p₂ of the logarithm of the peak.
    pub peak: [f64; 3],
    /// The least and the largest −ln cos θi that were measured.
    pub range: [f64; 2],
    /// Half-widths at half the maximum: radians for a direction, slopes for half vectors.
    pub widths: [f64; 2],
    /// Angle from the surface's x to the axis of the first width, in radians.
    pub angle: f64,
    /// 0 for a Gaussian … 1/2 for GGX.
    pub tail: f64,
    /// One factor for each sample of a spectrum.
    pub colours: Vec<f32>,
}

/// A lobe under one incoming direction: what does not depend on the outgoing one.
#[derive(Clone, Copy, Debug)]
pub struct LobeUnder {
    around: Around,
    profile: Profile,
    peak: f64,
    /// Rows of the matrix that takes a place to half-widths along both axes.
    to_widths: [[f64; 2]; 2],
    widths: [f64; 2],
    /// Cosine and sine of the angle of the axes.
    turn: [f64; 2],
    /// a of the masking; `None` where G is 1.
    roughness: Option<f64>,
    cos_i: f64,
}

impl Lobe {
    /// The lobe of these numbers, each rounded as a file holds it; refused where one is out of its bounds.
    pub fn new(parameters: LobeParameters) -> Result<Self, LobeError> {
        bounds::check(&parameters)?;
        let LobeParameters { centre, peak, range, widths, angle, tail, colours } = parameters;
        let short = |x: f64| f64::from(x as f32);
        Ok(Self {
            centre,
            peak: peak.map(short),
            range: range.map(short),
            widths: widths.map(short),
            angle: if widths[0] == widths[1] { 0.0 } else { short(angle) },
            tail: short(tail),
            colours: colours.into_iter().map(bounds::short_colour).collect(),
        })
    }

    /// The numbers that it is made of.
    pub fn parameters(&self) -> LobeParameters {
        LobeParameters {
            centre: self.centre,
            peak: self.peak,
            range: self.range,
            widths: self.widths,
            angle: self.angle,
            tail: self.tail,
            colours: self.colours.clone(),
        }
    }

    /// The factor of each sample of a spectrum.
    pub fn colours(&self) -> &[f32] {
        &self.colours
    }

    /// What the lobe stays with.
    pub fn centre(&self) -> LobeCentre {
        self.centre
    }

    /// Returns true for a lobe that turns with the surface, as its two widths differ.
    pub fn is_anisotropic(&self) -> bool {
        self.widths[0] != self.widths[1]
    }

    /// Full widths at half the maximum under normal incidence, in degrees of outgoing directions.
    pub fn full_widths(&self) -> [f64; 2] {
        self.widths.map(|width| match self.centre {
            LobeCentre::HalfVector => 4.0 * libm::atan(width).to_degrees(),
            LobeCentre::Mirror | LobeCentre::Source => 4.0 * libm::asin(0.5 * width).to_degrees(),
        })
    }

    /// The lobe under `wi`; `None` where light does not come from above.
    #[inline]
    pub fn under(&self, wi: Direction) -> Option<LobeUnder> {
        let wi = wi.xyz();
        let cos_i = wi[2];
        if cos_i.is_nan() || cos_i <= 0.0 {
            return None;
        }
        let t = (-libm::log(cos_i)).max(self.range[0]).min(self.range[1]);
        let [p0, p1, p2] = self.peak;
        let (sin, cos) = if self.angle == 0.0 { (0.0, 1.0) } else { libm::sincos(self.angle) };
        let [w0, w1] = self.widths;
        let roughness = (self.centre == LobeCentre::HalfVector).then(|| ROUGHNESS_OF_WIDTH * (w0 * w1).sqrt());
        Some(LobeUnder {
            around: Around::new(self.centre, wi),
            profile: Profile::new(self.tail),
            peak: libm::exp((p0 + t * (p1 + t * p2)).min(bounds::LARGEST_LOG)),
            to_widths: [[cos / w0, sin / w0], [-sin / w1, cos / w1]],
            widths: self.widths,
            turn: [cos, sin],
            roughness,
            cos_i,
        })
    }

    /// The value at a pair of directions for a colour of 1, in sr⁻¹; 0 below the horizon.
    pub fn shape(&self, wi: Direction, wo: Direction) -> f64 {
        self.under(wi).map_or(0.0, |lobe| lobe.shape(wo))
    }

    /// Memory in bytes, without the size of the type.
    pub fn memory(&self) -> usize {
        size_of_val(&*self.colours)
    }
}

impl LobeUnder {
    /// The value at the centre.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// The value at an outgoing direction for a colour of 1, in sr⁻¹; 0 below the horizon.
    #[inline]
    pub fn shape(&self, wo: Direction) -> f64 {
        self.shape_at(wo.xyz())
    }

    #[inline]
    fn shape_at(&self, wo: Vector) -> f64 {
        // Written so that what is no number is 0, too.
        if wo[2] >= 0.0 {
            let place = self.around.place(wo);
            let value = self.peak * self.profile.at(self.distance(place)) * self.factor(place, wo[2]);
            // Where both directions are at the horizon, the tail is 0 and the factor has no bound.
            if value.is_nan() { 0.0 } else { value.min(bounds::LARGEST_VALUE) }
        } else {
            0.0
        }
    }

    /// The squared distance of a place from the centre, in half-widths.
    #[inline]
    fn distance(&self, place: [f64; 2]) -> f64 {
        let [a, b] = self.to_widths.map(|[x, y]| x * place[0] + y * place[1]);
        a * a + b * b
    }

    /// G.
    #[inline]
    fn factor(&self, [x, y]: [f64; 2], cos_o: f64) -> f64 {
        let Some(a) = self.roughness else { return 1.0 };
        let m = |c: f64| c + (a * a + (1.0 - a * a) * c * c).max(0.0).sqrt();
        let squared = 1.0 + x * x + y * y;
        m(self.cos_i) / m(cos_o) * squared * squared
    }

    /// The place at half-widths times (cos, sin) of an angle.
    #[inline]
    fn spread(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let ([a, b], [cos, sin]) = ([a * self.widths[0], b * self.widths[1]], self.turn);
        [cos * a - sin * b, sin * a + cos * b]
    }

    /// Distance to the horizon in half-widths, squared, towards an angle's cosine and sine.
    #[inline]
    fn reach(&self, towards: [f64; 2]) -> f64 {
        let [x, y] = self.spread(towards);
        let length = dot([x, y, 0.0], [x, y, 0.0]).sqrt();
        let reach = self.around.horizon([x / length, y / length]) / length;
        reach * reach
    }

    /// Draws a direction above the horizon from a point of the unit square: the first coordinate is the share of the lobe that lies
    /// nearer to its centre, the second the part of a turn about it.
    pub fn draw(&self, [share, turn]: [f64; 2]) -> Direction {
        let (sin, cos) = libm::sincos(TAU * turn);
        let towards = [cos, sin];
        let inside = self.profile.enclosed(self.reach(towards));
        let distance = self.profile.enclosing((share * inside).min(LARGEST_SHARE)).sqrt();
        let [x, y, z] = self.around.direction(self.spread(towards.map(|x| x * distance)));
        Direction::new(x, y, z.max(0.0)).unwrap_or_else(|| Direction::from_unit(self.around.centre()))
    }

    /// The density in sr⁻¹ with which [`LobeUnder::draw`] draws a direction; 0 below the horizon. Over all above it the
    /// integral is 1.
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

    /// The point of the unit square that [`LobeUnder::draw`] takes to a direction.
    pub fn point_of(&self, wo: Direction) -> [f64; 2] {
        let place = self.around.place(wo.xyz());
        let [a, b] = self.to_widths.map(|[x, y]| x * place[0] + y * place[1]);
        let inside = self.profile.enclosed(self.reach(towards(a, b)));
        let turn = libm::atan2(b, a) / TAU;
        let share = self.profile.enclosed(a * a + b * b) / inside;
        [share.clamp(0.0, 1.0), if turn < 0.0 { turn + 1.0 } else { turn }]
    }
}

/// The largest share of a lobe that is drawn from: beyond, a Gaussian has its last 1e-15.
const LARGEST_SHARE: f64 = 1.0 - 1e-15;

/// A unit vector of the plane; any at the origin.
#[inline]
fn towards(a: f64, b: f64) -> [f64; 2] {
    let length = (a * a + b * b).sqrt();
    if length > 0.0 { [a / length, b / length] } else { [1.0, 0.0] }
}

impl std::fmt::Display for Lobe {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let about = match self.centre {
            LobeCentre::Mirror => "the mirror direction",
            LobeCentre::HalfVector => "the mirror direction, in half vectors",
            LobeCentre::Source => "the direction back to the source",
        };
        let [first, second] = self.full_widths();
        let widths =
            if self.is_anisotropic() { format!("{first:.2}° × {second:.2}°") } else { format!("{first:.2}°") };
        let tail = match self.tail {
            tail if tail < 0.05 => "a Gaussian",
            tail if tail > 0.45 => "with the tail of GGX",
            _ => "with a tail between a Gaussian and GGX",
        };
        write!(f, "{widths} wide at half its maximum, about {about}, {tail}")
    }
}
