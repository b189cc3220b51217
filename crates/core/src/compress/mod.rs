//! Measurements → compressed materials to a promised error, measured on the decoded bytes.
//!
//! * `rd`: sign and logarithm of every sample, orthonormal Haar on triangles and a wavelet along wavelength, one uniform
//!   step for all normalised coefficients, adaptive range coding; optionally a second layer that bounds every sample.
//! * `conventional`, `generic`, `adaptive`: the paper's policies (\[CPB06\] section 4.2): linear domain, bio-Haar, thresholds on L2-normalised
//!   coefficients, the kept ones exact.
//! * `lossless`: every bit of every sample.

mod decode;
mod effort;
mod exponential;
mod file;
mod fill;
mod header;
mod kept;
mod light;
mod logarithm;
mod lossless;
mod noise;
mod promise;
mod ranking;
mod rd;
mod refusal;
mod rows;
mod scales;
mod search;
pub mod selection;
mod target;
mod thresholded;
mod values;

pub use crate::codec::CodecError as DecodeError;
pub use decode::{
    Decoded, DecodedBlock, LevelInfo, decode, decode_block, decode_level, inspect, levels, payload_digest,
};
pub use effort::Effort;
pub(crate) use kept::Kept;
pub use light::LightReport;
pub use noise::{Noise, estimate as estimate_noise};
pub use target::{DeltaE, Target};

pub use promise::shortfall;

use crate::codec::MAGIC;
use crate::domain::colour::ColourReport;
use crate::domain::{Axis, Cancelled, ErrorReport, Measurement, Progress, Quantity, Sampling, Unit};
use crate::transform::{AxisTransform, LineBasis, SphereBasis};
use effort::Tally;
use serde::Serialize;

/// How coefficients are chosen and coded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Policy {
    /// Rate–distortion: log domain, one uniform step.
    #[default]
    Rd,
    /// The paper's: one threshold on normalised coefficients, kept ones exact.
    Conventional,
    /// Every bit; the only policy of [`Target::Lossless`].
    Lossless,
    /// The paper's: one threshold a space, whole functions dropped.
    Generic,
    /// The paper's: the same with ε√d inside a function of range d.
    Adaptive,
}
crate::domain::named!(Policy, "policy", { Rd = "rd", Conventional = "conventional", Lossless = "lossless", Generic = "generic", Adaptive = "adaptive" });

/// Everything that decides the bytes, beside the measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The promise.
    pub target: Target,
    /// The policy.
    pub policy: Policy,
    /// Name of the spectral basis (`haar`, `db4`, `bior4.4`, any of [`LineBasis::all`]), or `auto`.
    pub basis: String,
    /// Samples below `floor ×` the maximum leave the relative errors and are kept within that absolutely.
    pub floor: Option<f64>,
    /// The largest relative error of the light of any block and wavelength (directional albedo, flux), policy `rd`.
    pub albedo_error: Option<f64>,
    /// Text for the optional metadata chunk: a JSON object. Labels of index axes are added to it.
    pub metadata: Option<String>,
    /// Whether [`decode_block`] decodes the slice of one incoming direction without the rest. Policy `rd` on the data's own
    /// basis (`auto` is `klt` then), something before the outgoing triangles, no target that bounds every sample; the
    /// file has no coarser levels.
    pub random_access: bool,
}

impl Default for Settings {
    /// er(L2) 1 %, policy `rd`, any basis, nothing else asked for.
    fn default() -> Self {
        Self {
            target: Target::ErL2(0.01),
            policy: Policy::Rd,
            basis: "auto".to_owned(),
            floor: None,
            albedo_error: None,
            metadata: None,
            random_access: false,
        }
    }
}

/// A compressed material.
#[derive(Clone, Debug)]
pub struct Compressed {
    /// The file.
    pub bytes: Vec<u8>,
    /// What was achieved; its errors are those of the decoded bytes, in full precision.
    pub summary: Summary,
    /// How much of the light the decoded bytes keep, where there are triangles.
    pub light: Option<LightReport>,
    /// The colours of the decoded bytes, where they were promised.
    pub colour: Option<ColourReport>,
    /// The bases that competed, best first; one where the basis was named.
    pub ranking: Vec<Ranked>,
    /// The noise of the measurement, where it can be told; it decides nothing.
    pub noise: Option<Noise>,
    /// The trials that the search took.
    pub effort: Effort,
}

/// One basis that competed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ranked {
    /// Its name.
    pub basis: String,
    /// The size of its file, or of its coefficients where only those were compared.
    pub bytes: u64,
    /// The error of its file, where it was decoded.
    pub er_l2: Option<f64>,
}

/// What is known of a material from its header.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// The quantity.
    pub quantity: Quantity,
    /// The unit of a sample.
    pub unit: Unit,
    /// What a sample on a triangle axis stands for.
    pub sampling: Sampling,
    /// The axes.
    pub axes: Vec<Axis>,
    /// The policy.
    pub policy: Policy,
    /// The spectral basis; `none` where there is no wavelength axis.
    pub basis: String,
    /// Coefficients that are not zero; `None` for lossless.
    pub kept_coefficients: Option<u64>,
    /// Absolute floor, 0 if none was declared.
    pub floor: f64,
    /// The errors of the decoded file against its input tensor (each rounded up by at most 0.007 % when read from a file).
    pub errors: ErrorReport,
    /// The metadata chunk's text, if there is one.
    pub metadata: Option<String>,
}

/// Why a measurement was not compressed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompressError {
    /// A setting out of its range, or an unknown basis.
    #[error("{0}")]
    Setting(String),
    /// No file meets the target.
    #[error("{0}")]
    Unreachable(String),
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Whether `bytes` start as a material does.
pub fn is_material(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// Compresses `measurement` to the promise of `settings`.
pub fn compress(
    measurement: &Measurement,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Compressed, CompressError> {
    check(settings)?;
    promise::check(measurement, settings)?;
    if settings.random_access {
        promise::check_random_access(measurement, settings)?;
    }
    let text = file::metadata_with_labels(measurement.tensor.axes(), settings.metadata.as_deref());
    if let Some(text) = text.filter(|text| text.len() > decode::MAX_METADATA) {
        let found = text.len();
        return Err(CompressError::Setting(format!(
            "metadata has {found} bytes, expected at most 16 MiB; leave it out (--no-metadata, \"metadata\": false)"
        )));
    }
    let settings = &Settings { target: stateable(settings.target)?, ..settings.clone() };
    let policy = if settings.target == Target::Lossless { Policy::Lossless } else { settings.policy };
    let floor = absolute_floor(measurement, settings);
    let tally = Tally::default();
    let bases = match policy {
        Policy::Lossless => Vec::new(),
        _ if settings.random_access => vec![SpectralBasis::Klt],
        _ => ranking::candidates(measurement, settings, (progress, &tally))?,
    };
    let mut compressed = match policy {
        Policy::Rd => rd::compress(measurement, settings, &bases, floor, (progress, &tally))?,
        Policy::Conventional | Policy::Generic | Policy::Adaptive => {
            thresholded::compress(measurement, settings, &bases, floor, (progress, &tally))?
        }
        Policy::Lossless => lossless::compress(measurement, settings, floor, progress)?,
    };
    progress.report(1.0);
    compressed.colour = promise::colour(measurement, settings.target, &compressed.bytes)?;
    promise::keep(settings, floor, &compressed)?;
    compressed.noise = estimate_noise(measurement, floor);
    compressed.effort = tally.effort();
    Ok(compressed)
}

fn check(settings: &Settings) -> Result<(), CompressError> {
    let refuse = |message: String| Err(CompressError::Setting(message));
    settings.target.check().or_else(refuse)?;
    if settings.policy == Policy::Lossless && settings.target != Target::Lossless {
        return refuse(
            "policy lossless keeps every bit and has no error to aim at: ask for lossless instead of another target"
                .to_owned(),
        );
    }
    if let Some(floor) = settings.floor
        && !(floor > 0.0 && floor < 1.0)
    {
        return refuse(format!(
            "floor is {floor}, expected a fraction of the largest sample, more than 0 and less than 1 (0.01 is 1 %)"
        ));
    }
    let basis = SpectralBasis::named(&settings.basis);
    if settings.basis != "auto" && basis.is_none() {
        let known = LineBasis::all().map(LineBasis::name).collect::<Vec<_>>().join(", ");
        return refuse(format!("unknown basis `{}`, expected auto, klt, identity or one of {known}", settings.basis));
    }
    if basis == Some(SpectralBasis::Klt) && settings.policy != Policy::Rd {
        return refuse(format!(
            "basis klt is for policy rd; policy {} takes auto, identity or a wavelet",
            settings.policy
        ));
    }
    if let Some(metadata) = &settings.metadata
        && !matches!(serde_json::from_str(metadata), Ok(serde_json::Value::Object(_)))
    {
        return refuse("metadata is no JSON object, expected text such as {\"name\": \"value\"}".to_owned());
    }
    Ok(())
}

/// The target that the errors themselves must keep for the errors that a header states, rounded up, to keep `target`.
fn stateable(target: Target) -> Result<Target, CompressError> {
    let kept = |error: f64| match header::rounded_down(error) {
        kept if kept > 0.0 => Ok(kept),
        _ => Err(CompressError::Unreachable(format!(
            "{} {error:e} is below 3.6e-43, the smallest error that a file can state; ask for a larger one, or lossless",
            target.bound().map_or("the error", |bound| bound.name)
        ))),
    };
    Ok(match target {
        Target::ErL2(error) => Target::ErL2(kept(error)?),
        Target::ErL1(error) => Target::ErL1(kept(error)?),
        Target::MaxRelativeError(error) => Target::MaxRelativeError(kept(error)?),
        Target::MaxAbsoluteError(error) => Target::MaxAbsoluteError(kept(error)?),
        Target::RelativeRmse(error) => Target::RelativeRmse(kept(error)?),
        // A header states no colours.
        Target::DeltaE(_) | Target::Ratio(_) | Target::Bytes(_) | Target::Step(_) | Target::Auto | Target::Lossless => {
            target
        }
    })
}

/// The floor in the unit of a sample, as it is stored; 0 without a floor.
fn absolute_floor(measurement: &Measurement, settings: &Settings) -> f32 {
    let maximum = || measurement.tensor.range().map_or(0.0, |(_, high)| f64::from(high.max(0.0)));
    settings.floor.map_or(0.0, |floor| (floor * maximum()) as f32)
}

/// What happens along wavelength.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SpectralBasis {
    /// A wavelet.
    Line(LineBasis),
    /// Nothing.
    Identity,
    /// The data's own principal components, stored with the material (policy `rd`).
    Klt,
}

impl SpectralBasis {
    fn name(self) -> &'static str {
        match self {
            Self::Line(basis) => basis.name(),
            Self::Identity => "identity",
            Self::Klt => "klt",
        }
    }

    /// The transform of an axis, triangles in `sphere`.
    fn transform_of(self, axis: &Axis, sphere: SphereBasis) -> AxisTransform {
        match axis {
            Axis::Triangles(_) => AxisTransform::Sphere(sphere),
            Axis::Elevation(_) => AxisTransform::line(LineBasis::BIOR44),
            Axis::Wavelength(_) => match self {
                Self::Line(basis) => AxisTransform::line(basis),
                Self::Identity | Self::Klt => AxisTransform::Identity,
            },
            Axis::Rgb => AxisTransform::line(LineBasis::HAAR),
            Axis::Index { .. } => AxisTransform::Identity,
        }
    }

    /// The basis of a name; `None` for `auto` and for names unknown.
    fn named(name: &str) -> Option<Self> {
        match name {
            "klt" => Some(Self::Klt),
            "identity" => Some(Self::Identity),
            _ => name.parse().ok().map(Self::Line),
        }
    }
}

/// The name of the basis on the wavelength axis.
fn basis_of(axes: &[Axis], transforms: &[AxisTransform], klt: bool) -> String {
    let on_wavelength = axes.iter().zip(transforms).find(|(axis, _)| matches!(axis, Axis::Wavelength(_)));
    match on_wavelength {
        Some(_) if klt => "klt".to_owned(),
        Some((_, AxisTransform::Line { basis, .. })) => basis.name().to_owned(),
        Some((_, AxisTransform::Identity)) => "identity".to_owned(),
        _ => "none".to_owned(),
    }
}

#[cfg(test)]
mod block_tests;
#[cfg(test)]
mod level_tests;
#[cfg(test)]
mod tests;
