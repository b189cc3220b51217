//! State that every handler shares.

use super::access::Access;
use super::caller::Caller;
use super::content_cache::Contents;
use super::figures::Durations;
use super::guard::Guard;
use super::places::{KIB, Places};
use super::problem::Problem;
use super::rates::Rates;
use super::remembered::Remembered;
use crate::catalog::Act;
use crate::jobs::{Engine, Limits};
use crate::trust::Tenant;
use axum::extract::FromRequestParts;
use axum::http::Extensions;
use axum::http::request::Parts;
use metrics_exporter_prometheus::PrometheusHandle;
use std::ops::Deref;
use std::sync::Arc;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// State of the HTTP router. A handler extracts [`App`] instead, and so cannot reach the data of a tenant other than
/// its caller's.
#[derive(Clone)]
pub(crate) struct Service(App);

/// State that an HTTP handler uses: it reaches only the data of the tenant for which the caller acts. Cheap to clone.
#[derive(Clone)]
pub(crate) struct App {
    /// State of the workers and HTTP handlers (catalog, store, thread pools), restricted to the data of the caller's
    /// tenant.
    pub(crate) engine: Arc<Engine>,
    shared: Arc<Shared>,
}

/// Parts of the HTTP service's state that are the same for all tenants.
pub(crate) struct Shared {
    /// Rules for the request hosts and page origins that are accepted.
    pub(crate) access: Arc<Access>,
    /// Rule by which callers are admitted, and what is remembered about their keys.
    pub(crate) guard: Arc<Guard>,
    /// Counts of what clients occupy at a time (requests, uploads, memory), limited per address and in total.
    pub(crate) held: Held,
    /// Counts of the requests of tenants that have a limit on the requests within a minute.
    pub(crate) rates: Rates,
    /// Cache of small material files that were requested recently.
    pub(crate) contents: Contents,
    /// Memory of the materials that callers may read.
    pub(crate) remembered: Remembered,
    /// Token that the stop signal cancels: `/readyz` reports it while the listener still answers.
    pub(crate) stopping: CancellationToken,
    /// Token that is cancelled when the listener is closed: event streams and waiting requests end.
    pub(crate) stop: CancellationToken,
    /// Tracker of the tasks that add bytes to resumable uploads; the service does not end before them.
    pub(crate) writing: TaskTracker,
    /// Histograms of the durations of requests.
    pub(crate) durations: Durations,
    /// Recorder of metrics; `None` if another one was installed in this process.
    pub(crate) metrics: Option<PrometheusHandle>,
    /// Function that returns the OpenAPI description of the interface as JSON, which its first call writes.
    pub(crate) openapi: Description,
}

/// Returns a JSON document that is the same for as long as the process runs, or why it could not be written.
pub(crate) type Description = fn() -> &'static Result<String, serde_json::Error>;

impl Service {
    pub(crate) fn new(app: App) -> Self {
        Self(app)
    }

    /// Returns the state for the handler of an HTTP request, bound to the data of the caller's tenant. The caller is
    /// stored in the `extensions` of the request; without one, the request fails.
    pub(crate) fn of(&self, extensions: &Extensions) -> Result<App, Problem> {
        Ok(self.0.of(&Caller::of_extensions(extensions)?.tenant))
    }
}

impl App {
    pub(crate) fn new(engine: Arc<Engine>, shared: Shared) -> Self {
        Self { engine, shared: Arc::new(shared) }
    }

    /// Returns a state through which an HTTP handler reads and changes the data of `tenant` alone. Limits, caches and
    /// other parts that all tenants share stay those of this state.
    pub(crate) fn of(&self, tenant: &Tenant) -> Self {
        Self { engine: self.engine.of(tenant), shared: Arc::clone(&self.shared) }
    }

    /// Records an act in the audit trail. A failure is only logged, because the act itself was done.
    pub(crate) async fn record(&self, act: &Act) {
        if let Err(error) = self.engine.archive.catalog.record(act).await {
            tracing::warn!(%error, "an act was not recorded in the audit trail");
        }
    }
}

impl Deref for App {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.shared
    }
}

impl FromRequestParts<Service> for App {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, service: &Service) -> Result<Self, Problem> {
        service.of(&parts.extensions)
    }
}

/// Counters of everything that requests occupy, each limited in total and per client.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    /// Counter of running requests, until the last byte of each answer is sent.
    pub(crate) requests: Places,
    /// Counter of running queries of materials, until the last byte of each answer is sent.
    pub(crate) queries: Places,
    /// Counter of uploads being received.
    pub(crate) uploads: Places,
    /// Counter of KiB of memory for checking uploaded materials.
    pub(crate) checking: Places,
    /// Counter of KiB of JSON request bodies in memory.
    pub(crate) bodies: Places,
    /// Counter of KiB of response bodies that are whole in memory until they are sent, in contrast to streamed ones.
    pub(crate) answers: Places,
    /// Counter of batch evaluations whose streamed answers are being computed or sent.
    pub(crate) streams: Places,
    /// Counter of exported files that are being made or sent.
    pub(crate) exports: Places,
    /// Counter of clients that follow a job through its event stream.
    pub(crate) followers: Places,
}

impl Held {
    pub(crate) fn new(limits: &Limits) -> Self {
        let kib = |kind, all: usize, each: usize| Places::new(kind, all / KIB, each / KIB);
        Self {
            requests: Places::new("requests", limits.requests, limits.requests_each),
            queries: Places::new("queries", limits.queries, limits.queries_each),
            uploads: Places::new("uploads", limits.uploads, limits.uploads_each),
            checking: kib("KiB of materials being checked", limits.checking_bytes, limits.checking_bytes_each),
            bodies: kib("KiB of bodies", limits.bodies_bytes, limits.bodies_bytes_each),
            answers: kib("KiB of answers", limits.answers_bytes, limits.answers_bytes_each),
            streams: Places::new("streams", limits.streams, limits.streams_each),
            exports: Places::new("exports", limits.exports, limits.exports_each),
            followers: Places::new("followers of jobs", limits.followers, limits.followers_each),
        }
    }

    /// Returns all pools of permits that requests take (for example, for uploads and for open streams), to report the
    /// taken ones as metrics.
    pub(crate) fn kinds(&self) -> [&Places; 9] {
        let Self { requests, queries, uploads, checking, bodies, answers, streams, exports, followers } = self;
        [requests, queries, uploads, checking, bodies, answers, streams, exports, followers]
    }
}
