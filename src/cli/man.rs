//! `wavelume man`: pages for the manual of the system.

use super::failure::Failure;
use super::input::describe;
use super::output::{print, write_file};
use clap::Command;
use clap_mangen::Man;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Command to print the page of [default: the page of the program, which names the others]
    #[arg(value_name = "COMMAND", conflicts_with = "output")]
    command: Option<String>,
    /// Directory in which to write the pages of the program and of every command, wavelume.1, wavelume-compress.1, …
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// Prints or writes the pages of `program`.
pub(crate) fn run(args: &Args, program: Command) -> Result<(), Failure> {
    let mut program = program.disable_help_subcommand(true);
    program.build();
    if let Some(directory) = &args.output {
        std::fs::create_dir_all(directory).map_err(|error| Failure::failed(describe(&error)).about(directory))?;
        return write(&program, directory);
    }
    let command = match &args.command {
        None => &program,
        Some(name) => program
            .find_subcommand(name)
            .ok_or_else(|| Failure::usage(format!("`{name}` is no command; `wavelume help` lists them")))?,
    };
    print(&String::from_utf8_lossy(&page(command)?))
}

/// Writes the page of a command and, after it, those of its commands that are not hidden.
fn write(command: &Command, directory: &Path) -> Result<(), Failure> {
    write_file(&directory.join(Man::new(command.clone()).get_filename()), &page(command)?)?;
    command.get_subcommands().filter(|below| !below.is_hide_set()).try_for_each(|below| write(below, directory))
}

fn page(command: &Command) -> Result<Vec<u8>, Failure> {
    let mut page = Vec::new();
    Man::new(command.clone()).render(&mut page).map_err(Failure::failed)?;
    Ok(page)
}
