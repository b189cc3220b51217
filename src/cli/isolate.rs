//! Option that computes jobs in processes of their own.

use super::failure::Failure;
use std::path::{Path, PathBuf};

/// Option that computes jobs in processes of their own.
#[derive(Debug, clap::Args)]
#[group(id = "isolation")]
pub(crate) struct IsolateArgs {
    /// Compute each job in a process of its own, without access to database and store, so that a job that runs out of
    /// memory (--job-memory) ends alone: `on`, `off`, or `auto` for `on` under Linux
    #[arg(
        long,
        value_name = "WHEN",
        value_enum,
        hide_possible_values = true,
        default_value = "auto",
        env = "WAVELUME_ISOLATE",
        hide_env_values = true,
        help_heading = "Work"
    )]
    isolate: When,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum When {
    Auto,
    On,
    Off,
}

/// Path under Linux of the program that the process runs. A newer file in place of the program's file does not change
/// it.
const SELF: &str = "/proc/self/exe";

impl IsolateArgs {
    /// Returns the program that computes jobs in processes of their own; `None` if this process computes them.
    pub(crate) fn program(&self) -> Result<Option<PathBuf>, Failure> {
        let is_linux = cfg!(target_os = "linux") && Path::new(SELF).exists();
        match self.isolate {
            When::Off => Ok(None),
            When::Auto if !is_linux => Ok(None),
            When::Auto | When::On if is_linux => Ok(Some(SELF.into())),
            When::Auto | When::On => std::env::current_exe().map(Some).map_err(|error| {
                Failure::failed(format!("--isolate: the program does not find itself: {error}; use --isolate off"))
            }),
        }
    }
}
