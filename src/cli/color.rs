//! `wavelume color`: the colour of a material.

use super::failure::Failure;
use super::output::print_json;
use super::query::{self, List};
use super::request::ThreadsArgs;
use super::viewing::ViewingArgs;
use crate::domain::Direction;
use crate::preview::{self, Question};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) whose colour is computed
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// Incoming direction: polar angle and azimuth in degrees [default: 0,0, normal incidence]
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    wi: Option<Direction>,
    /// Outgoing direction: polar angle and azimuth in degrees [default: the colour of all outgoing light together,
    /// directional albedo or flux]
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    wo: Option<Direction>,
    /// Entry to use on each leading index axis (columns of a table, scan positions), counted from 0 [default: every
    /// column of a spectral table]
    #[arg(long, value_name = "I,...", value_parser = query::index)]
    index: Option<List<usize>>,
    #[command(flatten)]
    viewing: ViewingArgs,
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
    let viewing = args.viewing.viewing()?;
    let material = query::open(&args.material)?;
    let question = Question { index: args.index.as_ref().map(|index| index.0.as_slice()), wi: args.wi, wo: args.wo };
    let colours = preview::colours(&material, &question, &viewing);
    print_json(&colours.map_err(|error| Failure::from(error).about(&args.material))?)
}
