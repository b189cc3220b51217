//! Job that makes a material from a measurement.
//!
//! Idempotent: the same measurement and request give the same bytes, so a second run publishes and names the same blob.

use super::attempt::{Failure, Made, last, publish, unread};
use super::document::{Manifest, Provenance};
use super::engine::Engine;
use super::hub::Control;
use super::ingest::IngestError;
use super::options::Options;
use super::problem::{Code, JobProblem};
use super::request::{CompressRequest, RequestError};
use super::work::Work;
use crate::catalog::{Ended, NewMaterial};
use crate::compress::CompressError;
use crate::pipeline::{self, Input, Outcome, PipelineError, Report};
use crate::store::Digest;
use serde::Deserialize;
use std::sync::Arc;

impl Work for CompressRequest {
    type Arguments = String;

    fn check(&self) -> Result<(), RequestError> {
        self.check_texts().map_err(RequestError::Text)?;
        self.options.check().map_err(RequestError::Option)
    }

    fn measurement(&self) -> Option<Digest> {
        Some(self.measurement)
    }

    /// Returns the compression request as JSON, because the binary encoding of the job queue can neither hold its
    /// fields of arbitrary JSON nor detect unknown fields.
    fn arguments(&self) -> Result<String, String> {
        serde_json::to_string(self).map_err(|error| error.to_string())
    }

    async fn run(engine: &Arc<Engine>, request: String, control: &Arc<Control>) -> Result<Made, Failure> {
        run(engine, &request, control).await
    }
}

/// Runs one attempt at a compression job and stores the material that it made.
async fn run(engine: &Arc<Engine>, request: &str, control: &Arc<Control>) -> Result<Made, Failure> {
    let request: CompressRequest = serde_json::from_str(request).map_err(|e| unread("request", &e))?;
    let row = engine.archive.catalog.measurement(request.measurement).await?;
    let row = row.ok_or_else(|| {
        let detail = format!("measurement {} was deleted", request.measurement);
        Failure::Final(JobProblem::new(Code::UnreadableMeasurement, detail))
    })?;
    let options = kept_options(&row.document)?;
    let bytes = engine.archive.get(row.content).await?;
    let spectrum = match options.spectrum {
        Some(id) => Some(engine.spectrum(id).await?),
        None => None,
    };
    let work = {
        let (request, control) = (request.clone(), Arc::clone(control));
        let mut interpretation = request.reading.clone().replace(options.interpretation());
        interpretation.wavelengths.clone_from(&request.options.wavelengths);
        move || {
            let input = Input { bytes: &bytes, spectrum: spectrum.as_deref(), interpretation: &interpretation };
            let source = pipeline::read(&input)?;
            // The file's own bytes are no longer needed, and compression needs the memory.
            drop((bytes, spectrum));
            pipeline::compress(&source, &request.options, &*control)
        }
    };
    let outcome = engine.background.run(work).await??;
    end(engine, &request, &row.content.to_string(), &options, outcome).await
}

async fn end(
    engine: &Engine,
    request: &CompressRequest,
    content: &str,
    options: &Options,
    outcome: Outcome,
) -> Result<Made, Failure> {
    let Outcome { bytes, report } = outcome;
    let size = bytes.len() as u64;
    let published = publish(engine, bytes).await?;
    let id = published.digest();
    let payload = report.payload_digest.parse().map_err(|e| last(Code::Internal, e))?;
    let quantity = report.quantity;
    let manifest = Manifest {
        // The digest repeats the id.
        report: Report { digest: String::new(), ..report },
        names: Vec::new(),
        licence: request.licence.clone(),
        licences: Vec::new(),
        provenance: Provenance {
            generator: concat!("wavelume ", env!("CARGO_PKG_VERSION")).to_owned(),
            measurement: request.measurement,
            content_digest: content.to_owned(),
            options: options.clone(),
            request: request.clone(),
        },
    };
    let document = manifest.document().map_err(|e| unread("manifest", &e))?;
    let material = NewMaterial {
        id,
        payload,
        quantity,
        bytes: size,
        name: request.name.clone(),
        tags: request.tags.clone(),
        measurement: request.measurement,
        document,
    };
    let ended = Ended::Material(Box::new(material), published.claim().clone());
    Ok(Made { ended, published })
}

/// Returns the options for reading a measurement (quantity, unit, column and so on) that were given at its upload, from
/// its stored description.
fn kept_options(document: &str) -> Result<Options, Failure> {
    #[derive(Deserialize)]
    struct Kept {
        options: Options,
    }
    serde_json::from_str::<Kept>(document)
        .map(|kept| kept.options)
        .map_err(|e| unread("document of the measurement", &e))
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
            PipelineError::Compress(CompressError::Unreachable(_)) | PipelineError::Strict(_) => {
                last(Code::UnreachableTarget, error)
            }
            PipelineError::Opened(_) => last(Code::Internal, error),
        }
    }
}

impl From<IngestError> for Failure {
    fn from(error: IngestError) -> Self {
        match error {
            IngestError::Store(error) => error.into(),
            IngestError::Catalog(error) => error.into(),
            IngestError::Maths(error) => error.into(),
            IngestError::Foreign(reason) => Self::Passing(reason),
            IngestError::Refused(_) | IngestError::Unfit(_) | IngestError::Spectrum(_) => {
                last(Code::UnreadableMeasurement, error)
            }
        }
    }
}
