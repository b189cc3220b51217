//! A lobe: its function, and how it is described.

use super::centre::LobeCentre;
use super::parameters::{LobeError, LobeParameters, check, short_colour};
use super::under::LobeUnder;
use crate::domain::direction::Direction;
use serde::{Deserialize, Serialize};

/// Analytic reflection lobe of a BRDF, in sr⁻¹ without the cosine: a product of colour, peak, radial profile and
/// microfacet factor.
///
/// f(wi, wo, λ) = colour(λ) · exp(p₀ + p₁·t + p₂·t²) · k(x) · G, with t = −ln cos θi clamped to the measured range.
///
/// Beyond that range the peak of a lobe in half vectors goes with 1/cos² θi, as on a microfacet surface, while f·cos θo
/// grows to 1.5 times its last value at most.
///
/// x is the squared distance of wo from the centre in half-widths, along two axes of the surface if the widths differ.
/// k falls from 1 at x = 0 to 1/2 at x = 1; the tail parameter determines the rest: 2^(−x) for tail 0, the GGX
/// distribution for tail 1/2.
///
/// G is 1 except for half vectors, where it is m(cos θi) / (m(cos θo)·hz⁴) with m(c) = c + √(a² + (1 − a²)·c²) and a =
/// 1.5538 × the half-width, as for a microfacet surface (Walter et al. 2007, equations 20, 33, 34). It is 1 at the
/// mirror direction. The lobe is 0 if wi or wo is below the horizon.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "LobeParameters", try_from = "LobeParameters")]
pub struct Lobe(LobeParameters);

impl Lobe {
    /// Creates a reflection lobe, with each parameter rounded as in files. Fails if a parameter is out of bounds.
    pub fn new(parameters: LobeParameters) -> Result<Self, LobeError> {
        check(&parameters)?;
        let LobeParameters { centre, peak, range, widths, angle, tail, colours } = parameters;
        let short = |x: f64| f64::from(x as f32);
        Ok(Self(LobeParameters {
            centre,
            peak: peak.map(short),
            range: range.map(short),
            widths: widths.map(short),
            angle: if widths[0] == widths[1] { 0.0 } else { short(angle) },
            tail: short(tail),
            colours: colours.into_iter().map(short_colour).collect(),
        }))
    }

    /// Returns the parameters of the reflection lobe.
    pub fn parameters(&self) -> LobeParameters {
        self.0.clone()
    }

    /// Returns the factors by which the lobe is multiplied at each sample of a spectrum.
    pub fn colours(&self) -> &[f32] {
        &self.0.colours
    }

    /// Returns the direction about which the reflection lobe is centred.
    pub fn centre(&self) -> LobeCentre {
        self.0.centre
    }

    /// Returns true if the lobe has different widths along its two axes, so that it rotates with the surface.
    pub fn is_anisotropic(&self) -> bool {
        self.0.widths[0] != self.0.widths[1]
    }

    /// Returns the two full widths at half maximum of the lobe under normal incidence, in degrees of outgoing
    /// directions.
    pub fn full_widths(&self) -> [f64; 2] {
        self.0.widths.map(|width| match self.0.centre {
            LobeCentre::HalfVector => 4.0 * libm::atan(width).to_degrees(),
            LobeCentre::Mirror | LobeCentre::Source => 4.0 * libm::asin(0.5 * width).to_degrees(),
        })
    }

    /// Returns the reflection lobe for the incoming direction `wi`; `None` if `wi` is not above the horizon.
    #[inline]
    pub fn under(&self, wi: Direction) -> Option<LobeUnder> {
        LobeUnder::new(&self.0, wi.xyz())
    }

    /// Returns the value of the lobe at a pair of directions, for a colour factor of 1, in sr⁻¹; 0 below the horizon.
    pub fn shape(&self, wi: Direction, wo: Direction) -> f64 {
        self.under(wi).map_or(0.0, |lobe| lobe.shape(wo))
    }

    /// Returns the heap memory of the lobe in bytes, without the size of the type itself.
    pub fn memory(&self) -> usize {
        size_of_val(&*self.0.colours)
    }
}

impl From<Lobe> for LobeParameters {
    fn from(lobe: Lobe) -> Self {
        lobe.0
    }
}

impl TryFrom<LobeParameters> for Lobe {
    type Error = LobeError;

    fn try_from(parameters: LobeParameters) -> Result<Self, LobeError> {
        Self::new(parameters)
    }
}

#[cfg(feature = "schema")]
impl utoipa::PartialSchema for Lobe {
    fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
        LobeParameters::schema()
    }
}

#[cfg(feature = "schema")]
impl utoipa::ToSchema for Lobe {
    fn name() -> std::borrow::Cow<'static, str> {
        "Lobe".into()
    }

    fn schemas(schemas: &mut Vec<(String, utoipa::openapi::RefOr<utoipa::openapi::schema::Schema>)>) {
        LobeParameters::schemas(schemas);
    }
}

impl std::fmt::Display for Lobe {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let about = match self.0.centre {
            LobeCentre::Mirror => "the mirror direction",
            LobeCentre::HalfVector => "the mirror direction, in half vectors",
            LobeCentre::Source => "the direction back to the source",
        };
        let [first, second] = self.full_widths();
        let widths =
            if self.is_anisotropic() { format!("{first:.2}° × {second:.2}°") } else { format!("{first:.2}°") };
        let tail = match self.0.tail {
            tail if tail < 0.05 => "a Gaussian",
            tail if tail > 0.45 => "with the tail of GGX",
            _ => "with a tail between a Gaussian and GGX",
        };
        write!(f, "{widths} wide at half its maximum, about {about}, {tail}")
    }
}
