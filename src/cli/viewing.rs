//! Illuminant and observer of a material: names, or files of spectral tables and materials.

use super::failure::Failure;
use super::input::read_file;
use crate::compress;
use crate::domain::Tensor;
use crate::domain::colour::{Illuminant, StandardObserver};
use crate::formats::{self, Interpretation, Samples};
use crate::preview::Viewing;
use std::path::Path;

#[derive(Debug, clap::Args)]
pub(crate) struct ViewingArgs {
    /// Illuminant: A, B, C, D50, D65, F11 or E, or a file with its spectrum: a table or a material [default: D65]
    #[arg(long, value_name = "NAME|FILE")]
    illuminant: Option<String>,
    /// Column of the illuminant in the table of --illuminant, by name or by number from 1
    #[arg(long, value_name = "COLUMN", requires = "illuminant")]
    illuminant_column: Option<String>,
    /// CIE standard observer: 1931 (2 degrees) or 1964 (10 degrees), or a file with the columns wavelength, x, y, z
    /// [default: 1931]
    #[arg(long, value_name = "NAME|FILE")]
    observer: Option<String>,
}

impl ViewingArgs {
    /// Builds the illuminant and the observer for computing colours, from known names or from files.
    pub(crate) fn viewing(&self) -> Result<Viewing, Failure> {
        let known_observer = self.observer.as_deref().map(str::parse::<StandardObserver>);
        let known_light = self.illuminant.as_deref().map(str::parse::<Illuminant>);
        let observer = known_observer.as_ref().and_then(|name| name.as_ref().ok());
        let light = known_light.as_ref().and_then(|name| name.as_ref().ok());
        let mut viewing = Viewing::standard(light.copied().unwrap_or_default(), observer.copied().unwrap_or_default());
        if let (Some(name), None) = (&self.observer, observer) {
            let table = table(name, "observer", StandardObserver::ALL.iter().map(|o| o.name()))?;
            viewing = viewing.seen_by(&shown(name), &table).map_err(|e| Failure::usage(e).about(Path::new(name)))?;
        }
        match (&self.illuminant, light) {
            (Some(name), None) => {
                let table = table(name, "illuminant", Illuminant::ALL.iter().map(|i| i.name()))?;
                let column = self.illuminant_column.as_deref();
                viewing.under(&shown(name), &table, column).map_err(|e| Failure::usage(e).about(Path::new(name)))
            }
            (Some(_), Some(light)) if self.illuminant_column.is_some() => {
                Err(Failure::usage(format!("--illuminant-column was given, but {light} is no table")))
            }
            _ => Ok(viewing),
        }
    }
}

/// Reads the spectral table of an illuminant or observer from the file `name`; refuses a name that is neither known nor
/// a file.
fn table(name: &str, what: &str, known: impl Iterator<Item = &'static str>) -> Result<Tensor, Failure> {
    let path = Path::new(name);
    if !path.exists() {
        let known = known.collect::<Vec<_>>().join(", ");
        return Err(Failure::usage(format!("unknown {what} `{name}`, expected one of {known}, or a file")));
    }
    let bytes = read_file(path)?;
    if compress::is_material(&bytes) {
        return Ok(compress::decode(&bytes).map_err(|e| Failure::from(e).about(path))?.measurement.tensor);
    }
    let read = formats::read(&bytes, &Interpretation::default()).map_err(|e| Failure::failed(e).about(path))?;
    match read.samples {
        Samples::OnAxes { tensor, .. } => Ok(tensor),
        Samples::Grid(_) | Samples::Scattered(_) | Samples::Function(_) => {
            Err(Failure::usage(format!("the file has a {} of directions, expected a spectral table", read.quantity))
                .about(path))
        }
    }
}

/// Returns the file's name without its directories, for reports.
fn shown(name: &str) -> String {
    Path::new(name).file_name().map_or_else(|| name.to_owned(), |file| file.to_string_lossy().into_owned())
}
