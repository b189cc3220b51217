//! `wavelume fsck`: computes the digest of all stored bytes, and compares rows and stored objects with each other.

use super::failure::Failure;
use super::output::{count, print, print_json};
use super::runtime::block_on;
use super::site::SiteArgs;
use crate::jobs::{Archive, Check, Fault};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    site: SiteArgs,
    /// Fraction of the stored files whose digest is recomputed, from 0 to 1; every stored file is checked for existence
    /// in any case
    #[arg(long, value_name = "PART", default_value_t = 1.0, value_parser = part)]
    sample: f64,
    /// Hand stored files and rows to which nothing refers over to the next `gc`. Damaged and missing files are marked
    /// in any case, and replaced when the same bytes are uploaded again
    #[arg(long)]
    repair: bool,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

fn part(text: &str) -> Result<f64, String> {
    let part = text.parse().ok().filter(|part| (0.0..=1.0).contains(part));
    part.ok_or_else(|| "expected a number from 0 to 1".to_owned())
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let check = Check { sample: args.sample, repair: args.repair };
    let report = block_on(async {
        let archive = Archive::look_after(&args.site.site()).await.map_err(Failure::failed)?;
        let report = archive.check_within(check).await;
        archive.catalog.close().await;
        report.map_err(Failure::failed)
    })?;
    if args.json {
        print_json(&report)?;
    } else {
        let mut lines =
            vec![format!("checked {} blobs, {} bytes\n", count(report.checked_blobs), count(report.checked_bytes))];
        let of = |tenant: &Option<String>| tenant.as_ref().map_or(String::new(), |id| format!(", of tenant {id}"));
        lines.extend(report.faults.iter().map(|fault| match fault {
            Fault::Corrupt { digest, tenant } => format!("corrupt        {digest}{}\n", of(tenant)),
            Fault::Missing { digest, named_by, tenant } => {
                format!("missing        {digest}, named by {named_by}{}\n", of(tenant))
            }
            Fault::OrphanObject { object, bytes } => {
                format!("orphan object  {object}, {} bytes, unknown to the catalog\n", count(*bytes))
            }
            Fault::OrphanRow { digest, tenant } => {
                format!("orphan row     {digest}, named by no row{}\n", of(tenant))
            }
        }));
        print(&lines.concat())?;
    }
    match report.faults.len() {
        0 => Ok(()),
        1 => Err(Failure::failed("1 fault found")),
        n => Err(Failure::failed(format!("{n} faults found"))),
    }
}
