//! `wavelume evaluate`: one spectrum of a material, or one for each row of a table of directions.

use super::batch::{BatchArgs, Queries};
use super::failure::Failure;
use super::output::print_json;
use super::query::{self, List};
use super::request::ThreadsArgs;
use crate::domain::{Axis, Direction, Unit};
use crate::evaluate::{Beyond, Interpolation, Material, Pairs, Place};
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material to evaluate
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// Incoming direction in degrees, for quantities that have one
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    #[arg(conflicts_with = "directions")]
    wi: Option<Direction>,
    /// Outgoing direction in degrees, for quantities that have one
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    #[arg(conflicts_with = "directions")]
    wo: Option<Direction>,
    /// Table of directions instead of --wi and --wo, one query a row. Columns `theta_i, phi_i, theta_o, phi_o` in
    /// degrees, as far as the quantity has them: named in the first line of a CSV, in this order in a NumPy array
    /// [rows, columns]; - is stdin
    #[arg(long, value_name = "FILE.csv|npy|-")]
    directions: Option<PathBuf>,
    #[command(flatten)]
    batch: BatchArgs,
    /// Zero-based entry on each leading index axis
    #[arg(long, value_name = "I,...", value_parser = query::index)]
    index: Option<List<usize>>,
    /// Wavelengths in nm [default: the material's own]
    #[arg(long, value_name = "START:STOP:STEP|A,B,...", value_parser = query::wavelengths)]
    wavelengths: Option<List<f64>>,
    /// Interpolation over directions
    #[arg(long, value_enum, default_value_t)]
    interpolation: How,
    /// Values outside the measured range of wavelengths
    #[arg(long, value_enum, default_value_t)]
    beyond: Outside,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Taken for symmetry with the other commands: the answer is always JSON
    #[arg(long, hide = true)]
    json: bool,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum How {
    /// The sample of the nearest direction of a grid of angles, or of the triangle that holds the direction.
    Constant,
    /// Continuous over directions; on a grid of angles as the file says, cubic or linear.
    #[default]
    Smooth,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum Outside {
    /// Masked: null.
    #[default]
    Masked,
    /// Zero: no light.
    Zero,
    /// The sample at the end of the range.
    Nearest,
}

/// Answer to one query; masked values are null.
#[derive(serde::Serialize)]
struct Answer {
    wavelengths: Option<Vec<f64>>,
    values: Vec<f32>,
    unit: Unit,
    /// True if the incoming direction lies beyond the last measured elevation.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    extrapolated: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let material = query::open(&args.material)?;
    let about = |error| Failure::from(error).about(&args.material);
    let index = args.index.as_ref().map_or(&[][..], |index| &index.0);
    let place = Place { index, wi: args.wi, wo: args.wo };
    let how = match args.interpolation {
        How::Constant => Interpolation::Constant,
        How::Smooth => Interpolation::Smooth,
    };
    let beyond = match args.beyond {
        Outside::Masked => Beyond::Masked,
        Outside::Zero => Beyond::Zero,
        Outside::Nearest => Beyond::Nearest,
    };
    if let Some(table) = &args.directions {
        return args.threads.run(|| rows(args, table, &material, how, beyond))?;
    }
    args.batch.check_unused()?;
    let (unit, extrapolated) = (material.unit(), material.is_extrapolated(args.wi));
    let Some(List(wavelengths)) = &args.wavelengths else {
        let mut values = vec![0.0; material.lambdas()];
        material.evaluate(place, how, &mut values).map_err(about)?;
        return print_json(&Answer { wavelengths: material.wavelengths(), values, unit, extrapolated });
    };
    let mut values = vec![0.0; wavelengths.len()];
    material.at_wavelengths(place, how, beyond, wavelengths, &mut values).map_err(about)?;
    print_json(&Answer { wavelengths: Some(wavelengths.clone()), values, unit, extrapolated })
}

/// Evaluates spectra for the rows of a table.
fn rows(args: &Args, table: &Path, material: &Material, how: Interpolation, beyond: Beyond) -> Result<(), Failure> {
    let wavelengths = args.wavelengths.as_ref().map(|list| &list.0[..]);
    let names = match (wavelengths, material.axes().last()) {
        (Some(list), _) => list.iter().map(|nm| format!("v{nm}")).collect(),
        (None, Some(Axis::Wavelength(grid))) => grid.values().iter().map(|nm| format!("v{nm}")).collect(),
        (None, Some(Axis::Rgb)) => ["r", "g", "b"].map(str::to_owned).to_vec(),
        _ => vec!["value".to_owned()],
    };
    let index = args.index.as_ref().map_or(&[][..], |index| &index.0);
    let queries = Queries::evaluated(table, material)?;
    args.batch.answer(queries, &names, |rows, out| {
        let pairs = Pairs { index, wi: rows.wi(), wo: rows.wo() };
        match wavelengths {
            Some(wavelengths) => material.spectra_at(pairs, how, beyond, wavelengths, out),
            None => material.par_spectra(pairs, how, out),
        }
    })
}
