//! What every handler shares.

use super::content::Contents;
use crate::jobs::Engine;
use metrics_exporter_prometheus::PrometheusHandle;
use std::sync::Arc;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// What every handler shares; cheap to clone.
#[derive(Clone)]
pub(crate) struct App {
    pub(crate) engine: Arc<Engine>,
    /// Uploads that may run at the same time.
    pub(crate) uploads: Arc<Semaphore>,
    /// KiB of JSON bodies that may be in memory.
    pub(crate) bodies: Arc<Semaphore>,
    /// Batches that may be answered as streams at the same time.
    pub(crate) streams: Arc<Semaphore>,
    /// Exported files that may be made or sent at the same time.
    pub(crate) exports: Arc<Semaphore>,
    /// Small material files that were asked for lately.
    pub(crate) contents: Contents,
    /// The service is stopping: streams end.
    pub(crate) stop: CancellationToken,
    /// `None` where another recorder of metrics was installed in this process.
    pub(crate) metrics: Option<PrometheusHandle>,
    /// The description of the interface, rendered once.
    pub(crate) openapi: Arc<str>,
}
