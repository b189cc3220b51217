//! Listening, serving, draining.

use super::access::Access;
use super::connection::{Entrance, Host};
use super::content_cache::Contents;
use super::descriptors;
use super::figures::{Durations, keep_up, recorder};
use super::first_key::{self, BootstrapKey, FirstKeyError};
use super::front::Front;
use super::guard::{AuthMode, Guard};
use super::places::Peer;
use super::rates::Rates;
use super::remembered::Remembered;
use super::router::openapi_json;
use super::state::{App, Held, Shared};
use super::tls::{Current, Handshake, TlsFiles};
use crate::jobs::{ArchiveError, Engine, Site, WorkConfig, run_workers, watch_jobs};
use crate::trust::Scopes;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tokio_util::task::{AbortOnDropHandle, TaskTracker};

/// Shortest time between two log lines about connections that the operating system failed to accept. Raising it
/// shortens the log of an overload.
const COMPLAINT: Duration = Duration::from_secs(10);

/// Time after the drain time for which the service waits until the bytes of resumable uploads that have come are
/// stored. Raising it loses fewer of them with a slow store, and delays the end of the service where the store stays
/// away.
const STORING: Duration = Duration::from_secs(30);

/// Configuration of a service; [`ServeConfig::new`] has defaults for everything but data directory and address.
#[derive(Clone, Debug)]
pub struct ServeConfig {
    /// Socket address to listen on; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Host names that requests may use to address the service, in addition to loopback names and, if it listens on
    /// another address than loopback, IP addresses.
    pub names: Vec<String>,
    /// Web origins (`https://app.example.org`) whose pages may read answers and send queries; pages of other origins
    /// may not.
    pub origins: Vec<String>,
    /// Rule by which the service decides who may use it.
    pub auth: AuthMode,
    /// Permission to run without keys on an address that other machines reach, or behind a proxy.
    pub insecure: bool,
    /// Text of a key that is stored with all scopes when the service starts for the first time; ignored once there is a
    /// key, and without keys.
    pub bootstrap_key: Option<BootstrapKey>,
    /// Files of the certificate with which connections are encrypted (TLS); `None` serves plain HTTP.
    pub tls: Option<TlsFiles>,
    /// Configuration of stored data and of work: data directory, threads, workers and limits.
    pub work: WorkConfig,
}

impl ServeConfig {
    /// Builds a configuration with defaults for everything but the data directory and the address.
    pub fn new(data: impl Into<PathBuf>, listen: SocketAddr) -> Self {
        Self {
            listen,
            names: Vec::new(),
            origins: Vec::new(),
            auth: AuthMode::Off,
            insecure: false,
            bootstrap_key: None,
            tls: None,
            work: WorkConfig::new(data),
        }
    }
}

/// Failure to start the HTTP service, or to end it properly.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The service cannot listen on the configured address.
    #[error("cannot listen on {address}: {source}; choose another with --listen ADDR")]
    Listen {
        /// Socket address that the service tried to listen on.
        address: SocketAddr,
        /// Error of the operating system on binding the socket.
        source: std::io::Error,
    },
    /// A host name or an origin in the configuration is invalid.
    #[error("a host name or an origin in the settings is invalid: {0}")]
    Setting(String),
    /// The service has no keys and listens on an address that other machines reach, so that everybody could read, write
    /// and delete.
    #[error(
        "on {address} everybody who reaches this machine could read, write and delete, because the service runs without \
         keys: make a key with `wavelume keys create{place} --name admin --scopes {scopes}` and start with `wavelume \
         serve{place} --listen {address} --auth keys`, with --tls-cert and --tls-key unless a proxy encrypts the way to \
         it; --insecure starts without keys all the same",
        scopes = Scopes::all()
    )]
    Unguarded {
        /// Socket address on which the service was to listen.
        address: SocketAddr,
        /// Command-line options that name the database and the data directory of the service, each after a space.
        place: String,
    },
    /// The first access key, given by whoever starts the service, cannot be stored.
    #[error("the first key cannot be stored: {0}; make another one with `wavelume keys generate`")]
    FirstKey(String),
    /// The TLS certificate of the service or its private key cannot be used.
    #[error("the certificate cannot be used: {0}")]
    Certificate(String),
    /// The data directory cannot be used.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
}

impl From<FirstKeyError> for ServeError {
    fn from(error: FirstKeyError) -> Self {
        match error {
            FirstKeyError::Signer(error) => Self::FirstKey(error.to_string()),
            FirstKeyError::Catalog(error) => Self::Archive(error.into()),
        }
    }
}

/// Way to stop the HTTP service: after a notice period or at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// After a request to stop, the service still accepts connections for a notice period, during which `/readyz`
    /// reports *stopping*.
    Announced,
    /// After a request to stop, the service stops accepting connections at once, without a notice period.
    AtOnce,
}

/// Conversion of a shutdown signal without a value into [`Stop::AtOnce`]: the service then stops without a notice
/// period.
impl From<()> for Stop {
    fn from((): ()) -> Self {
        Self::AtOnce
    }
}

/// An HTTP service that has bound its address and opened its data directory but does not answer yet.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    listener: TcpListener,
    access: Arc<Access>,
    guard: Arc<Guard>,
    certificate: Option<Arc<Current>>,
    engine: Arc<Engine>,
    workers: usize,
}

impl Server {
    /// Binds the address and opens the data directory.
    pub async fn bind(mut config: ServeConfig) -> Result<Self, ServeError> {
        if config.auth == AuthMode::Off && !config.insecure && !is_local(config.listen) {
            return Err(ServeError::Unguarded { address: config.listen, place: place(&config.work.site) });
        }
        // Metrics of what follows would be lost without it.
        recorder();
        let certificate = config.tls.map(|files| Current::open(files).map(Arc::new)).transpose();
        let certificate = certificate.map_err(ServeError::Certificate)?;
        let taken = |source| ServeError::Listen { address: config.listen, source };
        let listener = TcpListener::bind(config.listen).await.map_err(taken)?;
        let address = listener.local_addr().map_err(taken)?;
        let access =
            Access::new(address, certificate.is_some(), &config.names, &config.origins).map_err(ServeError::Setting)?;
        if let Some(descriptors) = descriptors::limit() {
            descriptors::fit(&mut config.work.limits, descriptors);
        }
        // Without keys there is one tenant, and clients are told apart by their addresses.
        config.work.by_tenant = config.auth != AuthMode::Off;
        let engine = Engine::open(&config.work).await?;
        let guard = Guard::new(config.auth, config.insecure, &engine.limits);
        if let Some(key) = config.bootstrap_key.filter(|_| config.auth != AuthMode::Off) {
            first_key::store(&engine, &key).await?;
        }
        let workers = config.work.workers;
        Ok(Self { address, listener, access: Arc::new(access), guard, certificate, engine, workers })
    }

    /// Returns the socket address that the service is bound to, with the port actually in use.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns the address (URL) at which the service answers: `https://127.0.0.1:8443`.
    pub fn url(&self) -> String {
        let scheme = if self.certificate.is_some() { "https" } else { "http" };
        format!("{scheme}://{}", self.address)
    }

    /// Serves until `shutdown` resolves and its notice period is over. Running requests and jobs may then end within
    /// the drain time of the configuration.
    pub async fn run<S: Into<Stop>>(
        self,
        shutdown: impl Future<Output = S> + Send + 'static,
    ) -> Result<(), ServeError> {
        let Self { address, listener, access, guard, certificate, engine, workers } = self;
        let handshake = certificate.clone().map(Handshake::new).transpose();
        let handshake = handshake.map_err(|error| ServeError::Certificate(error.to_string()))?;
        let (stopping, stop, cut) = (CancellationToken::new(), CancellationToken::new(), CancellationToken::new());
        let (limits, writing) = (&engine.limits, TaskTracker::new());
        let shared = Shared {
            held: Held::new(limits),
            rates: Rates::new(),
            contents: Contents::new(limits.content_bytes),
            remembered: Remembered::new(),
            access,
            guard: Arc::clone(&guard),
            stopping: stopping.clone(),
            stop: stop.clone(),
            writing: writing.clone(),
            durations: Durations::default(),
            metrics: recorder(),
            openapi: openapi_json,
        };
        let app = App::new(Arc::clone(&engine), shared);
        let (database, store) = engine.archive.places();
        let (auth, insecure) = (guard.mode, guard.is_insecure);
        tracing::info!(%address, %database, %store, workers, %auth, "serving");
        if insecure && auth == AuthMode::Off {
            tracing::warn!(%address, "whoever reaches this address may read, write and delete everything");
        }
        if auth != AuthMode::Off && certificate.is_none() && !is_local(address) {
            tracing::warn!(
                %address,
                "keys travel readable: give --tls-cert and --tls-key, or let only a proxy that ends TLS reach this address"
            );
        }
        let working = tokio::spawn({
            let (engine, stopping) = (Arc::clone(&engine), stopping.clone());
            async move { run_workers(&engine, workers, &stopping).await }
        });
        let watching = AbortOnDropHandle::new(tokio::spawn(watch_jobs(Arc::clone(&engine), stop.clone())));
        let figures = app.metrics.clone().map(|metrics| AbortOnDropHandle::new(tokio::spawn(keep_up(metrics))));
        let renewing = certificate.map(|certificate| AbortOnDropHandle::new(tokio::spawn(certificate.keep_up())));
        let notice = limits.notice;
        let closing = async move {
            let how: Stop = shutdown.await.into();
            stopping.cancel();
            if how == Stop::Announced && !notice.is_zero() {
                tracing::info!(?notice, "stopping: the listener stays open for the notice time");
                tokio::time::sleep(notice).await;
            }
        };
        let host = Host::new(Front::new(app), limits, handshake, stop.clone(), cut.clone());
        let connections = accept(&listener, &host, &Entrance::new(limits), closing).await;
        drop(listener);
        tracing::info!("stopping: running requests and jobs may end");
        stop.cancel();
        // The workers have a drain time of their own.
        if tokio::time::timeout(limits.drain, connections.wait()).await.is_err() {
            tracing::warn!("connections were cut after the drain time");
            cut.cancel();
            connections.wait().await;
        }
        writing.close();
        if tokio::time::timeout(STORING, writing.wait()).await.is_err() {
            tracing::warn!("bytes of resumable uploads were not stored in time: their clients send them again");
        }
        if let Err(error) = working.await {
            tracing::error!(%error, "the task that runs the workers failed");
        }
        drop((figures, watching, renewing));
        engine.archive.catalog.close().await;
        tracing::info!("stopped");
        Ok(())
    }
}

/// Returns true if only programs on this machine reach the address.
fn is_local(address: SocketAddr) -> bool {
    address.ip().to_canonical().is_loopback()
}

/// Returns the options with which another command finds the database of a service, each after a space.
fn place(site: &Site) -> String {
    match &site.database {
        Some(database) => format!(" --database {database}"),
        None => format!(" --data {}", site.data.display()),
    }
}

/// Binds an HTTP service with this configuration, and runs it until it is stopped.
pub async fn serve<S: Into<Stop>>(
    config: ServeConfig,
    shutdown: impl Future<Output = S> + Send + 'static,
) -> Result<(), ServeError> {
    Server::bind(config).await?.run(shutdown).await
}

/// Accepts connections until `closing` resolves, and serves each in a task of the returned tracker. Never waits for a
/// free connection slot: a connection waiting in the system's queue would block health checks.
async fn accept(
    listener: &TcpListener,
    host: &Arc<Host>,
    entrance: &Entrance,
    closing: impl Future<Output = ()>,
) -> TaskTracker {
    let connections = TaskTracker::new();
    let mut complained: Option<Instant> = None;
    tokio::pin!(closing);
    loop {
        let accepted = tokio::select! {
            () = &mut closing => break,
            accepted = listener.accept() => accepted,
        };
        let (stream, address) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                // Out of descriptors, or the client has left: neither ends the service.
                if complained.is_none_or(|last| last.elapsed() >= COMPLAINT) {
                    complained = Some(Instant::now());
                    tracing::warn!(%error, "a connection was not accepted");
                }
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            }
        };
        let peer = Peer::of(address.ip());
        let Some(admission) = entrance.admit(peer) else {
            tracing::debug!(%peer, "a connection was closed: its address has as many as are allowed");
            continue;
        };
        // Sends small answers at once; a socket without this option still works.
        let _ = stream.set_nodelay(true);
        connections.spawn(Arc::clone(host).serve(stream, peer, admission));
    }
    connections.close();
    connections
}
