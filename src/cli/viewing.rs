//! Illuminant and observer of a material: names, or files of spectral tables and materials.

use super::failure::Failure;
use super::input::read_file;
use crate::compress;
use crate::domain::Tensor;
use crate::domain::colour::{Illuminant, StandardObserver};
use crate::formats::{self, Interpretation, Samples};
use crate::preview::Viewing;
use std::path::{Path, PathBuf};
use std::str::FromStr;

#[derive(Debug, clap::Args)]
pub(crate) struct ViewingArgs {
    /// Illuminant: A, B, C, D50, D65, F11 or E, or a file with its spectrum: a table or a material [default: D65]
    #[arg(long, value_name = "NAME|FILE")]
    illuminant: Option<PathBuf>,
    /// Column of the illuminant in the table of --illuminant, by name or by number from 1
    #[arg(long, value_name = "COLUMN", requires = "illuminant")]
    illuminant_column: Option<String>,
    /// CIE standard observer: 1931 (2 degrees) or 1964 (10 degrees), or a file with the columns wavelength, x, y, z
    /// [default: 1931]
    #[arg(long, value_name = "NAME|FILE")]
    observer: Option<PathBuf>,
}

impl ViewingArgs {
    /// Builds the illuminant and the observer for computing colours, from known names or from files.
    pub(crate) fn viewing(&self) -> Result<Viewing, Failure> {
        let observer: Option<StandardObserver> = self.observer.as_deref().and_then(named);
        let light: Option<Illuminant> = self.illuminant.as_deref().and_then(named);
        let mut viewing = Viewing::standard(light.unwrap_or_default(), observer.unwrap_or_default());
        if let (Some(file), None) = (&self.observer, observer) {
            let table = table(file, "observer", StandardObserver::ALL.iter().map(|o| o.name()))?;
            viewing = viewing.seen_by(&shown(file), &table).map_err(|e| Failure::usage(e).about(file))?;
        }
        match (&self.illuminant, light) {
            (Some(file), None) => {
                let table = table(file, "illuminant", Illuminant::ALL.iter().map(|i| i.name()))?;
                let column = self.illuminant_column.as_deref();
                viewing.under(&shown(file), &table, column).map_err(|e| Failure::usage(e).about(file))
            }
            (Some(_), Some(light)) if self.illuminant_column.is_some() => {
                Err(Failure::usage(format!("--illuminant-column was given, but {light} is no table")))
            }
            _ => Ok(viewing),
        }
    }
}

/// Returns the illuminant or observer that the value of an option names; `None` if it is a file.
fn named<T: FromStr>(name: &Path) -> Option<T> {
    name.to_str()?.parse().ok()
}

/// Reads the spectral table of an illuminant or observer from the file `path`; refuses a name that is neither known nor
/// a file.
fn table(path: &Path, what: &str, known: impl Iterator<Item = &'static str>) -> Result<Tensor, Failure> {
    if !path.exists() {
        let (name, known) = (path.display(), known.collect::<Vec<_>>().join(", "));
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
fn shown(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
