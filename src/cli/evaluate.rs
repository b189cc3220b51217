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
    /// Material (compressed measurement) to evaluate
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// Incoming direction: polar angle and azimuth in degrees, for quantities that have one
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    #[arg(conflicts_with = "directions")]
    wi: Option<Direction>,
    /// Outgoing direction: polar angle and azimuth in degrees, for quantities that have one
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    #[arg(conflicts_with = "directions")]
    wo: Option<Direction>,
    /// Table of directions instead of --wi and --wo, one query for each row: a CSV with column names in its first line,
    /// or a NumPy array [rows, columns]; - is stdin. Columns are `theta_i, phi_i, theta_o, phi_o` in degrees, in this
    /// order in an array, without those that the quantity does not have
    #[arg(long, value_name = "FILE.csv|npy|-")]
    directions: Option<PathBuf>,
    #[command(flatten)]
    batch: BatchArgs,
    /// Entry to use on each leading index axis (columns of a table, scan positions), counted from 0
    #[arg(long, value_name = "I,...", value_parser = query::index)]
    index: Option<List<usize>>,
    /// Wavelengths in nm at which to evaluate [default: those of the material]
    #[arg(long, value_name = "START:STOP:STEP|A,B,...", value_parser = query::wavelengths)]
    wavelengths: Option<List<f64>>,
    /// Interpolation between the stored directions of the material
    #[arg(long, value_enum, default_value_t)]
    interpolation: How,
    /// Values that the answer contains at wavelengths outside the measured range
    #[arg(long, value_enum, default_value_t)]
    beyond: Outside,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// No effect, since the answer is always JSON; accepted because other commands have this option
    #[arg(long, hide = true)]
    json: bool,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum How {
    /// Value of the nearest direction on a grid of angles, or of the triangle that contains the direction.
    Constant,
    /// Interpolation that is continuous over directions; on a grid of angles cubic or linear, as the material states.
    #[default]
    Smooth,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum Outside {
    /// No value at wavelengths outside the measured range: null in JSON, NaN in tables.
    #[default]
    Masked,
    /// Value 0 at wavelengths outside the measured range.
    Zero,
    /// Value at the first or last measured wavelength, whichever is nearer.
    Nearest,
}

/// Spectrum of a material for one pair of directions; unknown values are null.
#[derive(serde::Serialize)]
struct Answer {
    wavelengths: Option<Vec<f64>>,
    values: Vec<f32>,
    unit: Unit,
    /// True if the polar angle of the incoming direction exceeds the largest measured one.
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

/// Evaluates one spectrum for each row of a table of directions.
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
