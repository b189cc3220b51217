//! `wavelume migrate`: brings the schema of the catalog up to date.

use super::failure::Failure;
use super::output::print;
use super::runtime::block_on;
use super::site::SiteArgs;
use crate::jobs::Archive;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    site: SiteArgs,
    /// Migrate a PostgreSQL database that holds rows even if the migration cannot be undone. On SQLite a copy of the
    /// catalog is kept instead
    #[arg(long)]
    i_have_a_backup: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let migrated = async { Archive::migrate(&args.site.site(), args.i_have_a_backup).await.map_err(Failure::failed) };
    match block_on(migrated)? {
        0 => print("up to date\n"),
        1 => print("1 migration applied\n"),
        n => print(&format!("{n} migrations applied\n")),
    }
}
