//! `wavelume move`: copies a service to another database and store.

use super::backup::show;
use super::failure::Failure;
use super::runtime::block_on;
use super::site::PlaceArgs;
use crate::jobs::{Archive, Database, Place, Site};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Stop the nodes and workers of the original first. It is only read, and stays as it is. A killed \
                        move goes on when it is started again"
)]
pub(crate) struct Args {
    /// Data directory of the original
    #[arg(long, value_name = "DIR", required_unless_present_all = ["from_database", "from_store"])]
    from_data: Option<PathBuf>,
    /// Database of the original: `sqlite:FILE` or `postgres://USER@HOST/NAME`; by default catalog.sqlite in its data
    /// directory
    #[arg(long, value_name = "URL")]
    from_database: Option<Database>,
    /// Store of the original: `dir:DIR` or `s3://BUCKET/PREFIX`; by default its data directory
    #[arg(long, value_name = "URL")]
    from_store: Option<Place>,
    #[command(flatten)]
    places: PlaceArgs,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let to = args.places.site();
    let from = Site {
        // Staged files are the only thing that lies there.
        data: args.from_data.clone().unwrap_or_else(|| to.data.clone()),
        database: args.from_database.clone(),
        store: args.from_store.clone(),
        adopt: None,
    };
    let report = block_on(async {
        let original = Archive::look_after(&from).await.map_err(Failure::failed)?;
        original.relocate(&to).await.map_err(Failure::failed)
    })?;
    let more = format!("; the new catalog is {}", report.instance);
    show(&report, &report.files, report.rows, &more, args.json)
}
