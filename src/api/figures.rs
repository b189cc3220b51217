//! Metrics of a process, and the small server through which a worker shows them.

use axum::Router;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use metrics::Histogram;
use metrics_exporter_prometheus::{PrometheusBuilder, PrometheusHandle};
use std::collections::HashMap;
use std::net::SocketAddr;
use std::sync::{OnceLock, PoisonError, RwLock};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio_util::task::AbortOnDropHandle;

/// Names of counters that are set to 0 at the start, so that the first event shows as an increase.
const COUNTERS: [&str; 7] = [
    "wavelume_handshakes_failed_total",
    "wavelume_jobs_left_to_newer_total",
    "wavelume_jobs_lost_total",
    "wavelume_damaged_blobs_total",
    "wavelume_materials_opened_total",
    "wavelume_scrub_blobs_total",
    "wavelume_scrub_bytes_total",
];

/// Job states that are values of the label `state` of the metric `wavelume_job_attempts_total`.
const ENDS: [&str; 5] = ["succeeded", "failed", "dead", "cancelled", "queued"];

/// Faults that are values of the label `kind` of the metric `wavelume_scrub_faults_total`.
const FAULTS: [&str; 2] = ["corrupt", "missing"];

/// Upper bounds in seconds of the classes in which the durations of requests and jobs are counted. The counts of
/// several processes can be added, unlike quantiles.
const SECONDS: [f64; 14] = [0.001, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 30.0, 120.0, 600.0];

/// Histograms of the durations of requests, one for each method, route and status that has occurred. Finding one here
/// is quicker than by its name and labels.
#[derive(Default)]
pub(crate) struct Durations {
    known: RwLock<HashMap<(&'static str, &'static str, u16), Histogram>>,
}

impl Durations {
    /// Records the duration of a request in seconds.
    pub(crate) fn record(&self, method: &'static str, route: &'static str, status: u16, seconds: f64) {
        let key = (method, route, status);
        if let Some(histogram) = self.known.read().unwrap_or_else(PoisonError::into_inner).get(&key) {
            return histogram.record(seconds);
        }
        let labels = [
            ("method", method.into()),
            ("route", route.into()),
            ("status", metrics::SharedString::from(status.to_string())),
        ];
        let histogram = metrics::histogram!("wavelume_http_request_duration_seconds", &labels);
        histogram.record(seconds);
        self.known.write().unwrap_or_else(PoisonError::into_inner).insert(key, histogram);
    }
}

/// Returns the only metrics recorder of the process; the first call installs it.
pub(super) fn recorder() -> Option<PrometheusHandle> {
    static RECORDER: OnceLock<Option<PrometheusHandle>> = OnceLock::new();
    let install = || {
        let installed = PrometheusBuilder::new().set_buckets(&SECONDS).and_then(PrometheusBuilder::install_recorder);
        let handle = match installed {
            Ok(handle) => handle,
            Err(error) => {
                tracing::error!(%error, "this process records no metrics");
                return None;
            }
        };
        for name in COUNTERS {
            metrics::counter!(name).increment(0);
        }
        for state in ENDS {
            metrics::counter!("wavelume_job_attempts_total", "state" => state).increment(0);
        }
        for kind in FAULTS {
            metrics::counter!("wavelume_scrub_faults_total", "kind" => kind).increment(0);
        }
        Some(handle)
    };
    RECORDER.get_or_init(install).clone()
}

/// Builds the HTTP answer that shows the metrics of the process as text; empty if the process records no metrics.
pub(super) fn page(recorder: Option<&PrometheusHandle>) -> Response {
    let text = recorder.map(|recorder| {
        recorder.run_upkeep();
        recorder.render()
    });
    let kind = HeaderValue::from_static("text/plain; version=0.0.4; charset=utf-8");
    ([(header::CONTENT_TYPE, kind)], text.unwrap_or_default()).into_response()
}

/// Merges the recorded durations into the histograms of the metrics every 5 s. Until then every duration is kept in
/// memory.
pub(super) async fn keep_up(metrics: PrometheusHandle) {
    loop {
        tokio::time::sleep(Duration::from_secs(5)).await;
        metrics.run_upkeep();
    }
}

/// Serves `/metrics` and `/healthz` of this process over HTTP, until the returned handle is dropped. Also returns the
/// bound address with its real port.
pub(crate) async fn show_figures(listen: SocketAddr) -> std::io::Result<(SocketAddr, AbortOnDropHandle<()>)> {
    let listener = TcpListener::bind(listen).await?;
    let address = listener.local_addr()?;
    let recorder = recorder();
    let shown = recorder.clone();
    let metrics = move || async move { page(shown.as_ref()) };
    let router = Router::new().route("/metrics", get(metrics)).route("/healthz", get(|| async { "ok\n" }));
    let serving = tokio::spawn(async move {
        let serving = async {
            if let Err(error) = axum::serve(listener, router).await {
                tracing::error!(%error, "the server of the metrics has failed: /metrics is not served any more");
            }
        };
        // Durations must not pile up while nobody asks for them.
        match recorder {
            Some(recorder) => drop(tokio::join!(serving, keep_up(recorder))),
            None => serving.await,
        }
    });
    Ok((address, AbortOnDropHandle::new(serving)))
}
