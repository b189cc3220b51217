//! `wavelume sample`: directions drawn from a material, with their densities and weights, from a seed or from a table.

use super::batch::{BatchArgs, Queries};
use super::failure::Failure;
use super::guard::Outputs;
use super::opened::{Made, Opened};
use super::output::print_json;
use super::query::{self, List};
use super::request::ThreadsArgs;
use crate::domain::limits::MAX_LEVEL;
use crate::domain::{Direction, Quantity};
use crate::numeric::random::half_open;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use std::path::PathBuf;

/// Upper bound on the directions that one call draws. Raising it costs memory.
const MAX_DIRECTIONS: u64 = 10_000_000;

#[derive(Debug, clap::Args)]
#[command(after_help = NUMBERS)]
pub(crate) struct Args {
    /// Material (compressed measurement) to draw directions from, or a measurement, which is compressed in memory
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// Incoming direction: polar angle and azimuth in degrees, for quantities that have one
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    #[arg(conflicts_with = "directions")]
    wi: Option<Direction>,
    /// Number of directions to draw
    #[arg(short = 'n', long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_DIRECTIONS))]
    #[arg(required_unless_present = "directions", conflicts_with = "directions")]
    count: Option<u64>,
    /// Table instead of --wi, -n and --seed, one drawn direction for each row: a CSV with column names in its first
    /// line, or a NumPy array [rows, columns]; - is stdin. Columns are `theta_i, phi_i` in degrees, if the quantity has
    /// them, and random numbers u1, u2 from 0 to less than 1, in this order in an array. Answers are `theta_o, phi_o,
    /// pdf, weight`; nan, nan, 0, 0 if nothing is drawn
    #[arg(long, value_name = "FILE.csv|npy|-")]
    directions: Option<PathBuf>,
    #[command(flatten)]
    batch: BatchArgs,
    /// Seed of the random numbers; equal seeds give equal directions on every machine
    #[arg(long, default_value_t = 0, conflicts_with = "directions")]
    seed: u64,
    /// Subdivision level of the triangles from which directions are drawn; a lower one is coarser [default: the
    /// material's own]
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_LEVEL)))]
    level: Option<u8>,
    /// Entry to use on each leading index axis (columns of a table, scan positions), counted from 0
    #[arg(long, value_name = "I,...", value_parser = query::index)]
    index: Option<List<usize>>,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// No effect, since the answer is always JSON; accepted because other commands have this option
    #[arg(long, hide = true)]
    json: bool,
}

/// Drawn directions `[theta, phi]` in degrees, of a luminaire also as `[C, gamma]`, their probability densities in 1/sr
/// and their weights, as parallel arrays. Where nothing is emitted or reflected, the direction is null and the numbers
/// are 0.
#[derive(Default, serde::Serialize)]
struct Answer {
    directions: Vec<Option<[f64; 2]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    c_gamma: Option<Vec<Option<[f64; 2]>>>,
    pdf: Vec<f64>,
    weight: Vec<f64>,
    /// Unit of the weights, and of their mean: the flux or albedo.
    weight_unit: &'static str,
    /// True if the incoming direction lies beyond the measured angles.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    extrapolated: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    compressed_in_memory: Option<Made>,
}

impl Args {
    pub(super) fn outputs(&self) -> Option<Outputs> {
        self.batch.outputs()
    }
}

/// Text below the options, on the numbers that the command prints.
const NUMBERS: &str = "pdf is the density of a drawn direction in 1/sr. weight is the value of the material in it, times \
    |cos theta_o| for BRDF, BTDF and BSDF, divided by pdf; the value is the mean over the wavelengths, each counted alike \
    whatever its distance to the next. The mean of many weights is the flux of a light or the albedo of a surface; \
    weight_unit is their unit, such as mW/nm for a lamp in mW/sr/nm and 1 for a BRDF";

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    args.threads.run(|| answer(args))?
}

fn answer(args: &Args) -> Result<(), Failure> {
    let (material, made) = Opened::open(&args.material)?;
    let index = args.index.as_ref().map_or(&[][..], |index| &index.0);
    if let Some(table) = &args.directions {
        let names = ["theta_o", "phi_o", "pdf", "weight"].map(str::to_owned).to_vec();
        let queries = Queries::drawn(table, &material)?;
        return args.batch.answer(queries, &names, &material, |rows, out| {
            let mut drawn = vec![None; rows.len()];
            material.samples(index, rows.wi(), rows.points(), args.level, &mut drawn)?;
            for (out, drawn) in out.as_chunks_mut::<4>().0.iter_mut().zip(drawn) {
                *out = drawn.map_or([f32::NAN, f32::NAN, 0.0, 0.0], |s| {
                    let direction = s.direction;
                    [direction.theta_degrees(), direction.phi_degrees(), s.pdf, s.weight].map(|number| number as f32)
                });
            }
            Ok(())
        });
    }
    args.batch.check_unused()?;
    let mut random = Pcg64Mcg::seed_from_u64(args.seed);
    let is_luminaire = material.quantity() == Quantity::Edf;
    let mut answer = Answer {
        c_gamma: is_luminaire.then(Vec::new),
        weight_unit: material.unit().over_directions(),
        extrapolated: material.is_extrapolated(args.wi, None),
        compressed_in_memory: made,
        ..Answer::default()
    };
    for _ in 0..args.count.unwrap_or(0) {
        let u = [half_open(&mut random), half_open(&mut random)];
        let drawn = material.sample(index, args.wi, u, args.level);
        let drawn = drawn.map_err(|error| Failure::from(error).about(&args.material))?;
        answer.directions.push(drawn.map(|s| [s.direction.theta_degrees(), s.direction.phi_degrees()]));
        if let Some(angles) = &mut answer.c_gamma {
            angles.push(drawn.map(|s| s.direction.luminaire_degrees()));
        }
        answer.pdf.push(drawn.map_or(0.0, |s| s.pdf));
        answer.weight.push(drawn.map_or(0.0, |s| s.weight));
    }
    print_json(&answer)
}
