//! Why a measurement was not read or compressed.

use crate::compress::CompressError;
use crate::domain::WavelengthError;
use crate::evaluate::EvaluateError;
use crate::formats::FormatError;
use crate::projection::ProjectionError;

/// Why a request was not fulfilled.
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
    /// The file was refused.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The spectrum to join was refused.
    #[error("spectrum: {0}")]
    Spectrum(FormatError),
    /// The wavelengths asked for are not valid.
    #[error("wavelengths: {0}")]
    Wavelengths(#[from] WavelengthError),
    /// The measurement cannot be projected onto the requested axes.
    #[error(transparent)]
    Projection(#[from] ProjectionError),
    /// The measurement was not compressed.
    #[error(transparent)]
    Compress(#[from] CompressError),
    /// The file that was made does not open.
    #[error(transparent)]
    Opened(EvaluateError),
    /// A material that adds more to the noise of scattered samples than it may or has another light than they, and `strict` was
    /// asked for.
    #[error("strict: {0}")]
    Strict(String),
}
