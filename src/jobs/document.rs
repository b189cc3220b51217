//! Documents that the catalog keeps beside its columns: the manifest of a material.

use super::options::Options;
use super::request::CompressRequest;
use crate::pipeline::Report;
use crate::store::Digest;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

/// Manifest of a material: the report of its compression, in the names of `wavelume compress --json`, and what jobs
/// said about it.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(crate) struct Manifest {
    /// Report of the compression.
    #[serde(flatten)]
    pub report: Report,
    /// Names given by jobs, at most 32, the latest last. Jobs with equal results share a material.
    #[serde(default)]
    pub names: Vec<String>,
    /// Latest licence given by a job.
    pub licence: Option<String>,
    /// Licences given by jobs, at most 32, the latest last.
    #[serde(default)]
    pub licences: Vec<String>,
    /// Origin of the material.
    pub provenance: Provenance,
}

/// Measurement, options, request and program of the first job that made a material.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(crate) struct Provenance {
    /// Name and version of the program.
    pub generator: String,
    /// Id of the measurement.
    pub measurement: Digest,
    /// Digest of the bytes of the measurement.
    pub content_digest: String,
    /// Options with which the measurement was read.
    #[serde(default)]
    pub options: Options,
    /// Request of the job.
    pub request: CompressRequest,
}

impl Manifest {
    /// Returns the manifest as the JSON object that the catalog keeps.
    pub(crate) fn document(&self) -> Result<Map<String, Value>, serde_json::Error> {
        match serde_json::to_value(self)? {
            Value::Object(document) => Ok(document),
            other => Err(serde::ser::Error::custom(format!("a manifest is an object, found {other}"))),
        }
    }

    /// Reads a document of the catalog. Documents from before 2026-11-23 name the errors of the cells `er_l2` and so
    /// on, and keep those at the samples in an object of their own.
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
