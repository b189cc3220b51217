//! Compression requests.

use crate::compress::{Policy, Target};
use crate::domain::{WavelengthError, WavelengthGrid, named};
use crate::projection::{AxesRequest, DirectionDomain};
use serde::{Deserialize, Serialize};

/// Interpolation between the stated directions of a grid of angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Curve {
    /// Cubic interpolation of logarithms. For luminaires and phase functions it is mixed with the least share of
    /// linear interpolation that keeps the flux within 0.3 % of the zonal flux of the samples.
    #[default]
    Cubic,
    /// Linear interpolation between the samples.
    Linear,
}
impl Curve {
    /// Returns true for cubic interpolation, the default.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

named!(Curve, "interpolation", { Cubic = "cubic", Linear = "linear" });

/// Compression request, with the names of the command line. Every field except `target` has a default.
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
    /// Promised error bound, size or ratio.
    pub target: Target,
    /// Compression policy.
    #[serde(default)]
    pub policy: Policy,
    /// Spectral basis, or `auto`.
    #[serde(default = "auto")]
    pub basis: String,
    /// Floor as a fraction of the largest sample. Smaller samples are excluded from relative errors, and their absolute
    /// error stays below the floor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<f64>,
    /// Upper bound on the relative error of the light (directional albedo, flux) of any direction and wavelength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo_error: Option<f64>,
    /// Domain of directions: the grid of the file, or triangles. A level also selects triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<DirectionDomain>,
    /// Makes a BRDF on its own grid reciprocal: replaces each value by its mean with that of the exchanged pair of
    /// directions.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reciprocal: bool,
    /// Subdivision level of the incoming triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub incoming_level: Option<u8>,
    /// Subdivision level of the outgoing triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outgoing_level: Option<u8>,
    /// Wavelengths to resample to, as `START:STOP:STEP` in nm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<String>,
    /// Stores the provenance in the file.
    #[serde(default = "yes")]
    pub metadata: bool,
    /// Lays out the file so that one incoming direction can be decoded without the others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub random_access: bool,
    /// Interpolation between stated directions, for measurements on grids of angles.
    #[serde(default, skip_serializing_if = "Curve::is_default")]
    pub interpolation: Curve,
    /// Refuses a material that adds too much error to the noise of scattered samples, or differs from them in total
    /// light, instead of adding a warning.
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
    /// Creates a request for a relative error, er(L2), of at most `error`: 0.01 is 1 %.
    pub fn er_l2(error: f64) -> Self {
        Self::to(Target::ErL2(error))
    }

    /// Creates a request for `target` with defaults for all other fields.
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

    /// Returns the requested axes.
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
