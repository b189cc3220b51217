//! Statements of a material file about itself: a report from its header, and its origin from its metadata.

use super::digest::digest;
use super::error::PipelineError;
use super::fit::{FitReport, promised};
use super::incidences::IncidenceReport;
use super::measured;
use super::refinement::above_noise;
use super::report::{Report, ratio_bytes, ratio_coefficients};
use super::request::Request;
use super::sparse::has_lobes;
use crate::compress::{self, DecodeError, Decoded, Summary};
use crate::domain::{Axis, Note, NoteKind, Sampling};
use crate::evaluate::Material;
use crate::notes::MaterialNote;
use crate::projection::Coverage;
use serde_json::Value;

/// Largest number of warnings that are taken from the metadata of a file. Raising it lengthens the description of files
/// with many.
const MOST_WARNINGS: usize = 16;
/// Largest number of characters of a text that is taken from the metadata of a file; a longer text is left out. Raising
/// it lengthens descriptions.
const LONGEST: usize = 500;

/// Contents of a material file: a report in the form of that of its compression, and the origin of the material.
#[derive(Clone, Debug)]
pub struct Stated {
    /// Size, axes and errors of the material. The errors are those that the header states, the warnings those of the
    /// metadata.
    pub report: Report,
    /// Origin of the material according to its metadata.
    pub origin: StatedOrigin,
    /// Contents of the file's header (quantity, unit, axes, settings and errors), and the text of its metadata.
    pub summary: Summary,
}

/// Origin of a material according to the metadata of its file, which nobody has checked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StatedOrigin {
    /// Name and version of the program that made the material.
    pub generator: Option<String>,
    /// Digest of the bytes of the measurement: `b3-` and BLAKE3 in hex.
    pub content_digest: Option<String>,
    /// Digest of the bytes of the spectrum joined with the measurement.
    pub spectrum_digest: Option<String>,
    /// Request of the compression; `None` if this version does not understand it or an option has a value that is not
    /// allowed.
    pub request: Option<Request>,
}

/// Decodes a material file wholly and opens it for evaluation, which finds any damage, and returns what it states about
/// itself.
pub fn stated(bytes: &[u8]) -> Result<Stated, PipelineError> {
    let decoded: Decoded = compress::decode(bytes).map_err(damaged)?;
    let summary = decoded.summary.clone();
    let material = Material::decoded(decoded).map_err(PipelineError::Opened)?;
    let incidences = if has_lobes(&summary.axes) { IncidenceReport::of(&material, None) } else { None };
    let warning = measured::warning(material.measured_share());
    drop(material);
    let mut stated = stated_by(bytes, summary, incidences)?;
    stated.report.notes.extend(warning);
    Ok(stated)
}

/// Returns what a material file states about itself, from its header and its metadata. No sample is decoded, so that
/// the interpolation between incident directions is not reported; the checksum of every chunk is verified.
pub fn stated_in_header(bytes: &[u8]) -> Result<Stated, PipelineError> {
    stated_by(bytes, compress::inspect(bytes).map_err(damaged)?, None)
}

fn damaged(error: DecodeError) -> PipelineError {
    PipelineError::Opened(error.into())
}

/// Makes the report of a material file from its `summary`.
fn stated_by(bytes: &[u8], summary: Summary, incidences: Option<IncidenceReport>) -> Result<Stated, PipelineError> {
    let samples = summary.axes.iter().map(|axis| axis.len() as f64).product::<f64>();
    // Metadata that are not JSON were refused by the decoder.
    let metadata: Value =
        summary.metadata.as_deref().and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default();
    let text = |value: &Value| value.as_str().filter(|text| text.chars().count() <= LONGEST).map(str::to_owned);
    let source = &metadata["source"];
    let (fit, unread) = match serde_json::from_value::<Option<FitReport>>(metadata["scattered"].clone()) {
        Ok(fit) => (fit, None),
        Err(error) => (None, Some(MaterialNote::StatedFitUnread { reason: error.to_string() }.into())),
    };
    let warnings = metadata["warnings"].as_array().into_iter().flatten().take(MOST_WARNINGS);
    let notes = warnings.filter_map(|warning| Some(Note::plain(NoteKind::Warning, text(warning)?)));
    let of_cells = summary.sampling == Sampling::Average;
    let request: Option<Request> = serde_json::from_value(metadata["request"].clone()).ok();
    let promised = request.as_ref().map(|request| promised(request.target, summary.errors.er_l2));
    let above_noise = fit.zip(promised).and_then(|(fit, promised)| above_noise(&fit, promised));
    let report = Report {
        digest: digest(bytes),
        payload_digest: format!("b3-{}", compress::payload_digest(bytes).map_err(damaged)?.to_hex()),
        format: text(&source["format"]).unwrap_or_default(),
        dialect: text(&source["dialect"]).unwrap_or_default(),
        quantity: summary.quantity,
        unit: summary.unit,
        policy: summary.policy,
        basis: summary.basis.clone(),
        basis_ranking: Vec::new(),
        axes: summary.axes.iter().map(Axis::describe).collect(),
        bytes: bytes.len() as u64,
        kept_coefficients: summary.kept_coefficients,
        ratio_coefficients: ratio_coefficients(summary.kept_coefficients, samples),
        step: summary.step,
        ratio_bytes: ratio_bytes(bytes, samples),
        errors: summary.errors,
        errors_at: of_cells.then(|| "the averages over triangles from which the file was made".to_owned()),
        cells: None,
        light: None,
        incidences,
        delta_e: None,
        fit,
        lobe: None,
        light_at_samples: Vec::new(),
        within_2u: None,
        auto: None,
        noise: None,
        coverage: Coverage::default(),
        notes: notes.chain(unread).chain(above_noise).collect(),
        levels: compress::levels(bytes).map_err(damaged)?,
    };
    let origin = StatedOrigin {
        generator: text(&metadata["generator"]),
        content_digest: text(&source["content_digest"]),
        spectrum_digest: text(&source["spectrum_digest"]),
        request: request.filter(|request| request.check().is_ok()),
    };
    Ok(Stated { report, origin, summary })
}

/// Returns the number of samples of a material file, from its header. Nothing is decoded; the checksum of every chunk
/// is verified.
pub fn samples_of(bytes: &[u8]) -> Result<u64, PipelineError> {
    let summary = compress::inspect(bytes).map_err(|error| PipelineError::Opened(error.into()))?;
    Ok(summary.axes.iter().map(|axis| axis.len() as u64).product())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::Interpretation;
    use crate::pipeline::{Input, read};

    #[test]
    fn a_file_states_what_the_report_of_its_compression_says() {
        let bytes = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/aerolamp.ies")).unwrap();
        let interpretation = Interpretation::default();
        let source = read(&Input { bytes: &bytes, spectrum: None, interpretation: &interpretation }).unwrap();
        let request = Request::er_l2(0.02);
        let made = source.compress(&request).unwrap();
        let Stated { report, origin, summary } = stated(&made.bytes).unwrap();
        let in_header = stated_in_header(&made.bytes).unwrap();
        assert_eq!((in_header.report, in_header.summary), (Report { incidences: None, ..report.clone() }, summary));
        assert_eq!((&report.digest, &report.payload_digest), (&made.report.digest, &made.report.payload_digest));
        assert_eq!((report.format, report.axes), (made.report.format, made.report.axes));
        assert!(
            report.errors.er_l2 >= made.report.errors.er_l2 && report.errors.er_l2 < 1.001 * made.report.errors.er_l2
        );
        assert_eq!(origin.content_digest.as_deref(), Some(source.content_digest.as_str()));
        assert_eq!(origin.request, Some(request));
        assert!(origin.generator.unwrap().starts_with("wavelume ") && origin.spectrum_digest.is_none());
        assert!(samples_of(&made.bytes).unwrap() > 100);
        // One beginning is a whole file: the one without the metadata at the end.
        let whole: Vec<usize> = (0..made.bytes.len()).filter(|length| stated(&made.bytes[..*length]).is_ok()).collect();
        assert_eq!(whole.len(), 1);
        let bare = stated(&made.bytes[..whole[0]]).unwrap();
        assert_eq!((bare.report.payload_digest, bare.origin), (made.report.payload_digest, StatedOrigin::default()));
    }
}
