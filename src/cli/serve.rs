//! `wavelume serve`: the service, until a signal asks it to drain.

use super::failure::Failure;
use super::isolate::IsolateArgs;
use super::listen::Listen;
use super::output::print;
use super::runtime::{block_on, stop_signal};
use super::settings::Settings;
use super::site::SiteArgs;
use super::tls::TlsArgs;
use crate::api::{AuthMode, BootstrapKey, NotAKey, ServeConfig, ServeError, Server, raise_descriptor_limit};
use std::io::ErrorKind;

/// Command-line options of the HTTP service, with all its limits.
#[derive(Debug, clap::Args)]
#[command(after_help = "`--help` lists every limit; docs/settings.md has them as a table. With keys, the environment \
                        variable WAVELUME_BOOTSTRAP_KEY gives the first one, which `wavelume keys generate` prints")]
pub(crate) struct Args {
    #[command(flatten)]
    site: Place,
    #[command(flatten)]
    tls: TlsArgs,
    #[command(flatten)]
    isolation: IsolateArgs,
    #[command(flatten)]
    settings: Settings,
}

/// Data directory, address, accepted host names and rule of access of a service.
#[derive(Debug, clap::Args)]
#[group(id = "service")]
pub(crate) struct Place {
    #[command(flatten)]
    pub(crate) data: SiteArgs,
    #[command(flatten)]
    pub(crate) reach: ReachArgs,
    #[command(flatten)]
    pub(crate) access: AccessArgs,
}

/// Options for the rule by which a service decides who may use it.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Access")]
pub(crate) struct AccessArgs {
    /// Rule for who may use the service: `off` everybody, on a loopback address or with --insecure; `keys` holders of a
    /// key; `keys+anonymous-read` also anybody who only reads public materials
    #[arg(long, value_name = "MODE", value_enum, default_value_t, env = "WAVELUME_AUTH", hide_env_values = true)]
    pub(crate) auth: Auth,
    /// Run without keys on an address that other machines reach, and behind a proxy that decides who may ask
    #[arg(long)]
    pub(crate) insecure: bool,
}

/// Rule by which a service decides who may use it, as an option names it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Auth {
    #[default]
    Off,
    Keys,
    #[value(name = "keys+anonymous-read")]
    KeysAndAnonymousRead,
}

/// Environment variable with the text of the first key of a service.
const BOOTSTRAP_KEY: &str = "WAVELUME_BOOTSTRAP_KEY";

/// Options for the address of a service and for the names and pages that may reach it.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Server")]
pub(crate) struct ReachArgs {
    /// Address to listen on, `IP:PORT` or `NAME:PORT`; port 0 takes a free one
    #[arg(long, value_name = "ADDR", default_value = DEFAULT_LISTEN, env = "WAVELUME_LISTEN", hide_env_values = true)]
    pub(crate) listen: Listen,
    /// Further host name that requests may address, besides localhost and loopback addresses, and IP addresses where
    /// the service listens on one other than loopback; may be repeated
    #[arg(long = "name", value_name = "HOST", env = "WAVELUME_NAMES", value_delimiter = ',', hide_env_values = true)]
    pub(crate) names: Vec<String>,
    /// Web origin whose pages may read from the service (CORS): `SCHEME://HOST` or `SCHEME://HOST:PORT`; may be
    /// repeated
    #[arg(
        long = "origin",
        value_name = "ORIGIN",
        env = "WAVELUME_ORIGINS",
        value_delimiter = ',',
        hide_env_values = true
    )]
    pub(crate) origins: Vec<String>,
}

/// Default address that the service listens on and that `health` asks.
pub(crate) const DEFAULT_LISTEN: &str = "127.0.0.1:8080";

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    block_on(async {
        let stop = stop_signal()?;
        let mut config = args.site.config().await?;
        config.bootstrap_key = bootstrap_key()?;
        config.tls = args.tls.files()?;
        config.work.isolate = args.isolation.program()?;
        args.settings.apply(&mut config.work);
        let server = bind(config).await?;
        print(&format!("listening on {}\n", server.url()))?;
        server.run(stop).await.map_err(Failure::failed)
    })
}

impl Place {
    /// Builds the configuration of a service with the default limits. Fails if the name of the host to listen on has no
    /// address.
    pub(crate) async fn config(&self) -> Result<ServeConfig, Failure> {
        let mut config = ServeConfig::new(&self.data.places.directory, self.reach.listen.address().await?);
        config.work.site = self.data.site();
        config.names.clone_from(&self.reach.names);
        config.origins.clone_from(&self.reach.origins);
        config.auth = match self.access.auth {
            Auth::Off => AuthMode::Off,
            Auth::Keys => AuthMode::Keys,
            Auth::KeysAndAnonymousRead => AuthMode::KeysAndAnonymousRead,
        };
        config.insecure = self.access.insecure;
        Ok(config)
    }
}

/// Returns the first key of the service, if the environment has one. An error does not show its text.
fn bootstrap_key() -> Result<Option<BootstrapKey>, Failure> {
    let Some(text) = std::env::var_os(BOOTSTRAP_KEY).filter(|text| !text.is_empty()) else { return Ok(None) };
    let key =
        text.to_string_lossy().parse().map_err(|error: NotAKey| Failure::usage(format!("{BOOTSTRAP_KEY}: {error}")));
    key.map(Some)
}

/// Opens the data directory of a service and binds its address.
pub(crate) async fn bind(config: ServeConfig) -> Result<Server, Failure> {
    raise_descriptor_limit();
    Server::bind(config).await.map_err(|error| match &error {
        ServeError::Setting(_) | ServeError::Unguarded { .. } => Failure::usage(error),
        ServeError::Listen { address, source } if source.kind() == ErrorKind::AddrInUse => {
            Failure::failed(format!("{address} is already taken; choose another address with --listen ADDR"))
        }
        _ => Failure::failed(error),
    })
}
