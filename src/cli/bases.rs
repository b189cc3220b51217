//! `wavelume bases`: the spectral bases that are known.

use super::failure::Failure;
use super::output::{print, print_json};
use crate::transform;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print an array of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let bases = transform::bases();
    if args.json {
        return print_json(&bases);
    }
    print("")
}
