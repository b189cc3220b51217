//! `wavelume preview`: a picture of a material.

use super::failure::Failure;
use super::guard::Outputs;
use super::opened::Opened;
use super::output::write_file;
use super::query::{self, List};
use super::request::ThreadsArgs;
use super::viewing::ViewingArgs;
use crate::preview::{self, DEFAULT_SIZE, SIZES};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) to show in the picture, or a measurement, which is compressed in memory
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// PNG picture to write; an existing file is replaced as a whole
    #[arg(short, long, value_name = "P.png")]
    output: PathBuf,
    /// Width and height of the picture in pixels, 64 to 512
    #[arg(long, value_name = "N", default_value_t = DEFAULT_SIZE, value_parser = size)]
    size: usize,
    /// Entry to use on each leading index axis (columns of a table, scan positions), counted from 0 [default: all
    /// entries in a plot of spectra, otherwise the first]
    #[arg(long, value_name = "I,...", value_parser = query::index)]
    index: Option<List<usize>>,
    #[command(flatten)]
    viewing: ViewingArgs,
    #[command(flatten)]
    threads: ThreadsArgs,
}

impl Args {
    pub(super) fn outputs(&self) -> Outputs {
        Outputs { kind: "a PNG picture", suffixes: vec!["png"], paths: vec![self.output.clone()] }
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let viewing = args.viewing.viewing()?;
    let index = args.index.as_ref().map(|index| index.0.as_slice());
    let picture = args.threads.run(|| {
        let (material, _) = Opened::open(&args.material)?;
        let picture = preview::picture(&material, index, &viewing, args.size);
        picture.map_err(|error| Failure::from(error).about(&args.material))
    })??;
    write_file(&args.output, &picture)
}

fn size(text: &str) -> Result<usize, String> {
    let refused = || format!("expected {} to {} pixels", SIZES.start(), SIZES.end());
    text.parse().ok().filter(|size| SIZES.contains(size)).ok_or_else(refused)
}
