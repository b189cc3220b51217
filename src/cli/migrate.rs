//! `wavelume migrate`: brings the catalog of a data directory up to date.

use super::failure::Failure;
use super::output::print;
use super::runtime::block_on;
use super::serve::DataArgs;
use crate::jobs::Archive;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    data: DataArgs,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let applied = block_on(async { Archive::migrate(&args.data.directory).await.map_err(Failure::failed) })?;
    match applied {
        0 => print("up to date\n"),
        1 => print("1 migration applied\n"),
        n => print(&format!("{n} migrations applied\n")),
    }
}
