//! `wavelume backup`: copies the catalog and the stored bytes of a running service to another place.

use super::failure::Failure;
use super::output::{count, print, print_json};
use super::runtime::block_on;
use super::site::SiteArgs;
use crate::jobs::{Archive, Place, Tally};
use serde::Serialize;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Directory or `s3://BUCKET/PREFIX` for the backup; what an earlier backup has left there is not copied again
    #[arg(value_name = "DEST", value_parser = place)]
    dest: Place,
    #[command(flatten)]
    site: SiteArgs,
    /// Compute the digest of each file that an earlier backup has left, and copy damaged ones again
    #[arg(long)]
    check: bool,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let report = block_on(async {
        let archive = Archive::look_after(&args.site.site()).await.map_err(Failure::failed)?;
        let report = archive.backup(&args.dest, args.check).await;
        archive.catalog.close().await;
        report.map_err(Failure::failed)
    })?;
    show(&report, &report.files, report.rows, "", args.json)
}

/// Reads the place of a backup: the path of a directory, `dir:DIR` or `s3://BUCKET/PREFIX`.
pub(crate) fn place(text: &str) -> Result<Place, String> {
    if text.starts_with("s3://") || text.starts_with("dir:") {
        return text.parse::<Place>().map_err(|error| error.to_string());
    }
    if text.is_empty() || text.contains("://") {
        return Err("expected a directory or s3://BUCKET/PREFIX".to_owned());
    }
    Ok(Place::Directory(text.into()))
}

/// Prints a report on copied rows and files. Fails if files are missing or damaged, after all others were copied.
pub(crate) fn show(report: &impl Serialize, files: &Tally, rows: u64, more: &str, json: bool) -> Result<(), Failure> {
    if json {
        print_json(report)?;
    } else {
        let lost = files.lost.iter().map(|lost| format!("{:<10} {}\n", lost.kind, lost.digest));
        print(&format!(
            "{}copied {} rows and {} files ({} bytes); {} files ({} bytes) were there; {} are missing or damaged{more}\n",
            lost.collect::<String>(),
            count(rows),
            count(files.copied_blobs),
            count(files.copied_bytes),
            count(files.there_blobs),
            count(files.there_bytes),
            count(files.lost.len() as u64),
        ))?;
    }
    match files.lost.len() {
        0 => Ok(()),
        n => Err(Failure::failed(format!(
            "{n} stored files are missing or damaged, all others are copied: upload the same files again, or repeat their \
             jobs"
        ))),
    }
}
