//! `wavelume gc`: removes bytes that no row names, old jobs and abandoned staging files.

use super::failure::Failure;
use super::output::{count, print, print_json};
use super::runtime::block_on;
use super::settings::KeepSettings;
use super::site::SiteArgs;
use crate::jobs::{Archive, WorkConfig};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    site: SiteArgs,
    #[command(flatten)]
    settings: KeepSettings,
    /// Remove stored files to which nothing refers at once, without their grace period; a client that is reading one of
    /// them gets an error
    #[arg(long)]
    now: bool,
    /// Take the clock of the database for right, also in running services, although it seems to have jumped by more
    /// than a day
    #[arg(long)]
    trust_clock: bool,
    /// Print the report as one line of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let report = block_on(async {
        let mut config = WorkConfig::new(&args.site.places.directory);
        args.settings.apply(&mut config);
        // The command is the way out of a full disk.
        Archive::make_room(&args.site.site(), config.limits.disk_reserve);
        let archive = Archive::look_after(&args.site.site()).await.map_err(Failure::failed)?;
        archive.must_write().map_err(Failure::failed)?;
        let archive = archive.keeping(config.limits.disk_reserve);
        if args.trust_clock {
            archive.vouch_for_clock().await.map_err(Failure::failed)?;
        } else {
            archive.check_clock().await.map_err(Failure::failed)?;
        }
        let report = archive.sweep_with(&config.limits, args.now).await;
        archive.catalog.close().await;
        report.map_err(Failure::failed)
    })?;
    if args.json {
        return print_json(&report);
    }
    print(&format!(
        "removed  {} blobs ({} bytes), {} staging files, {} old jobs\n\
         waiting  {} blobs ({} bytes) that nothing names, until their grace is over; --now removes them\n\
         kept     {} blobs\n",
        count(report.removed_blobs),
        count(report.removed_bytes),
        count(report.removed_staging),
        count(report.forgotten_jobs),
        count(report.waiting_blobs),
        count(report.waiting_bytes),
        count(report.kept_blobs)
    ))
}
