//! Job that makes a material from a measurement.
//!
//! Idempotent: the same measurement and request give the same bytes, so a second run publishes and names the same blob.

use super::attempt::{Failure, Made, last, publish, unread};
use super::computation::{Computation, Computed, compute};
use super::document::{Manifest, Origin, Provenance};
use super::engine::Engine;
use super::hub::Control;
use super::ingest::IngestError;
use super::options::Options;
use super::problem::{Code, JobProblem};
use super::process::Written;
use super::request::{CompressRequest, RequestError};
use super::work::Work;
use crate::catalog::{Ended, NewMaterial, Priority};
use crate::compress::CompressError;
use crate::domain::Progress;
use crate::formats::Interpretation;
use crate::pipeline::{self, Input, Outcome, PipelineError, Report, Request};
use crate::store::Digest;
use bytes::Bytes;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

impl Work for CompressRequest {
    type Arguments = String;
    type Computation = Compression;

    fn check(&self) -> Result<(), RequestError> {
        self.check_texts().map_err(RequestError::Text)?;
        self.options.check().map_err(RequestError::Option)
    }

    fn measurement(&self) -> Option<Digest> {
        Some(self.measurement)
    }

    fn priority(&self) -> Priority {
        self.priority
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

/// Compression of a measurement, as the process of a job gets it. The first file holds the bytes of the measurement; a
/// second one, if any, those of the spectrum by which it is multiplied.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Compression {
    interpretation: Interpretation,
    options: Request,
}

impl Computation for Compression {
    const NAME: &'static str = "compress";

    fn compute(self, files: Vec<Bytes>, progress: &dyn Progress) -> Result<Computed, Failure> {
        let bytes = files.first().ok_or_else(|| last(Code::Internal, "a compression without a measurement"))?;
        let spectrum = files.get(1).map(|bytes| &**bytes);
        let source = pipeline::read(&Input { bytes, spectrum, interpretation: &self.interpretation })?;
        // The file's own bytes are no longer needed, and compression needs the memory.
        drop(files);
        let Outcome { bytes, report } = pipeline::compress(&source, &self.options, progress)?;
        Ok(Computed { bytes, report: Some(Box::new(report)) })
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
    let mut files = vec![engine.archive.get(row.content).await?];
    if let Some(id) = options.spectrum {
        files.push(engine.spectrum(id).await?);
    }
    let mut interpretation = request.reading.clone().replace(options.interpretation());
    interpretation.wavelengths.clone_from(&request.options.wavelengths);
    let compression = Compression { interpretation, options: request.options.clone() };
    let written = compute(engine, compression, files, control).await?;
    end(engine, &request, &row.content.to_string(), &options, written).await
}

async fn end(
    engine: &Engine,
    request: &CompressRequest,
    content: &str,
    options: &Options,
    Written { staged, report }: Written,
) -> Result<Made, Failure> {
    let report = *report.ok_or_else(|| last(Code::Internal, "a compression without a report"))?;
    let size = staged.bytes();
    if let Some(over) = engine.lacks_room_for(staged.digest(), size).await? {
        return Err(last(Code::QuotaExceeded, over));
    }
    let published = publish(engine, staged).await?;
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
            origin: Origin::Job,
            measurement: Some(request.measurement),
            content_digest: Some(content.to_owned()),
            options: options.clone(),
            request: Some(request.clone()),
        },
        measured_again: Vec::new(),
    };
    let document = manifest.document().map_err(|e| unread("manifest", &e))?;
    let material = NewMaterial {
        id,
        payload,
        quantity,
        bytes: size,
        name: request.name.clone(),
        tags: request.tags.clone(),
        measurements: vec![request.measurement],
        document,
    };
    let ended = Ended::Material(Box::new(material), published.claim().clone());
    Ok(Made { ended, published })
}

fn kept_options(document: &str) -> Result<Options, Failure> {
    Options::kept(document).map_err(|e| unread("document of the measurement", &e))
}

impl From<PipelineError> for Failure {
    fn from(error: PipelineError) -> Self {
        match &error {
            PipelineError::Compress(CompressError::Cancelled(_)) => Self::Stopped,
            PipelineError::Format(_) | PipelineError::Spectrum(_) => last(Code::UnreadableMeasurement, error),
            PipelineError::Wavelengths(_)
            | PipelineError::Unbounded(_)
            | PipelineError::Compress(CompressError::Setting(_)) => last(Code::BadSetting, error),
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
            IngestError::Away(reason) => Self::Passing(reason),
            IngestError::Over(over) => last(Code::QuotaExceeded, over),
            IngestError::Refused(_) | IngestError::Unfit(_) | IngestError::Spectrum(_) => {
                last(Code::UnreadableMeasurement, error)
            }
        }
    }
}
