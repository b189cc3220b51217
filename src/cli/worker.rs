//! `wavelume worker`: runs jobs without serving HTTP, until a signal asks it to stop.

use super::failure::Failure;
use super::isolate::IsolateArgs;
use super::output::print;
use super::runtime::{block_on, stop_signal};
use super::settings::WorkSettings;
use super::site::SiteArgs;
use crate::api::show_figures;
use crate::jobs::{WorkConfig, work};
use std::net::SocketAddr;
use tokio_util::sync::CancellationToken;

/// Options of a worker.
#[derive(Debug, clap::Args)]
#[command(after_help = "SIGTERM ends it: it claims no further job, and running ones get the time of --drain to end")]
pub(crate) struct Args {
    #[command(flatten)]
    site: SiteArgs,
    #[command(flatten)]
    figures: MetricsArg,
    #[command(flatten)]
    isolation: IsolateArgs,
    #[command(flatten)]
    settings: WorkSettings,
}

/// Option for the address of a worker's metrics.
#[derive(Debug, clap::Args)]
pub(crate) struct MetricsArg {
    /// Address on which a worker serves its metrics (`/metrics`) and a sign of life (`/healthz`); none by default
    #[arg(long, value_name = "ADDR", env = "WAVELUME_METRICS", hide_env_values = true, help_heading = "Work")]
    metrics: Option<SocketAddr>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    block_on(async {
        let signal = stop_signal()?;
        let mut config = WorkConfig::new(&args.site.places.directory);
        config.site = args.site.site();
        config.isolate = args.isolation.program()?;
        args.settings.apply(&mut config);
        let figures = match args.figures.metrics {
            Some(address) => {
                Some(show_figures(address).await.map_err(|error| Failure::failed(format!("{address}: {error}")))?)
            }
            None => None,
        };
        if let Some((address, _)) = &figures {
            print(&format!("metrics at http://{address}/metrics\n"))?;
        }
        let stop = CancellationToken::new();
        tokio::spawn({
            let stop = stop.clone();
            async move {
                signal.await;
                stop.cancel();
            }
        });
        let workers = config.workers;
        work(&config, &stop, |place| print(&format!("working on {place}, {workers} at a time\n")))
            .await
            .map_err(Failure::failed)
    })
}
