//! Measurements that were read: samples and digests of the bytes they came from.

use super::digest::digest;
use super::error::PipelineError;
use crate::formats::{self, Acquisition, Interpretation};

/// Bytes of a measurement file, and the properties that the user states because the file does not, such as its unit.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// Contents of the measurement file.
    pub bytes: &'a [u8],
    /// Contents of the file with a spectrum to join with a luminaire.
    pub spectrum: Option<&'a [u8]>,
    /// Properties of the measurement that the file does not state, such as its unit.
    pub interpretation: &'a Interpretation,
}

/// A measurement that was read from a file. The bytes of the file are no longer needed.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use wavelume_formats::pipeline::Request;
/// # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/illuminant_D65.csv");
/// let source = wavelume_formats::read(path)?;
/// for note in &source.acquisition.report.notes {
///     println!("{}", note.message);
/// }
/// let compressed = source.compress(&Request::er_l2(0.001))?;
/// # assert!(compressed.report.errors.er_l2 <= 0.001);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Source {
    /// Samples and the notes of the parser.
    pub acquisition: Acquisition,
    /// Digest of the bytes of the measurement file: `b3-` and BLAKE3 in hex.
    pub content_digest: String,
    /// Digest of the bytes of the spectrum file that is joined with the luminaire; `None` if no spectrum was given.
    pub spectrum_digest: Option<String>,
}

/// Reads a measurement, and joins it with a spectrum if one is given.
pub fn read(input: &Input<'_>) -> Result<Source, PipelineError> {
    let mut acquisition = formats::read(input.bytes, input.interpretation)?;
    if let Some(bytes) = input.spectrum {
        let spectrum = formats::read(bytes, &Interpretation::default()).map_err(PipelineError::Spectrum)?;
        formats::attach_spectrum(&mut acquisition, &spectrum).map_err(PipelineError::Spectrum)?;
    }
    Ok(Source { acquisition, content_digest: digest(input.bytes), spectrum_digest: input.spectrum.map(digest) })
}
