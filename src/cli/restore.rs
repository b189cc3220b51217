//! `wavelume restore`: fills an empty service with a backup.

use super::backup::{place, show};
use super::failure::Failure;
use super::runtime::block_on;
use super::site::PlaceArgs;
use crate::jobs::{Archive, Place};

#[derive(Debug, clap::Args)]
#[command(after_help = "A killed restore goes on when it is started again. SRC is only read")]
pub(crate) struct Args {
    /// Directory or `s3://BUCKET/PREFIX` with a backup
    #[arg(value_name = "SRC", value_parser = place)]
    source: Place,
    #[command(flatten)]
    places: PlaceArgs,
    /// End the restore although files of the backup are missing or damaged; the next upload of the same bytes replaces
    /// them
    #[arg(long)]
    accept_lost: bool,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let site = args.places.site();
    let restored = Archive::restore(&site, &args.source, args.accept_lost);
    let report = block_on(async { restored.await.map_err(Failure::failed) })?;
    let more = format!("; the new catalog is {}", report.instance);
    show(&report, &report.files, report.rows, &more, args.json)
}
