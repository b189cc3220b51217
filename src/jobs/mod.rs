//! Work that outlives a request: queue, leases, workers, one file a job.

mod archive;
mod config;

pub use archive::{Archive, ArchiveError, Fault, FsckReport, SweepReport};
pub use config::{Limits, WorkConfig};

/// Runs jobs of the archive until `shutdown`; what `wavelume worker` does.
///
/// A running job is finished if it ends within the drain time, else its lease is handed back.
pub async fn work(config: WorkConfig, shutdown: impl Future<Output = ()> + Send) -> Result<(), ArchiveError> {
    let _ = (config, shutdown.await);
    unimplemented!()
}
