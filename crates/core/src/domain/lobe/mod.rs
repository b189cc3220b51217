//! Lobe of reflected light that is too narrow for cells: its function, importance sampling and integrals.

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

/// Ratio of the roughness α of a GGX surface to the half-width of its lobe in slopes of half vectors: (1 + tan²/α²)² is
/// 2 at tan = 0.6436 α.
const ROUGHNESS_OF_WIDTH: f64 = 1.553_773_974_030_037_3;

/// Direction about which a lobe is centred, relative to the incoming direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LobeCentre {
    /// Mirror direction; distances are angles from it.
    Mirror,
    /// Mirror direction; distances are slopes of the half vector, as for microfacet surfaces.
    HalfVector,
    /// Direction back to the source; distances are angles from it.
    Source,
}

/// All centres.
pub const CENTRES: [LobeCentre; 3] = [LobeCentre::Mirror, LobeCentre::HalfVector, LobeCentre::Source];

/// Lobe of a BRDF, in sr⁻¹ without the cosine:
///
/// f(wi, wo, λ) = colour(λ) · exp(p₀ + p₁·t + p₂·t²) · k(x) · G, with t = −ln cos θi clamped to the measured range.
///
/// x is the squared distance of wo from the centre in half-widths, along two axes of the surface if the widths differ.
/// k falls from 1 at x = 0 to 1/2 at x = 1; the tail parameter determines the rest: 2^(−x) for tail 0, the GGX
/// distribution for tail 1/2.
///
/// G is 1 except for half vectors, where it is m(cos θi) / (m(cos θo)·hz⁴) with m(c) = c + √(a² + (1 − a²)·c²) and a =
/// 1.5538 × the half-width, as for a microfacet surface (Walter et al. 2007, equations 20, 33, 34). It is 1 at the
/// mirror direction. The lobe is 0 if wi or wo is below the horizon.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lobe {
    /// Centre of the lobe.
    centre: LobeCentre,
    /// Coefficients p₀, p₁, p₂ of the logarithm of the peak.
    peak: [f64; 3],
    /// Smallest and largest t measured.
    range: [f64; 2],
    /// Half-widths at half the maximum: radians for a direction, slopes for half vectors.
    widths: [f64; 2],
    /// Angle from the surface's x to the axis of the first width, in radians.
    angle: f64,
    /// Tail parameter, 0 … 1/2.
    tail: f64,
    /// Colour factors, one per sample of a spectrum, with a mean of about 1.
    colours: Vec<f32>,
}

/// Parameters of a lobe, as defined by [`Lobe`].
#[derive(Clone, Debug, PartialEq)]
pub struct LobeParameters {
    /// Centre of the lobe.
    pub centre: LobeCentre,
    /// Coefficients p₀, p₁, p₂ of the logarithm of the peak.
    pub peak: [f64; 3],
    /// Smallest and largest −ln cos θi measured.
    pub range: [f64; 2],
    /// Half-widths at half the maximum: radians for a direction, slopes for half vectors.
    pub widths: [f64; 2],
    /// Angle from the surface's x to the axis of the first width, in radians.
    pub angle: f64,
    /// Tail parameter, from 0 (Gaussian) to 1/2 (GGX).
    pub tail: f64,
    /// Colour factors, one per sample of a spectrum.
    pub colours: Vec<f32>,
}

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

impl Lobe {
    /// Creates a lobe, with each parameter rounded as in files. Fails if a parameter is out of bounds.
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

    /// Returns the parameters of the lobe.
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

    /// Returns the colour factor of each sample of a spectrum.
    pub fn colours(&self) -> &[f32] {
        &self.colours
    }

    /// Returns the centre of the lobe.
    pub fn centre(&self) -> LobeCentre {
        self.centre
    }

    /// Returns true if the two widths differ, so that the lobe rotates with the surface.
    pub fn is_anisotropic(&self) -> bool {
        self.widths[0] != self.widths[1]
    }

    /// Returns the full widths at half maximum under normal incidence, in degrees of outgoing directions.
    pub fn full_widths(&self) -> [f64; 2] {
        self.widths.map(|width| match self.centre {
            LobeCentre::HalfVector => 4.0 * libm::atan(width).to_degrees(),
            LobeCentre::Mirror | LobeCentre::Source => 4.0 * libm::asin(0.5 * width).to_degrees(),
        })
    }

    /// Returns the lobe under `wi`; `None` if `wi` is not above the horizon.
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

    /// Returns the value at a pair of directions for a colour of 1, in sr⁻¹; 0 below the horizon.
    pub fn shape(&self, wi: Direction, wo: Direction) -> f64 {
        self.under(wi).map_or(0.0, |lobe| lobe.shape(wo))
    }

    /// Returns the heap memory in bytes, without the size of the type.
    pub fn memory(&self) -> usize {
        size_of_val(&*self.colours)
    }
}

impl LobeUnder {
    /// Returns the value at the centre, in sr⁻¹.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Returns the value at an outgoing direction for a colour of 1, in sr⁻¹; 0 below the horizon.
    #[inline]
    pub fn shape(&self, wo: Direction) -> f64 {
        self.shape_at(wo.xyz())
    }

    #[inline]
    fn shape_at(&self, wo: Vector) -> f64 {
        // Written so that NaN gives 0, too.
        if wo[2] >= 0.0 {
            let place = self.around.place(wo);
            let value = self.peak * self.profile.at(self.distance(place)) * self.factor(place, wo[2]);
            // With both directions at the horizon, the tail is 0 and the factor unbounded.
            if value.is_nan() { 0.0 } else { value.min(bounds::LARGEST_VALUE) }
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
