//! Measurements read from files and from bytes, in any format that is known.

use crate::formats::Interpretation;
use crate::pipeline::{Input, PipelineError, Source};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Why a file is not read as a measurement.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file cannot be read.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        error: io::Error,
    },
    /// The file holds no measurement that is known.
    #[error("{}: {error}", path.display())]
    Measurement {
        /// The file.
        path: PathBuf,
        /// What was found in it, and where.
        error: PipelineError,
    },
}

/// Reads a measurement in any format that is known ([`crate::formats`]), as the file says of itself.
///
/// Give [`crate::pipeline::read`] what the file does not say: a quantity, a unit, a spectrum to join.
///
/// ```
/// # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/illuminant_D65.csv");
/// let source = wavelume_formats::read(path)?;
/// assert_eq!(source.acquisition.quantity.name(), "spectrum");
/// # Ok::<(), wavelume_formats::ReadError>(())
/// ```
pub fn read(path: impl AsRef<Path>) -> Result<Source, ReadError> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|error| ReadError::File { path: path.to_owned(), error })?;
    read_bytes(&bytes).map_err(|error| ReadError::Measurement { path: path.to_owned(), error })
}

/// Reads the bytes of a measurement, as [`read`] does those of a file.
pub fn read_bytes(bytes: &[u8]) -> Result<Source, PipelineError> {
    crate::pipeline::read(&Input { bytes, spectrum: None, interpretation: &Interpretation::default() })
}
