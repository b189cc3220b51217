//! `wavelume dot`: the sum of products of two materials' samples.

use super::failure::Failure;
use super::input::read_file;
use super::output::print_json;
use crate::algebra;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// First material
    #[arg(value_name = "A.wlm")]
    a: PathBuf,
    /// Second material, on the same axes as the first
    #[arg(value_name = "B.wlm")]
    b: PathBuf,
    /// Taken for symmetry with the other commands: the answer is always JSON
    #[arg(long, hide = true)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let (a, b) = (read_file(&args.a)?, read_file(&args.b)?);
    print_json(&algebra::dot(&a, &b)?)
}
