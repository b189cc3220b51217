//! `wavelume fsck`: computes the digest of all stored bytes, and compares rows and stored objects with each other; with
//! `--readings`, reads the stored measurements again and compares what is read.

use super::failure::{Failure, one_line};
use super::output::{Table, count, print, print_json};
use super::runtime::block_on;
use super::site::SiteArgs;
use crate::jobs::{Archive, Check, Comparison, Fault, ReadingsReport};
use indicatif::{ProgressBar, ProgressStyle};

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
    /// Read all stored measurements again instead, with the options of their uploads, and list those that this version
    /// reads differently, each with its materials. Changes nothing
    #[arg(long, conflicts_with_all = ["sample", "repair"])]
    readings: bool,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

fn part(text: &str) -> Result<f64, String> {
    let part = text.parse().ok().filter(|part| (0.0..=1.0).contains(part));
    part.ok_or_else(|| "expected a number from 0 to 1".to_owned())
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if args.readings {
        return read_again(args);
    }
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

/// Lists the stored measurements that this version reads differently.
fn read_again(args: &Args) -> Result<(), Failure> {
    let report = block_on(async {
        let archive = Archive::look_after(&args.site.site()).await.map_err(Failure::failed)?;
        // Hidden where standard error is no terminal.
        let bar = ProgressBar::new_spinner();
        if let Ok(style) = ProgressStyle::with_template("{human_pos} measurements read  {elapsed}") {
            bar.set_style(style);
        }
        let report = archive.check_readings(|read| bar.set_position(read)).await;
        bar.finish_and_clear();
        archive.catalog.close().await;
        report.map_err(Failure::failed)
    })?;
    if args.json {
        print_json(&report)?;
    } else {
        print(&listed(&report))?;
    }
    match (report.differing.len(), report.unread.len()) {
        (0, 0) => Ok(()),
        (0, 1) => Err(Failure::failed("1 measurement could not be read; `wavelume fsck` tells why")),
        (0, n) => Err(Failure::failed(format!("{n} measurements could not be read; `wavelume fsck` tells why"))),
        (1, _) => Err(Failure::failed("1 measurement is read differently")),
        (n, _) => Err(Failure::failed(format!("{n} measurements are read differently"))),
    }
}

fn listed(report: &ReadingsReport) -> String {
    let mut text = match report.read {
        1 => "read 1 measurement again\n".to_owned(),
        read => format!("read {} measurements again\n", count(read)),
    };
    let mut table = Table::new(&["", "id", "name", "reading"]);
    for measurement in &report.differing {
        let of = measurement.tenant.as_ref().map_or(String::new(), |id| format!(" (tenant {id})"));
        let name = measurement.name.clone().unwrap_or_default() + &of;
        table.row(["measurement".to_owned(), measurement.measurement.clone(), name, one_line(&measurement.difference)]);
        for made in &measurement.materials {
            let words = match made.comparison {
                Comparison::Agrees => "agrees with today's reading",
                Comparison::Differs => "was made of another reading",
                Comparison::Unknown => "cannot be compared",
            };
            let detail = made.detail.as_ref().map_or(String::new(), |detail| format!(": {}", one_line(detail)));
            let name = made.name.clone().unwrap_or_default();
            table.row(["  material".to_owned(), made.material.clone(), name, format!("{words}{detail}")]);
        }
    }
    for id in &report.unread {
        let reading = "its stored file is missing or damaged: see `wavelume fsck`".to_owned();
        table.row(["measurement".to_owned(), id.clone(), String::new(), reading]);
    }
    if !(report.differing.is_empty() && report.unread.is_empty()) {
        text.push_str(&table.render());
    }
    text
}
