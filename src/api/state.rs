//! State that every handler shares.

use super::access::Access;
use super::content_cache::Contents;
use super::places::{KIB, Places};
use crate::jobs::{Engine, Limits};
use metrics_exporter_prometheus::PrometheusHandle;
use std::sync::Arc;
use tokio_util::sync::CancellationToken;

/// State that every handler shares; cheap to clone.
#[derive(Clone)]
pub(crate) struct App {
    pub(crate) engine: Arc<Engine>,
    /// Hosts and origins that are answered.
    pub(crate) access: Arc<Access>,
    /// Places that clients hold, per address and in total.
    pub(crate) held: Held,
    /// Cache of small material files that were requested recently.
    pub(crate) contents: Contents,
    /// Cancelled by the stop signal: `/readyz` reports it while the listener still answers.
    pub(crate) stopping: CancellationToken,
    /// Cancelled when the listener is closed: event streams and waits end.
    pub(crate) stop: CancellationToken,
    /// `None` if another recorder of metrics was installed in this process.
    pub(crate) metrics: Option<PrometheusHandle>,
    /// Description of the interface in JSON, rendered once.
    pub(crate) openapi: Arc<str>,
}

/// All kinds of places that a request can hold.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    /// Running requests, until the last byte of the answer is sent.
    pub(crate) requests: Places,
    /// Running queries, until the last byte of the answer is sent.
    pub(crate) queries: Places,
    /// Uploads being received.
    pub(crate) uploads: Places,
    /// KiB of JSON bodies in memory.
    pub(crate) bodies: Places,
    /// KiB of whole answers in memory.
    pub(crate) answers: Places,
    /// Batches answered as streams.
    pub(crate) streams: Places,
    /// Exported files that are being made or sent.
    pub(crate) exports: Places,
    /// Clients that follow a job.
    pub(crate) followers: Places,
}

impl Held {
    pub(crate) fn new(limits: &Limits) -> Self {
        let kib = |kind, all: usize, each: usize| Places::new(kind, all / KIB, each / KIB);
        Self {
            requests: Places::new("requests", limits.requests, limits.requests_each),
            queries: Places::new("queries", limits.queries, limits.queries_each),
            uploads: Places::new("uploads", limits.uploads, limits.uploads_each),
            bodies: kib("KiB of bodies", limits.bodies_bytes, limits.bodies_bytes_each),
            answers: kib("KiB of answers", limits.answers_bytes, limits.answers_bytes_each),
            streams: Places::new("streams", limits.streams, limits.streams_each),
            exports: Places::new("exports", limits.exports, limits.exports_each),
            followers: Places::new("followers of jobs", limits.followers, limits.followers_each),
        }
    }

    /// Returns every kind of places, for metrics.
    pub(crate) fn kinds(&self) -> [&Places; 8] {
        let Self { requests, queries, uploads, bodies, answers, streams, exports, followers } = self;
        [requests, queries, uploads, bodies, answers, streams, exports, followers]
    }
}
