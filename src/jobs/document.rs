//! Documents that the catalog keeps beside its columns: the manifest of a material.

use super::options::Options;
use super::request::CompressRequest;
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
    /// Provenance of the material: the measurement, options, request and program of the first job that made it.
    pub provenance: Provenance,
}

/// Measurement, options, request and program of the first job that made a material.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(crate) struct Provenance {
    /// Name and version of the program that made the material.
    pub generator: String,
    /// Id of the measurement from which the material was made.
    pub measurement: Digest,
    /// Digest of the bytes of the measurement.
    pub content_digest: String,
    /// Options with which the measurement was read.
    #[serde(default)]
    pub options: Options,
    /// Request of the first job that made the material.
    pub request: CompressRequest,
}

impl Manifest {
    /// Returns the description of a material as the JSON object that the database keeps.
    pub(crate) fn document(&self) -> Result<Map<String, Value>, serde_json::Error> {
        match serde_json::to_value(self)? {
            Value::Object(document) => Ok(document),
            other => Err(serde::ser::Error::custom(format!("a manifest is an object, found {other}"))),
        }
    }

    /// Parses the description of a material from the database. Before 2026-11-23, descriptions had the errors at
    /// samples in an object `errors_at_samples`. Its fields move up one level, where the errors of the cells, which had
    /// the same names, get the suffix `_cells`.
    pub(crate) fn read(document: &str) -> Result<Self, serde_json::Error> {
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
