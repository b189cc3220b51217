//! `wavelume export`: a material in a format that others read.

use super::decode::{decode, write_array};
use super::failure::Failure;
use super::request::ThreadsArgs;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The material
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// The format to write
    #[arg(long, value_enum)]
    format: Format,
    /// The file to write; an existing one is replaced whole
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print what was written as one line of JSON
    #[arg(long)]
    json: bool,
}

/// The formats that are written.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// A dense float32 array with its manifest beside it.
    Npy,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let measurement = decode(&args.material, None, &args.threads)?;
    match args.format {
        Format::Npy => write_array(&args.output, measurement, None, args.json),
    }
}
