//! `wavelume evaluate`: one spectrum of a material.

use super::failure::Failure;
use super::output::print_json;
use super::query::{self, List};
use crate::domain::{Direction, Unit};
use crate::evaluate::{Beyond, Interpolation, Place};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The material
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// The incoming direction in degrees, for quantities that have one
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    wi: Option<Direction>,
    /// The outgoing direction in degrees, for quantities that have one
    #[arg(long, value_name = "THETA,PHI", value_parser = query::direction, allow_hyphen_values = true)]
    wo: Option<Direction>,
    /// One entry, from 0, for each leading index axis
    #[arg(long, value_name = "I,...", value_parser = query::index)]
    index: Option<List<usize>>,
    /// Wavelengths in nm [default: the material's own]
    #[arg(long, value_name = "START:STOP:STEP|A,B,...", value_parser = query::wavelengths)]
    wavelengths: Option<List<f64>>,
    /// The value of the cell, or a continuous function of direction
    #[arg(long, value_enum, default_value_t)]
    interpolation: How,
    /// What there is outside the measured range of wavelengths
    #[arg(long, value_enum, default_value_t)]
    beyond: Outside,
    /// Taken for symmetry with the other commands: the answer is always JSON
    #[arg(long, hide = true)]
    json: bool,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum How {
    /// The value of the triangle that holds the direction.
    Constant,
    /// Continuous over directions.
    #[default]
    Smooth,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum Outside {
    /// Nothing is known: null.
    #[default]
    Masked,
    /// No light.
    Zero,
    /// The sample at the end of the range.
    Nearest,
}

/// The answer; masked values are null.
#[derive(serde::Serialize)]
struct Answer {
    wavelengths: Option<Vec<f64>>,
    values: Vec<f32>,
    unit: Unit,
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
    let unit = material.unit();
    let Some(List(wavelengths)) = &args.wavelengths else {
        let mut values = vec![0.0; material.lambdas()];
        material.evaluate(place, how, &mut values).map_err(about)?;
        return print_json(&Answer { wavelengths: material.wavelengths(), values, unit });
    };
    let mut values = vec![0.0; wavelengths.len()];
    material.at_wavelengths(place, how, beyond, wavelengths, &mut values).map_err(about)?;
    print_json(&Answer { wavelengths: Some(wavelengths.clone()), values, unit })
}
