//! `wavelume doctor`: examines database, store and machine, and says what to do about each fault; changes nothing.

use super::failure::Failure;
use super::output::{print, print_json};
use super::runtime::block_on_and_abandon;
use super::serve::ReachArgs;
use super::settings::Settings;
use super::site::PlaceArgs;
use super::tls::TlsArgs;
use crate::api::{certificate_found, descriptors_found};
use crate::catalog::without_password;
use crate::jobs::{Database, Finding, Verdict, WorkConfig, examine};
use serde_json::json;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    places: PlaceArgs,
    /// Number of nodes and workers that share the database; their connections are compared with its limit
    #[arg(long, value_name = "N", default_value_t = 4)]
    processes: u32,
    /// Print the findings as one line of JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    reach: ReachArgs,
    #[command(flatten)]
    tls: TlsArgs,
    #[command(flatten)]
    settings: Settings,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut config = WorkConfig::new(&args.places.directory);
    config.site = args.places.site();
    args.settings.apply(&mut config);
    let certificate = args.tls.files()?;
    let mut findings =
        block_on_and_abandon(async { Ok(examine(&config, args.processes, args.places.umask.bits()).await) })?;
    findings.push(descriptors_found(&config.limits));
    findings.extend(certificate.map(|files| certificate_found(&files, &args.reach.names)));
    if let Some(file) = &args.places.file.config {
        findings.push(configuration(file, config.site.database.as_ref()));
    }
    let of = |verdict| findings.iter().filter(|finding| finding.verdict == verdict).count();
    let faults = of(Verdict::Fault);
    if args.json {
        print_json(&json!({ "findings": findings, "faults": faults, "warnings": of(Verdict::Warning) }))?;
    } else {
        print(&rendered(&findings))?;
    }
    match faults {
        0 => Ok(()),
        1 => Err(Failure::failed("1 fault found")),
        n => Err(Failure::failed(format!("{n} faults found"))),
    }
}

/// Judges who may read a configuration file: everybody should not, if it holds the password of the database.
fn configuration(file: &Path, database: Option<&Database>) -> Finding {
    const CHECK: &str = "local configuration";
    let url = match database {
        Some(Database::Server(url)) if without_password(url) != *url => url,
        _ => return Finding::ok(CHECK, format!("{}", file.display())),
    };
    let is_public = file.metadata().is_ok_and(|metadata| metadata.permissions().mode() & 0o004 != 0);
    if is_public && std::fs::read_to_string(file).is_ok_and(|text| text.contains(url.as_str())) {
        return Finding::warning(
            CHECK,
            format!("{} holds a password, and every user may read it", file.display()),
            format!("chmod o= {}, or give the password by WAVELUME_DATABASE or PGPASSFILE", file.display()),
        );
    }
    Finding::ok(CHECK, format!("{}", file.display()))
}

fn rendered(findings: &[Finding]) -> String {
    let width = findings.iter().map(|finding| finding.check.chars().count()).max().unwrap_or(0);
    let line = |finding: &Finding| {
        let Finding { verdict, check, found, remedy } = finding;
        let text = if remedy.is_empty() { found.clone() } else { format!("{found}; {remedy}") };
        format!("{:<7}  {check:<width$}  {}\n", verdict.name(), super::one_line(&text))
    };
    findings.iter().map(line).collect()
}
