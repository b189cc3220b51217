//! `wavelume dot`: the sum of products of two materials' samples.

use super::failure::Failure;
use super::input::read_file;
use super::output::print_json;
use super::request::ThreadsArgs;
use crate::algebra;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// First of the two materials whose inner product is computed
    #[arg(value_name = "A.wlm")]
    a: PathBuf,
    /// Second of the two materials, with the same axes as the first
    #[arg(value_name = "B.wlm")]
    b: PathBuf,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// No effect, since the answer is always JSON; accepted because other commands have this option
    #[arg(long, hide = true)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    args.threads.run(|| answer(args))?
}

fn answer(args: &Args) -> Result<(), Failure> {
    let (a, b) = (read_file(&args.a)?, read_file(&args.b)?);
    print_json(&algebra::dot(&a, &b)?)
}
