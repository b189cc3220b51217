//! `wavelume project`: the float32 tensor that would be compressed, as an array with its manifest.

use super::decode::write_marked;
use super::failure::Failure;
use super::guard::Outputs;
use super::input::MeasurementArgs;
use super::request::{RequestArgs, ThreadsArgs};
use crate::pipeline;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    measurement: MeasurementArgs,
    /// NumPy array to write (.npy, float32, NaN = masked), with a manifest of its axes, NAME.axes.json, beside it.
    /// NAME.filled.npy marks directions that were filled in without samples, if there are any
    #[arg(short, long, value_name = "T.npy")]
    output: PathBuf,
    // The target and the policy do not change the tensor; they are accepted so that both commands have the same
    // options.
    #[command(flatten)]
    request: RequestArgs,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print a report on the written files as one line of JSON
    #[arg(long)]
    json: bool,
}

impl Args {
    pub(super) fn outputs(&self) -> Outputs {
        Outputs::array(&self.output)
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let request = args.request.request();
    let about = |error| Failure::from(error).about(&args.measurement.input);
    let loaded = args.measurement.load(request.wavelengths.clone())?;
    let projected = args.threads.run(|| {
        let source = pipeline::read(&loaded.input())?;
        // The file's bytes are no longer needed, and may be as large as the tensor.
        drop(loaded);
        pipeline::project(&source.acquisition, &request)
    })?;
    let projected = projected.map_err(about)?;
    write_marked(&args.output, projected.measurement, Some(&projected.coverage), &projected.filled, args.json)
}
