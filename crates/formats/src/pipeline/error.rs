//! Errors of reading and compressing a measurement.

use crate::compress::CompressError;
use crate::domain::WavelengthError;
use crate::evaluate::EvaluateError;
use crate::formats::FormatError;
use crate::projection::ProjectionError;

/// Reasons why reading or compressing a measurement failed.
///
/// ```
/// use wavelume_formats::pipeline::{PipelineError, Request};
/// # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/illuminant_D65.csv");
/// let source = wavelume_formats::read(path)?;
/// let request = Request { basis: "no-such-basis".to_owned(), ..Request::er_l2(0.001) };
/// assert!(matches!(source.compress(&request), Err(PipelineError::Compress(_))));
/// # Ok::<(), wavelume_formats::ReadError>(())
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PipelineError {
    /// The measurement file was rejected.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The file with the spectrum to join with a luminaire was rejected.
    #[error("cannot multiply the samples by the given spectrum: {0}")]
    Spectrum(FormatError),
    /// The wavelengths to resample to are invalid.
    #[error("cannot resample to the requested wavelengths: {0}")]
    Wavelengths(#[from] WavelengthError),
    /// The measurement cannot be projected onto the requested axes.
    #[error(transparent)]
    Projection(#[from] ProjectionError),
    /// Compression failed.
    #[error(transparent)]
    Compress(#[from] CompressError),
    /// The albedo or flux, whose error was to be bounded, is unknown.
    #[error("cannot bound the error of the albedo or flux: {0}")]
    Unbounded(EvaluateError),
    /// The compressed file cannot be opened for evaluation.
    #[error(transparent)]
    Opened(EvaluateError),
    /// Warning that the option `strict` turns into an error. The measurement contradicts physics, or the material adds
    /// too much error to the noise of scattered samples, differs from them in total light, or misses a narrow lobe that
    /// the samples do not resolve.
    #[error("refused by the option `strict`: {0}")]
    Strict(String),
}
