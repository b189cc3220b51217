//! Documents that the catalog keeps beside its columns: the manifest of a material.

use super::options::Options;
use super::request::CompressRequest;
use crate::domain::ErrorReport;
use crate::pipeline::Report;
use crate::store::Digest;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

/// Description of a material in the service: the report of its compression, its names and licences, and its origin. The
/// report has the field names of `wavelume compress --json`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(crate) struct Manifest {
    /// Report of the compression: sizes and errors.
    #[serde(flatten)]
    pub report: Report,
    /// Names that jobs gave to the material, at most 32, the latest last. Jobs with equal results share a material.
    #[serde(default)]
    pub names: Vec<String>,
    /// Licence that the latest job with a licence gave to the material.
    pub licence: Option<String>,
    /// Licences that jobs gave to the material, at most 32, the latest last.
    #[serde(default)]
    pub licences: Vec<String>,
    /// Provenance of the material: the measurement, options, request and program of the first job that made it, or what
    /// an uploaded file states about itself.
    pub provenance: Provenance,
    /// Errors of an uploaded material, measured by this service against stored measurements; empty for materials that
    /// jobs made, whose report is measured by the job.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub measured_again: Vec<MeasuredAgain>,
}

/// Origin of a material in the service.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = MaterialOrigin)]
pub(crate) enum Origin {
    /// A job of the service made the material from a stored measurement.
    #[default]
    Job,
    /// The material was made elsewhere and uploaded. Its report is that of the file's own header.
    Upload,
}

/// Origin of a material: the measurement, options, request and program of the first job that made it, or what the
/// uploaded file states.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(crate) struct Provenance {
    /// Origin of the material: `job` if a job of this service made it, `upload` if it was made elsewhere and uploaded.
    #[serde(default)]
    #[schema(required = false)]
    pub origin: Origin,
    /// Name and version of the program that made the material. An uploaded file states it itself, or has none: then it
    /// is empty.
    pub generator: String,
    /// Id of the measurement from which the material was made; null if the service does not know it.
    #[serde(default)]
    pub measurement: Option<Digest>,
    /// Digest of the bytes of the measurement; null if an uploaded file does not state it.
    #[serde(default)]
    pub content_digest: Option<String>,
    /// Options with which the measurement was read.
    #[serde(default)]
    pub options: Options,
    /// Request of the first job that made the material. For an uploaded one the request that its file states; null if
    /// its measurement is not known.
    #[serde(default)]
    pub request: Option<CompressRequest>,
}

/// Errors of an uploaded material, measured against a stored measurement.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(crate) struct MeasuredAgain {
    /// Id of the measurement.
    pub measurement: Digest,
    /// Name and version of the program that measured.
    pub generator: String,
    /// Errors at the values before compression: those that the file states were measured there, too.
    pub errors: ErrorReport,
    /// Errors at the samples of the measurement, if the values before compression are averages of the samples or were
    /// fitted to them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub errors_at_samples: Option<ErrorReport>,
}

impl Manifest {
    /// Returns the description of a material as the JSON object that the database keeps.
    pub(crate) fn document(&self) -> Result<Map<String, Value>, serde_json::Error> {
        match serde_json::to_value(self)? {
            Value::Object(document) => Ok(document),
            other => Err(serde::ser::Error::custom(format!(
                "expected a JSON object as the description of a material, found {other}"
            ))),
        }
    }

    /// Removes what the description of a material tells about its measurements: their ids, the digests of their bytes,
    /// the options with which they were read, and the compression request.
    pub(crate) fn hide_measurements(&mut self) {
        self.measured_again.clear();
        let provenance = &mut self.provenance;
        (provenance.measurement, provenance.content_digest) = (None, None);
        (provenance.options, provenance.request) = (Options::default(), None);
    }

    /// Parses the description of a material from the database. Before 2026-11-23, descriptions had the errors at
    /// samples in an object `errors_at_samples`. Its fields move up one level, where the errors of the cells, which had
    /// the same names, get the suffix `_cells`.
    pub(crate) fn read(document: &str) -> Result<Self, serde_json::Error> {
        // Whole pages are parsed: the detour by a map would take as long again.
        if !document.contains("\"errors_at_samples\"") {
            return serde_json::from_str(document);
        }
        let mut document: Map<String, Value> = serde_json::from_str(document)?;
        if let Some(Value::Object(at_samples)) = document.remove("errors_at_samples") {
            for name in ["samples", "er_l1", "er_l2", "max_relative_error", "relative_rmse"] {
                let of_cells = document.remove(name).unwrap_or(Value::Null);
                document.insert(format!("{name}_cells"), of_cells);
            }
            document.extend(at_samples);
        }
        serde_json::from_value(Value::Object(document))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Note, NoteKind};
    use crate::formats::Interpretation;
    use crate::pipeline::{Input, Request, read};
    use serde_json::json;

    #[test]
    fn a_document_of_an_earlier_version_keeps_the_sentences_of_its_coverage() {
        let bytes = include_bytes!("../../data/illuminant_D65.csv");
        let source = read(&Input { bytes, spectrum: None, interpretation: &Interpretation::default() }).unwrap();
        let manifest = Manifest {
            report: source.compress(&Request::er_l2(0.01)).unwrap().report,
            names: Vec::new(),
            licence: None,
            licences: Vec::new(),
            provenance: Provenance {
                origin: Origin::Job,
                generator: "wavelume 0.1.0".to_owned(),
                measurement: None,
                content_digest: None,
                options: Options::default(),
                request: None,
            },
            measured_again: Vec::new(),
        };
        let notes = manifest.report.coverage.notes.clone();
        let mut document = Value::Object(manifest.document().unwrap());
        assert_eq!(document["coverage"]["notes"], json!(notes));
        assert_eq!(Manifest::read(&document.to_string()).unwrap().report, manifest.report);

        let sentences: Vec<String> = notes.iter().map(Note::to_string).collect();
        assert!(!sentences.is_empty());
        document["coverage"]["notes"] = json!(sentences);
        let read = Manifest::read(&document.to_string()).unwrap().report.coverage.notes;
        let plain = |sentence: String| Note::plain(NoteKind::Chosen, sentence);
        assert_eq!(read, sentences.into_iter().map(plain).collect::<Vec<_>>());
    }
}
