//! Logging, command line, exit code.

use std::io::Write;
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;
use wavelume::cli::{Cli, Failure, LogFormat, Parsed};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if failure != Failure::Closed {
                // A closed stderr has nobody to tell.
                let _ = writeln!(std::io::stderr(), "wavelume: {failure}");
            }
            ExitCode::from(failure.exit_code())
        }
    }
}

fn run() -> Result<(), Failure> {
    match Cli::read(std::env::args_os())? {
        Parsed::Show(text) => Parsed::show(&text),
        Parsed::Run(cli) => {
            log(cli.log_format, cli.log_level());
            cli.run()
        }
    }
}

/// Sends the log to stderr.
fn log(format: LogFormat, level: &str) {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    match format {
        LogFormat::Human => log.with_target(false).init(),
        LogFormat::Json => log.json().init(),
    }
}
