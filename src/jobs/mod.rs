//! Work that outlives a request: queue, leases, workers, one file a job.

mod archive;
mod attempt;
mod compress;
mod config;
mod describe;
mod engine;
mod frame;
mod hub;
mod ingest;
mod maths;
mod paper;
mod presence;
mod problem;
mod publish;
mod request;
mod turns;
mod unit;
mod unpack;
mod worker;

pub use archive::{Archive, ArchiveError, Fault, FsckReport, SweepReport};
pub use config::{Limits, SETTINGS, Setting, WorkConfig};
pub use engine::{Engine, OpenError};
pub use ingest::{IngestError, Options, SpectrumError, Upload, UploadError};
pub use maths::{Maths, MathsError};
pub use problem::{Code, JobProblem};
pub use request::{CompressRequest, JobRequest, Kind, KindOnly, MAX_TEXT, PaperRequest, check_text};
pub use unit::Unit;
pub use unpack::Ingested;

pub(crate) use maths::message as panic_message;
pub(crate) use turns::CLIENT;
pub(crate) use worker::run as run_workers;

use tokio_util::sync::CancellationToken;

/// Runs jobs of the archive until `shutdown`; what `wavelume worker` does.
///
/// A running job is finished if it ends within the drain time, else its lease is handed back.
pub async fn work(config: WorkConfig, shutdown: impl Future<Output = ()> + Send) -> Result<(), ArchiveError> {
    let engine = Engine::open(&config).await?;
    let stop = CancellationToken::new();
    let signal = async {
        shutdown.await;
        stop.cancel();
    };
    tracing::info!(workers = config.workers.max(1), worker = engine.presence.id(), "working");
    tokio::join!(signal, run_workers(&engine, config.workers.max(1), &stop));
    Ok(())
}
