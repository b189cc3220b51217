//! `wavelume serve`: the service, until a signal asks it to drain.

use super::failure::Failure;
use super::output::print;
use super::runtime::{block_on, stop_signal};
use crate::api::{ServeConfig, ServeError, Server};
use std::io::ErrorKind;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Where the data are and where to listen.
#[derive(Debug, clap::Args)]
#[group(id = "service")]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) data: DataArgs,
    /// The address to listen on; port 0 takes a free one
    #[arg(long, value_name = "ADDR", default_value = DEFAULT_LISTEN)]
    pub(crate) listen: SocketAddr,
}

/// The data directory.
#[derive(Debug, clap::Args)]
pub(crate) struct DataArgs {
    /// The data directory; made where it is missing
    #[arg(long = "data", value_name = "DIR", default_value = "./wavelume-data")]
    pub(crate) directory: PathBuf,
}

/// Where the service listens and `health` asks, where nothing is said.
pub(crate) const DEFAULT_LISTEN: &str = "127.0.0.1:8080";

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    block_on(async {
        let stop = stop_signal()?;
        let server = bind(args).await?;
        print(&format!("listening on http://{}\n", server.address()))?;
        server.run(stop).await.map_err(Failure::failed)
    })
}

/// Opens the data directory and takes the address.
pub(crate) async fn bind(args: &Args) -> Result<Server, Failure> {
    Server::bind(ServeConfig::new(&args.data.directory, args.listen)).await.map_err(|error| match &error {
        ServeError::Listen { address, source } if source.kind() == ErrorKind::AddrInUse => {
            Failure::failed(format!("{address} is already taken; choose another address with --listen ADDR"))
        }
        _ => Failure::failed(error),
    })
}
