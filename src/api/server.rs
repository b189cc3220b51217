//! Listening, serving, draining.

use super::content::Contents;
use super::patient::Patient;
use super::state::App;
use crate::jobs::{ArchiveError, Engine, WorkConfig, run_workers};
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use metrics_exporter_prometheus::{PrometheusBuilder, PrometheusHandle};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use tokio_util::task::AbortOnDropHandle;

/// Connections at the same time; more wait in the system's queue.
const CONNECTIONS: usize = 2048;

/// The largest JSON bodies that are in memory at the same time.
const BODIES: usize = 8;

/// How to serve; `ServeConfig::new(data, listen)` has a default for everything else.
#[derive(Clone, Debug)]
pub struct ServeConfig {
    /// The address to listen on; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Data directory, threads, workers and limits.
    pub work: WorkConfig,
}

impl ServeConfig {
    /// Defaults for everything but where the data are and where to listen.
    pub fn new(data: impl Into<PathBuf>, listen: SocketAddr) -> Self {
        Self { listen, work: WorkConfig::new(data) }
    }
}

/// Why the service did not start or ended badly.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {source}; choose another with --listen ADDR")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the system said.
        source: std::io::Error,
    },
    /// The data directory cannot be used.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
}

/// A service that has its address and its data, and does not answer yet.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    listener: TcpListener,
    engine: Arc<Engine>,
    workers: usize,
}

impl Server {
    /// Takes the address and opens the data directory.
    pub async fn bind(config: ServeConfig) -> Result<Self, ServeError> {
        let taken = |source| ServeError::Listen { address: config.listen, source };
        let listener = TcpListener::bind(config.listen).await.map_err(taken)?;
        let address = listener.local_addr().map_err(taken)?;
        let engine = Engine::open(&config.work).await?;
        Ok(Self { address, listener, engine, workers: config.work.workers })
    }

    /// The address taken, with its real port.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers until `shutdown`, then lets running requests and jobs end within the drain time.
    pub async fn run(self, shutdown: impl Future<Output = ()> + Send + 'static) -> Result<(), ServeError> {
        let Self { address, listener, engine, workers } = self;
        let stop = CancellationToken::new();
        let json = super::openapi().to_json().unwrap_or_default();
        let app = App {
            uploads: Arc::new(Semaphore::new(engine.limits.uploads)),
            bodies: Arc::new(Semaphore::new((BODIES * engine.limits.json_bytes) >> 10)),
            streams: Arc::new(Semaphore::new(engine.limits.streams)),
            exports: Arc::new(Semaphore::new(engine.limits.exports)),
            contents: Contents::new(engine.limits.content_bytes),
            engine: Arc::clone(&engine),
            stop: stop.clone(),
            metrics: metrics(),
            openapi: json.into(),
        };
        tracing::info!(%address, data = %engine.archive.data.display(), workers, "serving");
        let working = tokio::spawn({
            let (engine, stop) = (Arc::clone(&engine), stop.clone());
            async move { run_workers(&engine, workers, &stop).await }
        });
        let figures = app.metrics.clone().map(|metrics| AbortOnDropHandle::new(tokio::spawn(keep_up(metrics))));
        let connections = accept(&listener, app, &stop, shutdown).await;
        drop(listener);
        tracing::info!("stopping: running requests and jobs may end");
        // The workers have a drain time of their own.
        let drained = tokio::time::timeout(engine.limits.drain, connections.shutdown()).await;
        if drained.is_err() {
            tracing::warn!("connections were cut after the drain time");
        }
        if let Err(error) = working.await {
            tracing::error!(%error, "the workers ended badly");
        }
        drop(figures);
        engine.archive.catalog.close().await;
        tracing::info!("stopped");
        Ok(())
    }
}

/// Binds and runs.
pub async fn serve(config: ServeConfig, shutdown: impl Future<Output = ()> + Send + 'static) -> Result<(), ServeError> {
    Server::bind(config).await?.run(shutdown).await
}

async fn accept(
    listener: &TcpListener,
    app: App,
    stop: &CancellationToken,
    shutdown: impl Future<Output = ()>,
) -> GracefulShutdown {
    let mut builder = Builder::new(TokioExecutor::new());
    builder.http1().timer(TokioTimer::new()).header_read_timeout(app.engine.limits.idle);
    builder
        .http2()
        .timer(TokioTimer::new())
        .max_concurrent_streams(128)
        .keep_alive_interval(app.engine.limits.idle)
        .keep_alive_timeout(app.engine.limits.idle);
    let patience = app.engine.limits.idle;
    let service = super::router(app);
    let connections = GracefulShutdown::new();
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    tokio::pin!(shutdown);
    loop {
        let accepted = async {
            let place = Arc::clone(&places).acquire_owned().await;
            (place, listener.accept().await)
        };
        let (place, accepted) = tokio::select! {
            () = &mut shutdown => break,
            accepted = accepted => accepted,
        };
        let stream = match accepted {
            Ok((stream, _)) => stream,
            Err(error) => {
                // Out of descriptors, or the peer is gone already: neither ends the service.
                tracing::warn!(%error, "a connection was not accepted");
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            }
        };
        // Small answers must not wait for more to come; a socket that cannot say so works all the same.
        let _ = stream.set_nodelay(true);
        let stream = Patient::new(stream, patience);
        let connection =
            builder.serve_connection(TokioIo::new(stream), TowerToHyperService::new(service.clone())).into_owned();
        let connection = connections.watch(connection);
        tokio::spawn(async move {
            let _place = place;
            if let Err(error) = connection.await {
                tracing::debug!(%error, "a connection ended early");
            }
        });
    }
    stop.cancel();
    connections
}

/// Histograms keep every duration until somebody folds them.
async fn keep_up(metrics: PrometheusHandle) {
    loop {
        tokio::time::sleep(Duration::from_secs(5)).await;
        metrics.run_upkeep();
    }
}

/// The process has one recorder of metrics; the first service installs it.
fn metrics() -> Option<PrometheusHandle> {
    static RECORDER: OnceLock<Option<PrometheusHandle>> = OnceLock::new();
    RECORDER.get_or_init(|| PrometheusBuilder::new().install_recorder().ok()).clone()
}
