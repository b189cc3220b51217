//! Command line, one file per command: translates between words and the library, without any science of its own.

mod answer;
mod backup;
mod bases;
mod batch;
mod color;
mod combine;
mod completions;
mod compress;
mod compute_job;
mod config;
mod config_file;
mod contents;
mod declared;
mod decode;
mod demo;
mod destination;
mod doctor;
mod dot;
mod evaluate;
mod export;
mod failure;
mod formats;
mod fsck;
mod gc;
mod groups;
mod guard;
mod health;
mod input;
mod inspect;
mod isolate;
mod jobs;
mod key_file;
mod keys;
mod link;
mod listen;
mod log;
mod man;
mod migrate;
mod openapi;
mod opened;
mod output;
mod paper;
mod physics;
mod pinned;
mod preview;
mod project;
mod query;
mod reading;
mod reflectance;
mod relocate;
mod report;
mod request;
mod restore;
mod rows;
mod runtime;
mod sample;
mod serve;
mod setting_keys;
mod settings;
mod site;
mod table;
mod tenants;
mod tls;
mod token;
mod umask;
mod viewing;
mod worker;

pub use failure::{Failure, one_line};
pub use log::{LogFormat, end_log};

use crate::catalog::without_password;
use crate::trust::without_secrets;
use clap::{ArgMatches, CommandFactory, FromArgMatches};
use config_file::ConfigFile;
use guard::Outputs;
use site::UMASK;
use std::ffi::OsString;
use std::path::PathBuf;
use tracing_subscriber::filter::LevelFilter;
use umask::Umask;

/// Compress, store, evaluate and sample acquired radiometric measurements.
#[derive(Debug, clap::Parser)]
#[command(name = "wavelume", version = env!("WAVELUME_VERSION"), max_term_width = 100)]
#[command(arg_required_else_help = true, infer_long_args = false)]
pub struct Cli {
    /// Format of the log on stderr; `RUST_LOG` filters its events
    #[arg(long, global = true, value_enum, default_value_t, env = "WAVELUME_LOG_FORMAT", hide_env_values = true)]
    pub log_format: LogFormat,
    #[command(subcommand)]
    command: Command,
    /// Permissions that a command takes from what it makes in data directories, stores and backups; `None` for a
    /// command that makes nothing there.
    #[arg(skip)]
    umask: Option<Umask>,
    /// Files that the command reads, and must not write.
    #[arg(skip)]
    inputs: Vec<PathBuf>,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Compress a measurement to a promised error
    Compress(compress::Args),
    /// Describe a measurement or material: axes, units, coverage, errors
    Inspect(inspect::Args),
    /// Write the float32 tensor that `compress` would encode, without encoding it
    Project(project::Args),
    /// Decode a material to a dense float32 array
    Decode(decode::Args),
    /// Evaluate the spectrum of a material for a pair of directions
    Evaluate(evaluate::Args),
    /// Draw random outgoing directions in proportion to the light that a material emits, reflects or transmits into
    /// them
    Sample(sample::Args),
    /// Compute the colour of a material: XYZ, Lab, sRGB
    Color(color::Args),
    /// Draw a material: a ball, a polar diagram or a plot, as PNG or SVG
    Preview(preview::Args),
    /// Report the energy, flux and reciprocity of a material
    Physics(physics::Args),
    /// Compute the directional albedo of a material and store it as another material
    Reflectance(reflectance::Args),
    /// Write a material in a file format of renderers or lighting programs
    Export(export::Args),
    /// Add materials, each times a factor, without decoding them where possible
    Combine(combine::Args),
    /// Compute the inner product of two materials: the sum of the products of their samples
    Dot(dot::Args),
    /// List the wavelet bases for spectra and for directions
    Bases(bases::Args),
    /// List the file formats that can be read or written
    Formats(formats::Args),
    /// Recompute the tables of the paper (Claustres et al. 2006), beside the published figures
    Paper(paper::Args),
    /// Start the HTTP service, compress four real measurements with it and show how to use it
    Demo(demo::Args),
    /// Start the HTTP service
    Serve(serve::Args),
    /// Run jobs without serving HTTP
    Worker(worker::Args),
    /// List, cancel or repeat jobs of a running service
    Jobs(jobs::Args),
    /// Make, list or revoke access keys
    Keys(keys::Args),
    /// Print URLs that fetch materials for a limited time without a key in a header; made without asking the service
    Link(link::Args),
    /// Print a token that acts for a key for a limited time; made without asking the service
    Token(token::Args),
    /// Make, list, change or close tenants
    Tenants(tenants::Args),
    /// Bring the schema of the catalog up to date
    Migrate(migrate::Args),
    /// Print the effective settings of the service, each with its source, as a configuration file
    Config(config::Args),
    /// Examine database, store and machine, with a remedy for each fault; changes nothing
    Doctor(doctor::Args),
    /// Check that a running service answers
    Health(health::Args),
    /// Check every stored file of a data directory against its digest, and every reference to one
    Fsck(fsck::Args),
    /// Copy the catalog and the stored files of a running service to another place
    Backup(backup::Args),
    /// Fill an empty service with a backup
    Restore(restore::Args),
    /// Copy a service to another database and store
    Move(relocate::Args),
    /// Remove unreferenced files and abandoned temporary files from a data directory
    Gc(gc::Args),
    /// Print the OpenAPI description of the HTTP interface
    Openapi(openapi::Args),
    /// Print a script with which a shell completes commands and options
    Completions(completions::Args),
    /// Print or write pages for the manual of the system (`man`)
    Man(man::Args),
    /// Compute one job for the worker that has started this process
    #[command(hide = true, name = crate::jobs::COMPUTE_JOB)]
    ComputeJob,
}

impl Command {
    /// Returns the files that the command writes. Commands that fill a data directory or a backup compare these places
    /// themselves.
    fn outputs(&self) -> Option<Outputs> {
        match self {
            Self::Compress(args) => Some(args.outputs()),
            Self::Project(args) => Some(args.outputs()),
            Self::Decode(args) => Some(args.outputs()),
            Self::Evaluate(args) => args.outputs(),
            Self::Sample(args) => args.outputs(),
            Self::Preview(args) => Some(args.outputs()),
            Self::Reflectance(args) => Some(args.outputs()),
            Self::Export(args) => Some(args.outputs()),
            Self::Combine(args) => Some(args.outputs()),
            _ => None,
        }
    }
}

/// Command line after parsing: a command to run, or a text to show.
#[derive(Debug)]
pub enum Parsed {
    /// The command line names a command to run.
    Run(Box<Cli>),
    /// Text for stdout: help or the version.
    Show(String),
}

impl Cli {
    /// Returns the description of the program for the parser of the command line: its commands, options and help.
    pub(crate) fn program() -> clap::Command {
        groups::grouped(Self::command())
    }

    /// Reads a command line, program name first, and the configuration file that it or the environment names.
    pub fn read(line: impl IntoIterator<Item = OsString>) -> Result<Parsed, Failure> {
        let line: Vec<OsString> = line.into_iter().collect();
        let mut matches = match Self::program().try_get_matches_from(&line) {
            Ok(matches) => matches,
            Err(error) => return shown(error),
        };
        let keys = setting_keys::keys(&Self::command());
        let file =
            given::<PathBuf>(&matches, setting_keys::CONFIG).map(|path| ConfigFile::read(&path, &keys)).transpose()?;
        if let Some(file) = &file {
            matches = match file.set_defaults(Self::program(), &keys).try_get_matches_from(&line) {
                Ok(matches) => matches,
                Err(error) => return shown(error),
            };
        }
        let mut cli = match Self::from_arg_matches(&matches) {
            Ok(cli) => cli,
            Err(error) => return shown(error),
        };
        cli.umask = given(&matches, UMASK);
        cli.inputs = guard::inputs(&matches);
        if let (Command::Config(args), Some((_, matches))) = (&mut cli.command, matches.subcommand()) {
            args.fill_in(matches, &keys, file.as_ref());
        }
        Ok(Parsed::Run(Box::new(cli)))
    }

    /// Starts the log on stderr. `RUST_LOG` filters it; by default the service logs every request and other commands
    /// only warnings.
    pub fn start_log(&self) {
        let level = match self.command {
            Command::Serve(_) | Command::Worker(_) => LevelFilter::INFO,
            _ => LevelFilter::WARN,
        };
        log::start(self.log_format, level);
    }

    /// Runs the subcommand that the command line names, such as `compress`.
    pub fn run(self) -> Result<(), Failure> {
        if let Some(umask) = self.umask {
            umask.set();
        }
        if let Some(outputs) = self.command.outputs() {
            outputs.check(&self.inputs)?;
        }
        match self.command {
            Command::Compress(args) => compress::run(&args),
            Command::Inspect(args) => inspect::run(&args),
            Command::Project(args) => project::run(&args),
            Command::Decode(args) => decode::run(&args),
            Command::Evaluate(args) => evaluate::run(&args),
            Command::Sample(args) => sample::run(&args),
            Command::Color(args) => color::run(&args),
            Command::Preview(args) => preview::run(&args),
            Command::Physics(args) => physics::run(&args),
            Command::Reflectance(args) => reflectance::run(&args),
            Command::Export(args) => export::run(&args),
            Command::Combine(args) => combine::run(&args),
            Command::Dot(args) => dot::run(&args),
            Command::Bases(args) => bases::run(&args),
            Command::Formats(args) => formats::run(&args),
            Command::Paper(args) => paper::run(&args),
            Command::Demo(args) => demo::run(&args),
            Command::Serve(args) => serve::run(&args),
            Command::Worker(args) => worker::run(&args),
            Command::Jobs(args) => jobs::run(&args),
            Command::Keys(args) => keys::run(&args),
            Command::Link(args) => link::run(&args),
            Command::Token(args) => token::run(&args),
            Command::Tenants(args) => tenants::run(&args),
            Command::Migrate(args) => migrate::run(&args),
            Command::Config(args) => config::run(&args),
            Command::Doctor(args) => doctor::run(&args),
            Command::Health(args) => health::run(&args),
            Command::Fsck(args) => fsck::run(&args),
            Command::Backup(args) => backup::run(&args),
            Command::Restore(args) => restore::run(&args),
            Command::Move(args) => relocate::run(&args),
            Command::Gc(args) => gc::run(&args),
            Command::Openapi(args) => openapi::run(&args),
            Command::Completions(args) => completions::run(&args, Self::program()),
            Command::Man(args) => man::run(&args, Self::program()),
            Command::ComputeJob => compute_job::run(),
        }
    }
}

impl Parsed {
    /// Prints `text` on standard output.
    pub fn show(text: &str) -> Result<(), Failure> {
        output::print(text)
    }
}

/// Returns the value of the option with this id, for a command that has it.
fn given<T: Clone + Send + Sync + 'static>(matches: &ArgMatches, id: &str) -> Option<T> {
    match matches.subcommand() {
        Some((_, below)) => given(below, id),
        None => matches.try_get_one::<T>(id).ok().flatten().cloned(),
    }
}

/// Returns the help or version that the parser wants shown, or the failure that it reports, without passwords and keys.
fn shown(mut error: clap::Error) -> Result<Parsed, Failure> {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    for kind in [ContextKind::InvalidValue, ContextKind::InvalidArg] {
        if let Some(ContextValue::String(value)) = error.get(kind) {
            // A misspelt URL may have lost the mark by which its password is found.
            let is_cut = kind == ContextKind::InvalidValue && value.contains('@') && !value.contains("://");
            let value = if is_cut { "…".to_owned() } else { without_password(value) };
            error.insert(kind, ContextValue::String(value));
        }
    }
    let text = error.render().to_string();
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => Ok(Parsed::Show(text)),
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => Err(Failure::Help(text)),
        _ => Err(Failure::Usage(without_secrets(&usage_line(&text)).into_owned())),
    }
}

/// Returns the message of a command-line error, without the usage that the parser prints below it.
fn usage_line(rendered: &str) -> String {
    let message = rendered.trim_start_matches("error:");
    let end =
        ["\n  [subcommands:", "\nUsage:", "\nFor more information"].iter().filter_map(|mark| message.find(mark)).min();
    let message = failure::one_line(&message[..end.unwrap_or(message.len())]);
    format!("{message} (see --help)")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &[&str]) -> Result<Parsed, Failure> {
        Cli::read(line.iter().map(OsString::from))
    }

    #[test]
    fn the_table_of_commands_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn wrong_usage_is_one_line() {
        for line in [
            &["wavelume", "compres"][..],
            &["wavelume", "--log-format", "json"],
            &["wavelume", "preview", "in.wlm"],
            &["wavelume", "compress", "in.npy", "-o", "x.wlm", "--er-l2", "0.1", "--lossless"],
            &["wavelume", "compress", "in.npy", "-o", "x.wlm", "--er-l3", "0.1"],
            &["wavelume", "evaluate", "m.wlm", "--wi", "30"],
        ] {
            let failure = read(line).unwrap_err();
            assert_eq!(failure.exit_code(), 2, "{line:?}");
            let message = failure.to_string();
            assert!(message.ends_with("(see --help)") && !message.contains('\n'), "{message}");
        }
        let message = read(&["wavelume", "preview", "in.wlm"]).unwrap_err().to_string();
        assert!(message.contains("required arguments were not provided: --output <P.png|svg>"), "{message}");
        let message = read(&["wavelume", "--log-format", "json"]).unwrap_err().to_string();
        assert!(!message.contains(crate::jobs::COMPUTE_JOB) && !message.contains("evaluate"), "{message}");
    }

    #[test]
    fn a_key_on_the_command_line_is_not_repeated() {
        let key = crate::trust::Key::generate().unwrap().reveal();
        for line in [
            &["wavelume", "link", &key][..],
            &["wavelume", "token", "--scopes", &key],
            &["wavelume", "token", "--key-file", "x", &format!("--{key}")],
            &["wavelume", &key],
        ] {
            let message = read(line).unwrap_err().to_string();
            assert!(message.contains("wlm_…") && !message.contains(&key[15..30]), "{message}");
        }
    }

    #[test]
    fn help_and_version_are_no_failures() {
        for line in [
            &["wavelume", "--help"][..],
            &["wavelume", "--version"],
            &["wavelume", "compress", "--help"],
            &["wavelume", "help"],
            &["wavelume", "help", "compress"],
            &["wavelume", "help", "jobs", "list"],
        ] {
            assert!(matches!(read(line), Ok(Parsed::Show(_))), "{line:?}");
        }
    }

    #[test]
    fn without_a_command_the_help_is_shown_as_wrong_usage() {
        for (line, shown) in [
            (&["wavelume"][..], "Pictures and figures:"),
            (&["wavelume", "jobs"], "cancel"),
            (&["wavelume", "keys"], "revoke"),
            (&["wavelume", "tenants"], "close"),
        ] {
            let failure = read(line).unwrap_err();
            assert!(matches!(&failure, Failure::Help(text) if text.contains(shown)), "{line:?}: {failure}");
            assert_eq!(failure.exit_code(), 2);
        }
    }
}
