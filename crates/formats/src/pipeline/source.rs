//! A measurement that was read: its samples, and the digests of the bytes that they come from.

use super::digest::digest;
use super::error::PipelineError;
use crate::formats::{self, Acquisition, Interpretation};

/// The bytes of a measurement and what the user says about them.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The file.
    pub bytes: &'a [u8],
    /// A spectrum to join with a luminaire.
    pub spectrum: Option<&'a [u8]>,
    /// What the user says about the file.
    pub interpretation: &'a Interpretation,
}

/// A measurement that was read, with its own bytes no longer needed.
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
    /// The samples and everything the parser has to say.
    pub acquisition: Acquisition,
    /// Digest of the file's bytes.
    pub content_digest: String,
    /// Digest of the joined spectrum's bytes.
    pub spectrum_digest: Option<String>,
}

/// Reads a measurement and joins its spectrum.
pub fn read(input: &Input<'_>) -> Result<Source, PipelineError> {
    let mut acquisition = formats::read(input.bytes, input.interpretation)?;
    if let Some(bytes) = input.spectrum {
        let spectrum = formats::read(bytes, &Interpretation::default()).map_err(PipelineError::Spectrum)?;
        formats::attach_spectrum(&mut acquisition, &spectrum).map_err(PipelineError::Spectrum)?;
    }
    Ok(Source { acquisition, content_digest: digest(input.bytes), spectrum_digest: input.spectrum.map(digest) })
}
