//! `wavelume gc`: removes unreferenced blobs and stale staging files of a data directory.

use super::failure::Failure;
use super::fsck::open_existing;
use super::output::{count, print, print_json};
use super::runtime::block_on;
use super::serve::DataArgs;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    data: DataArgs,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let report = block_on(async { open_existing(&args.data.directory).await?.sweep().await.map_err(Failure::failed) })?;
    if args.json {
        return print_json(&report);
    }
    print(&format!(
        "removed {} blobs ({} bytes) and {} staging files, kept {} blobs\n",
        count(report.removed_blobs),
        count(report.removed_bytes),
        count(report.removed_staging),
        count(report.kept_blobs)
    ))
}
