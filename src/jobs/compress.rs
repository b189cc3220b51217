//! The job that makes a material of a measurement.
//!
//! Idempotent: the same measurement and request give the same bytes, so a second run publishes and names what is there.

use super::engine::Engine;
use super::hub::Control;
use super::ingest::{IngestError, Options, PIN};
use super::maths::MathsError;
use super::problem::{Code, JobProblem};
use super::request::CompressRequest;
use crate::catalog::{CatalogError, Ended, NewMaterial};
use crate::compress::CompressError;
use crate::pipeline::{self, Input, Outcome, PipelineError};
use crate::store::{StoreError, StoreExt};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// Why an attempt ended without a material.
pub(crate) enum Failure {
    /// It would end the same way again.
    Final(JobProblem),
    /// It may pass.
    Passing(String),
    /// It was asked to stop.
    Stopped,
}

/// Runs one attempt and publishes what it made.
pub(crate) async fn run(engine: &Arc<Engine>, request: &str, control: &Arc<Control>) -> Result<Ended, Failure> {
    let request: CompressRequest =
        serde_json::from_str(request).map_err(|e| Failure::Final(JobProblem::new(Code::BadSetting, e.to_string())))?;
    let row = engine.archive.catalog.measurement(request.measurement).await?;
    let row = row.ok_or_else(|| {
        let detail = format!("measurement {} was deleted", request.measurement);
        Failure::Final(JobProblem::new(Code::UnreadableMeasurement, detail))
    })?;
    let options = kept_options(&row.document)?;
    let bytes = engine.archive.store.get(row.content).await?;
    let spectrum = match options.spectrum {
        Some(id) => Some(engine.spectrum(id).await?),
        None => None,
    };
    let work = {
        let (request, control) = (request.clone(), Arc::clone(control));
        let mut interpretation = options.interpretation();
        interpretation.axes.clone_from(&request.axes);
        interpretation.wavelengths.clone_from(&request.wavelengths);
        interpretation.quantity = request.quantity.or(interpretation.quantity);
        move || {
            let input = Input { bytes: &bytes, spectrum: spectrum.as_deref(), interpretation: &interpretation };
            let source = pipeline::read(&input)?;
            pipeline::compress(&source, &request.pipeline(), &*control)
        }
    };
    let outcome = engine.background.run(work).await??;
    publish(engine, &request, &row.content.to_string(), &options, outcome).await
}

async fn publish(
    engine: &Engine,
    request: &CompressRequest,
    content: &str,
    options: &Options,
    outcome: Outcome,
) -> Result<Ended, Failure> {
    let Outcome { bytes, report } = outcome;
    let size = bytes.len() as u64;
    let staging = engine.archive.staging.clone();
    let staged = tokio::task::spawn_blocking(move || staging.stage(&bytes))
        .await
        .map_err(|e| Failure::Passing(e.to_string()))??;
    let id = staged.digest();
    let payload = report.payload_digest.parse().unwrap_or(id);
    let quantity = report.quantity;
    let mut manifest = match serde_json::to_value(&report) {
        Ok(Value::Object(map)) => map,
        _ => Map::new(),
    };
    // The id says it already.
    manifest.remove("digest");
    manifest.insert("licence".to_owned(), json!(request.licence));
    manifest.insert(
        "provenance".to_owned(),
        json!({
            "generator": concat!("wavelume ", env!("CARGO_PKG_VERSION")),
            "measurement": request.measurement,
            "content_digest": content,
            "options": options,
            "request": request,
        }),
    );
    let holder = uuid::Uuid::now_v7().simple().to_string();
    engine.archive.catalog.pin(id, &holder, PIN).await?;
    engine.archive.store.publish(&staged).await?;
    let material = NewMaterial {
        id,
        payload,
        quantity,
        bytes: size,
        name: request.name.clone(),
        tags: request.tags.clone(),
        measurement: request.measurement,
        document: Value::Object(manifest).to_string(),
    };
    Ok(Ended::Material(Box::new(material), holder))
}

/// The options that a measurement was uploaded with.
fn kept_options(document: &str) -> Result<Options, Failure> {
    #[derive(Deserialize)]
    struct Kept {
        options: Options,
    }
    serde_json::from_str::<Kept>(document)
        .map(|kept| kept.options)
        .map_err(|e| Failure::Final(JobProblem::new(Code::Internal, format!("measurement's document: {e}"))))
}

fn last(code: Code, detail: impl std::fmt::Display) -> Failure {
    Failure::Final(JobProblem::new(code, detail.to_string()))
}

impl From<PipelineError> for Failure {
    fn from(error: PipelineError) -> Self {
        match &error {
            PipelineError::Compress(CompressError::Cancelled(_)) => Self::Stopped,
            PipelineError::Format(_) | PipelineError::Spectrum(_) => last(Code::UnreadableMeasurement, error),
            PipelineError::Wavelengths(_) | PipelineError::Compress(CompressError::Setting(_)) => {
                last(Code::BadSetting, error)
            }
            PipelineError::Projection(_) => last(Code::UnfitAxes, error),
            PipelineError::Compress(CompressError::Unreachable(_)) => last(Code::UnreachableTarget, error),
        }
    }
}

impl From<MathsError> for Failure {
    fn from(error: MathsError) -> Self {
        match error {
            MathsError::Busy => Self::Passing(error.to_string()),
            // The same input would panic again. Its message is for the log.
            MathsError::Panicked(message) => {
                tracing::error!(message, "a computation panicked");
                last(Code::Internal, "the computation failed; this is a bug of the service, not of the measurement")
            }
        }
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Corrupt { .. } | StoreError::NotFound(_) | StoreError::Range { .. } => {
                tracing::error!(%error, "a stored blob is damaged");
                last(Code::Corrupt, "the stored bytes of the measurement are damaged; upload the file again")
            }
            StoreError::Io(_) | StoreError::Objects(_) => Self::Passing(error.to_string()),
        }
    }
}

impl From<CatalogError> for Failure {
    fn from(error: CatalogError) -> Self {
        Self::Passing(error.to_string())
    }
}

impl From<IngestError> for Failure {
    fn from(error: IngestError) -> Self {
        match error {
            IngestError::Store(error) => error.into(),
            IngestError::Catalog(error) => error.into(),
            IngestError::Maths(error) => error.into(),
            IngestError::Refused(_) | IngestError::Unfit(_) | IngestError::Spectrum(_) => {
                last(Code::UnreadableMeasurement, error)
            }
        }
    }
}
