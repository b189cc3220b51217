//! `wavelume fsck`: recomputes every digest of a data directory and looks for every blob that a row names.

use super::failure::Failure;
use super::output::{count, print, print_json};
use super::runtime::block_on;
use super::serve::DataArgs;
use crate::jobs::{Archive, Fault};
use std::path::Path;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    data: DataArgs,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let report = block_on(async { open_existing(&args.data.directory).await?.check().await.map_err(Failure::failed) })?;
    if args.json {
        print_json(&report)?;
    } else {
        let mut lines =
            vec![format!("checked {} blobs, {} bytes\n", count(report.checked_blobs), count(report.checked_bytes))];
        lines.extend(report.faults.iter().map(|fault| match fault {
            Fault::Corrupt { digest } => format!("corrupt  {digest}\n"),
            Fault::Missing { digest, named_by } => format!("missing  {digest}, named by {named_by}\n"),
        }));
        print(&lines.concat())?;
    }
    match report.faults.len() {
        0 => Ok(()),
        1 => Err(Failure::failed("1 fault found")),
        n => Err(Failure::failed(format!("{n} faults found"))),
    }
}

/// Opens an existing data directory. A missing one is refused, because it is most likely a typing mistake.
pub(crate) async fn open_existing(directory: &Path) -> Result<Archive, Failure> {
    if !directory.is_dir() {
        return Err(Failure::failed("no such data directory").about(directory));
    }
    Archive::open(directory).await.map_err(Failure::failed)
}
