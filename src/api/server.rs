//! Listening, serving, draining.

use crate::jobs::{ArchiveError, WorkConfig};
use std::net::SocketAddr;
use std::path::PathBuf;

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
}

impl Server {
    /// Opens the data directory and takes the address.
    pub async fn bind(config: ServeConfig) -> Result<Self, ServeError> {
        let _ = config;
        unimplemented!()
    }

    /// The address taken, with its real port.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers until `shutdown`, then drains.
    pub async fn run(self, shutdown: impl Future<Output = ()> + Send + 'static) -> Result<(), ServeError> {
        let _ = shutdown;
        unimplemented!()
    }
}

/// Binds and runs.
pub async fn serve(
    config: ServeConfig,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> Result<(), ServeError> {
    Server::bind(config).await?.run(shutdown).await
}
