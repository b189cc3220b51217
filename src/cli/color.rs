//! `wavelume color`: the colour of a material.

use super::failure::Failure;
use super::opened::{Made, Opened};
use super::output::print_json;
use super::query::{self, List, LuminaireArgs};
use super::request::ThreadsArgs;
use super::viewing::ViewingArgs;
use crate::domain::Direction;
use crate::preview::{self, Colours, Question};
use serde::Serialize;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) whose colour is computed, or a measurement, which is compressed in memory
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// Incoming direction: polar angle and azimuth in degrees [default: 0,0, normal incidence]
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    wi: Option<Direction>,
    /// Outgoing direction: polar angle and azimuth in degrees [default: the colour of all outgoing light together,
    /// directional albedo or flux]
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    wo: Option<Direction>,
    #[command(flatten)]
    luminaire: LuminaireArgs,
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

/// Colours of a material.
#[derive(Serialize)]
struct Answer {
    #[serde(flatten)]
    colours: Colours,
    #[serde(skip_serializing_if = "Option::is_none")]
    compressed_in_memory: Option<Made>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    args.threads.run(|| answer(args))?
}

fn answer(args: &Args) -> Result<(), Failure> {
    let viewing = args.viewing.viewing()?;
    let (material, compressed_in_memory) = Opened::open(&args.material)?;
    let wo = args.luminaire.outgoing(args.wo, &material).map_err(|failure| failure.about(&args.material))?;
    let question = Question { index: args.index.as_ref().map(|index| index.0.as_slice()), wi: args.wi, wo };
    let colours = preview::colours(&material, &question, &viewing);
    let colours = colours.map_err(|error| Failure::from(error).about(&args.material))?;
    print_json(&Answer { colours, compressed_in_memory })
}
