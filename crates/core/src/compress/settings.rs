//! Settings of a compression, and the checks that do not need the measurement.

use super::between::Between;
use super::policy::Policy;
use super::setting_error::{RdOption, SettingError};
use super::spectral_basis::SpectralBasis;
use super::target::Target;
use crate::domain::{Limits, Lobe, Measurement};
use std::ops::Bound::Excluded;

/// Settings of a compression: together with the measurement they determine every byte of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Target that the file must meet: an error, a size or a ratio.
    pub target: Target,
    /// Policy: how coefficients are chosen and coded.
    pub policy: Policy,
    /// Name of the spectral basis (`haar`, `db4`, `bior4.4`, any of
    /// [`LineBasis::all`](crate::transform::LineBasis::all)), or `auto`.
    pub basis: String,
    /// Floor as a fraction of the largest sample. Smaller samples are excluded from relative errors, and their absolute
    /// error stays below the floor.
    pub floor: Option<f64>,
    /// Upper bound on the relative error of the light (directional albedo, flux) of every incoming direction and
    /// wavelength. Only the rate–distortion policy (`rd`) supports it.
    pub albedo_error: Option<f64>,
    /// Text for the optional metadata chunk: a JSON object. Labels of index axes are added to it.
    pub metadata: Option<String>,
    /// True if [`decode_block`](super::decode_block) can decode the slice of one incoming direction without the rest.
    /// Needs policy `rd`, the data's own basis (`auto` then means `klt`), an axis before the outgoing directions, and
    /// no target that bounds every sample. The file then has no coarser levels.
    pub random_access: bool,
    /// Share of straight lines in the interpolation between measured directions, in 255ths: 0 for cubics of logarithms,
    /// 255 for straight lines alone. A nonzero share needs a grid of angles as the last directions.
    /// `evaluate::straight_lines_for_flux` finds the share that keeps the flux of a luminaire.
    pub straight_lines: u8,
    /// Interpolation between incoming directions; `evaluate::interpolation_between` finds the one that predicts the
    /// measured ones best.
    pub between: Between,
    /// Analytic lobe of a BRDF, already subtracted from the samples of the measurement; evaluation adds it back. Stated
    /// errors and coarser resolution levels are those of the samples without the lobe.
    pub lobe: Option<Lobe>,
}

impl Default for Settings {
    /// Returns the default settings of a compression: the default target and policy, an automatic choice of the basis,
    /// no further options.
    fn default() -> Self {
        Self {
            target: Target::default(),
            policy: Policy::default(),
            basis: AUTO_BASIS.to_owned(),
            floor: None,
            albedo_error: None,
            metadata: None,
            random_access: false,
            straight_lines: 0,
            between: Between::default(),
            lobe: None,
        }
    }
}

/// Limits of the option `floor`, the fraction of the largest sample below which relative errors do not count.
pub const FLOOR: Limits =
    Limits { low: Excluded(0.0), high: Excluded(1.0), remark: ", a fraction of the largest sample (0.01 is 1 %)" };
/// Limits of the option `albedo_error`, the bound on the relative error of the light (directional albedo, flux).
pub const ALBEDO_ERROR: Limits = Limits::up_to(1.0, " (0.01 is 1 %)");
/// Name that leaves the choice of the spectral basis to the program; the default.
pub const AUTO_BASIS: &str = "auto";

/// Checks the name of a spectral basis, which may be `auto`. The error lists the names.
pub fn check_basis(name: &str) -> Result<(), SettingError> {
    if name == AUTO_BASIS || SpectralBasis::named(name).is_some() {
        return Ok(());
    }
    Err(SettingError::UnknownBasis { found: name.to_owned() })
}

/// Rejects settings of a compression that are out of range or contradict each other.
pub(super) fn check(settings: &Settings) -> Result<(), SettingError> {
    settings.target.check()?;
    if settings.policy == Policy::Lossless && settings.target != Target::Lossless {
        return Err(SettingError::LosslessTarget);
    }
    if let Some(floor) = settings.floor
        && !FLOOR.allow(floor)
    {
        return Err(SettingError::Range { option: "floor", found: floor, limits: FLOOR });
    }
    check_basis(&settings.basis)?;
    if SpectralBasis::named(&settings.basis) == Some(SpectralBasis::Klt) && settings.policy != Policy::Rd {
        return Err(SettingError::NeedsRd { option: RdOption::Klt, policy: settings.policy });
    }
    if let Some(metadata) = &settings.metadata
        && !matches!(serde_json::from_str(metadata), Ok(serde_json::Value::Object(_)))
    {
        return Err(SettingError::MetadataObject);
    }
    Ok(())
}

/// Converts the floor of the relative errors (samples below it do not count in them) from a fraction of the largest
/// sample to the unit of a sample. The result is rounded to f32 as the file stores it; 0 without a floor.
pub fn absolute_floor(measurement: &Measurement, floor: Option<f64>) -> f32 {
    let maximum = || measurement.tensor.range().map_or(0.0, |(_, high)| f64::from(high.max(0.0)));
    floor.map_or(0.0, |floor| (floor * maximum()) as f32)
}
