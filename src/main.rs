//! Entry point of the program: command line and exit code.

use std::io::Write;
use std::process::ExitCode;
use wavelume::cli::{Cli, Failure, Parsed, end_log, one_line};

fn main() -> ExitCode {
    // A panic prints one line, unless `RUST_BACKTRACE` asks for more.
    if std::env::var_os("RUST_BACKTRACE").is_none() {
        std::panic::set_hook(Box::new(|bug| {
            let place = bug.location().map_or_else(String::new, |at| format!(" at {}:{}", at.file(), at.line()));
            let message = one_line(bug.payload_as_str().unwrap_or("no message"));
            let _ = writeln!(std::io::stderr(), "wavelume: internal error{place}: {message}");
        }));
    }
    wavelume::store::provide_tls();
    let done = std::panic::catch_unwind(run).unwrap_or(Err(Failure::Bug));
    end_log();
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            // The hook above has reported a bug; a closed stderr has no reader.
            let _ = match &failure {
                Failure::Closed | Failure::Bug => Ok(()),
                Failure::Help(text) => write!(std::io::stderr(), "{text}"),
                _ => writeln!(std::io::stderr(), "wavelume: {failure}"),
            };
            ExitCode::from(failure.exit_code())
        }
    }
}

fn run() -> Result<(), Failure> {
    match Cli::read(std::env::args_os())? {
        Parsed::Show(text) => Parsed::show(&text),
        Parsed::Run(cli) => {
            cli.start_log();
            cli.run()
        }
    }
}
