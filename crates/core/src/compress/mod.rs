//! Compresses measurements into materials that keep a promised error, measured on the decoded bytes.
//!
//! * `rd`: codes sign and logarithm of every sample. Triangles take an orthonormal Haar transform and wavelengths a
//!   wavelet. One uniform step quantises all normalised coefficients, and an adaptive range coder writes them. An
//!   optional second layer bounds the error of every sample.
//! * `conventional`, `generic`, `adaptive`: the paper's policies (\[CPB06\] section 4.2): linear domain, bio-Haar,
//!   thresholds on L2-normalised coefficients, kept coefficients stored exactly.
//! * `lossless`: every bit of every sample, and of the numbers that a file states beside one common factor.

mod below_floor;
mod between;
mod classes;
mod compressed;
mod decode;
mod divided;
mod effort;
mod error;
mod exponential;
mod figures;
mod fill;
mod finish;
mod header;
mod kept;
mod kept_coefficients;
mod light;
mod lobe_chunk;
mod lobe_means;
mod logarithm;
mod lossless;
mod metadata;
mod metadata_chunk;
mod noise;
mod notes;
mod parts;
mod policy;
mod promise;
mod ranking;
mod rd;
mod refusal;
mod rows;
mod scales;
mod search;
#[doc(hidden)]
pub mod selection;
mod setting_error;
mod settings;
mod spectral_basis;
mod stated;
mod summary;
mod target;
mod thresholded;
mod transform_code;
mod unreachable_error;
mod values;
mod with_metadata;

pub use crate::codec::CodecError as DecodeError;
pub use between::{Between, Divisor};
pub use compressed::{Compressed, Ranked};
pub(crate) use decode::with_level_errors;
pub use decode::{
    Decoded, DecodedBlock, LevelInfo, decode, decode_block, decode_level, decode_numbers, inspect, levels,
    payload_digest,
};
pub(crate) use divided::Divided;
pub use effort::Effort;
pub use error::CompressError;
pub(crate) use kept::Kept;
pub use light::LightReport;
pub(crate) use light::{EVERYWHERE, polar_weights, weights, weights_of_angles, weights_of_zone};
pub(crate) use lobe_chunk::fits as lobe_fits;
pub(crate) use lobe_means::lobe_means;
pub use lossless::{Numbers, smaller_lossless};
pub use noise::{Noise, estimate as estimate_noise};
pub use policy::Policy;
#[doc(hidden)]
pub use promise::shortfall;
pub use setting_error::{AlbedoConflict, RandomAccessConflict, RdOption, SettingError};
#[doc(hidden)]
pub use settings::absolute_floor;
pub use settings::{ALBEDO_ERROR, AUTO_BASIS, FLOOR, Settings, check_basis};
pub use summary::Summary;
pub use target::{DeltaE, Target};
pub use unreachable_error::UnreachableError;
pub use with_metadata::with_metadata;

use crate::codec::MAGIC;
use crate::domain::{Measurement, NoteTemplate, Progress};
use effort::Tally;
use spectral_basis::SpectralBasis;

/// Templates of all notes that a compression can return.
#[doc(hidden)]
pub const NOTES: &[NoteTemplate] = notes::CompressionNote::TEMPLATES;

/// Returns true if `bytes` start with the magic number of a compressed material.
pub fn is_material(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// Compresses `measurement` into a file that keeps the target of `settings`, for example an error or a size.
pub fn compress(
    measurement: &Measurement,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Compressed, CompressError> {
    compress_numbers(measurement, None, settings, progress)
}

/// Compresses a measurement like [`compress`], given the `numbers` and the one common factor that its file states.
/// Lossless compression stores those numbers if number × factor reproduces every sample.
pub fn compress_numbers(
    measurement: &Measurement,
    numbers: Option<Numbers<'_>>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Compressed, CompressError> {
    settings::check(settings)?;
    promise::check(measurement, settings)?;
    if settings.random_access {
        promise::check_random_access(measurement, settings)?;
    }
    let text = metadata::metadata_with_labels(measurement.tensor.axes(), settings.metadata.as_deref());
    if let Some(text) = text.filter(|text| text.len() > metadata_chunk::MAX_METADATA) {
        return Err(SettingError::MetadataLength { found: text.len() }.into());
    }
    let rounded = Settings { target: promise::stateable(settings.target)?, ..settings.clone() };
    made(measurement, numbers, &rounded, progress).map_err(|error| match error {
        CompressError::Unreachable(error) => {
            let [asked, wanted] = [settings.target, rounded.target].map(|target| target.bound().map(|b| b.at_most));
            error.naming(asked.unwrap_or_default(), wanted.unwrap_or_default()).into()
        }
        other => other,
    })
}

/// Compresses a measurement to a target that a file can state.
fn made(
    measurement: &Measurement,
    numbers: Option<Numbers<'_>>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Compressed, CompressError> {
    let policy = if settings.target == Target::Lossless { Policy::Lossless } else { settings.policy };
    let floor = absolute_floor(measurement, settings.floor);
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
        Policy::Lossless => lossless::compress(measurement, numbers, settings, floor, progress)?,
    };
    progress.report(1.0);
    compressed.colour = promise::colour(measurement, settings.target, &mut compressed)?;
    promise::keep(settings, floor, &compressed)?;
    compressed.noise = estimate_noise(measurement, floor);
    compressed.effort = tally.effort();
    Ok(compressed)
}

#[cfg(test)]
mod block_tests;
#[cfg(test)]
mod grid_tests;
#[cfg(test)]
mod level_tests;
#[cfg(test)]
mod tests;
