//! How a measurement is to be compressed.

use crate::compress::{Policy, Target};
use crate::domain::{WavelengthError, WavelengthGrid, named};
use crate::projection::{AxesRequest, DirectionDomain};
use serde::{Deserialize, Serialize};

/// Interpolation between the stated directions of a grid of angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Curve {
    /// Cubics of logarithms; for luminaires and phase functions with the least share of straight lines that keeps the flux within
    /// 0.3 % of the zonal flux of the samples.
    #[default]
    Cubic,
    /// Straight lines between the samples.
    Linear,
}
impl Curve {
    /// Returns true for cubics, which are taken where nothing is named.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

named!(Curve, "interpolation", { Cubic = "cubic", Linear = "linear" });

/// How to compress, in the command line's names; everything but `target` has a default.
///
/// ```
/// use wavelume_formats::pipeline::Request;
/// let request = Request { basis: "db4".to_owned(), ..Request::er_l2(0.01) };
/// assert_eq!(serde_json::to_value(&request)?["target"]["er_l2"], 0.01);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[allow(clippy::struct_excessive_bools, reason = "each is an option of its own")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The promise.
    pub target: Target,
    /// The policy.
    #[serde(default)]
    pub policy: Policy,
    /// The spectral basis, or `auto`.
    #[serde(default = "auto")]
    pub basis: String,
    /// Relative floor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<f64>,
    /// The largest relative error of the light of any direction and wavelength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo_error: Option<f64>,
    /// Grid of the file or triangles; a level asks for triangles, too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<DirectionDomain>,
    /// Replaces each value of a BRDF on its own grid with the mean of it and that of the exchanged pair of directions.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reciprocal: bool,
    /// Subdivision level of the incoming triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub incoming_level: Option<u8>,
    /// Subdivision level of the outgoing triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outgoing_level: Option<u8>,
    /// `START:STOP:STEP` in nm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<String>,
    /// Whether the file carries its provenance.
    #[serde(default = "yes")]
    pub metadata: bool,
    /// Whether one incoming direction is decoded without the others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub random_access: bool,
    /// The function between stated directions, of measurements on grids of angles.
    #[serde(default, skip_serializing_if = "Curve::is_default")]
    pub interpolation: Curve,
    /// Refuses a material that adds too much to the noise of scattered samples or has another light than they, instead of warning
    /// of it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub strict: bool,
}

fn auto() -> String {
    "auto".to_owned()
}

fn yes() -> bool {
    true
}

impl Request {
    /// A request for a relative error, er(L2), of at most `error`: 0.01 is 1 %.
    pub fn er_l2(error: f64) -> Self {
        Self::to(Target::ErL2(error))
    }

    /// A request with defaults for everything but the promise.
    pub fn to(target: Target) -> Self {
        Self {
            target,
            policy: Policy::Rd,
            basis: auto(),
            floor: None,
            albedo_error: None,
            domain: None,
            reciprocal: false,
            incoming_level: None,
            outgoing_level: None,
            wavelengths: None,
            metadata: true,
            random_access: false,
            interpolation: Curve::Cubic,
            strict: false,
        }
    }

    /// The axes that are asked for.
    pub(super) fn axes(&self) -> Result<AxesRequest, WavelengthError> {
        Ok(AxesRequest {
            domain: self.domain,
            incoming_level: self.incoming_level,
            outgoing_level: self.outgoing_level,
            wavelengths: self.wavelengths.as_deref().map(WavelengthGrid::parse_range).transpose()?,
            finer: 0,
            target: match self.target {
                Target::ErL1(error) | Target::ErL2(error) => Some(error),
                _ => None,
            },
        })
    }
}
