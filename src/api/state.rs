//! What every handler shares.

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
    /// The service is stopping: streams end.
    pub(crate) stop: CancellationToken,
    /// `None` where another recorder of metrics was installed in this process.
    pub(crate) metrics: Option<PrometheusHandle>,
    /// The description of the interface, rendered once.
    pub(crate) openapi: Arc<str>,
}
