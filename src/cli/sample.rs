//! `wavelume sample`: directions drawn from a material, with their densities and weights.

use super::failure::Failure;
use super::output::print_json;
use super::query::{self, List};
use crate::domain::Direction;
use crate::domain::limits::MAX_LEVEL;
use crate::numeric::random::half_open;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use std::path::PathBuf;

/// Directions in one answer.
const MAX_DIRECTIONS: u64 = 10_000_000;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The material
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// The incoming direction in degrees, for quantities that have one
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    wi: Option<Direction>,
    /// How many directions
    #[arg(short = 'n', long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_DIRECTIONS))]
    count: u64,
    /// The seed of the random numbers; the same seed gives the same directions anywhere
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Stop the descent at this subdivision level [default: the material's own]
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_LEVEL)))]
    level: Option<u8>,
    /// One entry, from 0, for each leading index axis
    #[arg(long, value_name = "I,...", value_parser = query::index)]
    index: Option<List<usize>>,
    /// Taken for symmetry with the other commands: the answer is always JSON
    #[arg(long, hide = true)]
    json: bool,
}

/// The answer: parallel arrays; where nothing is emitted or reflected the direction is null and pdf and weight are 0.
#[derive(Default, serde::Serialize)]
struct Answer {
    directions: Vec<Option<[f64; 2]>>,
    pdf: Vec<f64>,
    weight: Vec<f64>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let material = query::open(&args.material)?;
    let index = args.index.as_ref().map_or(&[][..], |index| &index.0);
    let mut random = Pcg64Mcg::seed_from_u64(args.seed);
    let mut answer = Answer::default();
    for _ in 0..args.count {
        let u = [half_open(&mut random), half_open(&mut random)];
        let drawn = material.sample(index, args.wi, u, args.level);
        let drawn = drawn.map_err(|error| Failure::from(error).about(&args.material))?;
        answer.directions.push(drawn.map(|s| [s.direction.theta_degrees(), s.direction.phi_degrees()]));
        answer.pdf.push(drawn.map_or(0.0, |s| s.pdf));
        answer.weight.push(drawn.map_or(0.0, |s| s.weight));
    }
    print_json(&answer)
}
