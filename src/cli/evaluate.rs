//! `wavelume evaluate`: one spectrum of a material, or one for each row of a table of directions.

use super::batch::{BatchArgs, Queries};
use super::declared::{argument, declared_args, refusal, stated};
use super::failure::Failure;
use super::guard::Outputs;
use super::opened::{Made, Opened};
use super::output::print_json;
use super::query::{self, List, LuminaireArgs};
use super::request::ThreadsArgs;
use crate::domain::{Axis, Direction, Unit};
use crate::evaluate::{BEYOND, Beyond, INTERPOLATION, Interpolation, Material, Pairs, Place};
use clap::{ArgMatches, Command};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) to evaluate, or a measurement, which is compressed in memory
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
    #[command(flatten)]
    luminaire: LuminaireArgs,
    /// Table of directions instead of --wi and --wo, one query for each row: a CSV with column names in its first line,
    /// or a NumPy array [rows, columns]; - is stdin. Columns are `theta_i, phi_i, theta_o, phi_o` in degrees, in this
    /// order in an array, without those that the quantity does not have; of a luminaire also `c, gamma` in a CSV
    #[arg(long, value_name = "FILE.csv|npy|-", conflicts_with_all = ["c", "gamma"])]
    directions: Option<PathBuf>,
    #[command(flatten)]
    batch: BatchArgs,
    /// Entry to use on each leading index axis (columns of a table, scan positions), counted from 0
    #[arg(long, value_name = "I,...", value_parser = query::index)]
    index: Option<List<usize>>,
    /// Wavelengths in nm at which to evaluate [default: those of the material]
    #[arg(long, value_name = "START:STOP:STEP|A,B,...", value_parser = query::wavelengths)]
    wavelengths: Option<List<f64>>,
    #[command(flatten)]
    options: OptionArgs,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// No effect, since the answer is always JSON; accepted because other commands have this option
    #[arg(long, hide = true)]
    json: bool,
}

/// Command-line options of an evaluation, derived from their shared declarations.
#[derive(Clone, Copy, Debug)]
struct OptionArgs {
    interpolation: Interpolation,
    beyond: Beyond,
}

declared_args!(OptionArgs);

impl OptionArgs {
    fn arguments(command: Command) -> Command {
        command.args([&INTERPOLATION, &BEYOND].map(argument))
    }

    fn read(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let [interpolation, beyond] = [&INTERPOLATION, &BEYOND].map(|option| stated(matches, option));
        Ok(Self { interpolation: chosen(interpolation)?, beyond: chosen(beyond)? })
    }
}

/// Returns the chosen value of an option, or its default if none is stated.
fn chosen<T: DeserializeOwned + Default>(stated: Option<Value>) -> Result<T, clap::Error> {
    stated.map_or_else(|| Ok(T::default()), |value| serde_json::from_value(value).map_err(refusal))
}

/// Spectrum of a material for one pair of directions; unknown values are null.
#[derive(serde::Serialize)]
struct Answer {
    wavelengths: Option<Vec<f64>>,
    values: Vec<f32>,
    unit: Unit,
    /// True if a direction lies beyond the measured angles, where the values of the last ones are continued.
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

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let (material, compressed_in_memory) = args.threads.run(|| Opened::open(&args.material))??;
    let about = |error| Failure::from(error).about(&args.material);
    let index = args.index.as_ref().map_or(&[][..], |index| &index.0);
    let wo = args.luminaire.outgoing(args.wo, &material).map_err(|failure| failure.about(&args.material))?;
    let place = Place { index, wi: args.wi, wo };
    let OptionArgs { interpolation: how, beyond } = args.options;
    if let Some(table) = &args.directions {
        return args.threads.run(|| rows(args, table, &material, how, beyond))?;
    }
    args.batch.check_unused()?;
    let (unit, extrapolated) = (material.unit(), material.is_extrapolated(args.wi, wo));
    let Some(List(wavelengths)) = &args.wavelengths else {
        let mut values = vec![0.0; material.lambdas()];
        material.evaluate(place, how, &mut values).map_err(about)?;
        let wavelengths = material.wavelengths();
        return print_json(&Answer { wavelengths, values, unit, extrapolated, compressed_in_memory });
    };
    let mut values = vec![0.0; wavelengths.len()];
    material.at_wavelengths(place, how, beyond, wavelengths, &mut values).map_err(about)?;
    let wavelengths = Some(wavelengths.clone());
    print_json(&Answer { wavelengths, values, unit, extrapolated, compressed_in_memory })
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
    args.batch.answer(queries, &names, material, |rows, out| {
        let pairs = Pairs { index, wi: rows.wi(), wo: rows.wo() };
        match wavelengths {
            Some(wavelengths) => material.spectra_at(pairs, how, beyond, wavelengths, out),
            None => material.par_spectra(pairs, how, out),
        }
    })
}
