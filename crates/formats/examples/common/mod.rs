//! Shared code of the example programs: exit codes, and materials of virtual measurements.

use std::error::Error;
use std::io::{StdoutLock, Write};
use std::process::ExitCode;
use wavelume_core::compress::Target;
use wavelume_core::domain::Silent;
use wavelume_formats::formats::Interpretation;
use wavelume_formats::pipeline::{self, Input, Request};

/// Runs a program with the file named by its only argument, if any. Exit codes: 0 if its checks pass, 1 if they do not,
/// 2 with a line on stderr if it fails.
pub(crate) fn main(
    name: &str,
    run: impl FnOnce(Option<&str>, &mut StdoutLock<'static>) -> Result<bool, Box<dyn Error>>,
) -> ExitCode {
    let path = std::env::args().nth(1);
    match run(path.as_deref(), &mut std::io::stdout().lock()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "{name}: {error}");
            ExitCode::from(2)
        }
    }
}

/// Returns the bytes of the material in `path`, or of a virtual measurement compressed to er(L2) 1 %.
#[allow(dead_code, reason = "some programs bring no measurement of their own")]
pub(crate) fn material(path: Option<&str>, document: &str) -> Result<Vec<u8>, Box<dyn Error>> {
    if let Some(path) = path {
        return Ok(std::fs::read(path)?);
    }
    let interpretation = Interpretation::default();
    let input = Input { bytes: document.as_bytes(), spectrum: None, interpretation: &interpretation };
    Ok(pipeline::compress(&pipeline::read(&input)?, &Request::to(Target::ErL2(0.01)), &Silent)?.bytes)
}
