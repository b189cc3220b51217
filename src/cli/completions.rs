//! `wavelume completions`: a script that lets a shell complete commands, options and their values.

use super::failure::Failure;
use super::output::print;
use clap::Command;
use clap_complete::Shell;

/// Name of the command.
pub(super) const NAME: &str = "completions";

#[derive(Debug, clap::Args)]
#[command(after_help = "For bash: wavelume completions bash > ~/.local/share/bash-completion/completions/wavelume")]
pub(crate) struct Args {
    /// Shell that reads the script
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

/// Prints the script for the options and commands of `program`.
pub(crate) fn run(args: &Args, mut program: Command) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "wavelume", &mut script);
    print(&String::from_utf8_lossy(&script))
}
