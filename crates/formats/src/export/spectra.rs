//! Spectra without directions: two columns, or CSV.

use super::error::{ExportError, OptionError, setting};
use super::exported::{Exported, Summary};
use super::fits::incoming;
use super::measure::AddedError;
use super::options::{ExportOptions, check_size};
use super::subject::{entry, wavelengths};
use super::writer::{Write, Writer};
use crate::domain::{Axis, ErrorReport, Quantity, WavelengthGrid};
use crate::evaluate::{Interpolation, Material, Place};
use crate::formats::{self, FormatError, FormatErrorKind, Interpretation, Samples, write_spd, write_spectra};

/// Writer of the export format `spd`: one spectrum in two columns.
pub(super) const SPD: Writer = Writer {
    name: "spd",
    other_names: &[],
    description: "one spectrum in two columns",
    extension: "spd",
    media_type: "text/plain",
    holds: "spectra without directions",
    fits: is_table,
    whole: None,
    options: &[],
    write: Write::Entry(spd),
};

/// Writer of the export format `csv`: spectra in columns.
pub(super) const CSV: Writer = Writer {
    name: "csv",
    other_names: &[],
    description: "spectra in columns",
    extension: "csv",
    media_type: "text/csv",
    holds: SPD.holds,
    fits: is_table,
    whole: None,
    options: &[],
    write: Write::Entries(csv),
};

/// Returns true for spectra without directions.
fn is_table(material: &Material) -> bool {
    let is_spectral = matches!(material.quantity(), Quantity::Spectrum | Quantity::Reflectance);
    is_spectral && incoming(material).is_none() && wavelengths(material).is_some()
}

fn spd(material: &Material, options: &ExportOptions) -> Result<Exported, ExportError> {
    let grid = grid(material)?;
    let index = entry(material, options);
    let samples = spectrum(material, &index)?;
    let comment = format!("{} in {}, wavelengths in nm", material.quantity(), material.unit());
    let bytes = write_spd(grid, &samples, &comment)?;
    let written: Vec<f32> = samples.iter().copied().filter(|sample| !sample.is_nan()).collect();
    let masked = samples.len() - written.len();
    let mut lost: Vec<String> =
        (masked > 0).then(|| format!("{masked} masked samples, which get no row in the file")).into_iter().collect();
    let entries: usize = material.axes()[..material.layout().indices].iter().map(Axis::len).product();
    if entries > 1 {
        lost.push(format!("{} of {entries} spectra", entries - 1));
    }
    finish(material, SPD.name, bytes, &written, 1, lost)
}

fn csv(material: &Material, options: &ExportOptions) -> Result<Exported, ExportError> {
    let grid = grid(material)?;
    let axes = &material.axes()[..material.layout().indices];
    let entries: Vec<Vec<usize>> = match &options.index {
        Some(index) => vec![index.clone()],
        None => (0..axes.iter().map(Axis::len).product()).map(|entry| material.index_of(entry)).collect(),
    };
    let mut samples = Vec::with_capacity(entries.len() * grid.len());
    for index in &entries {
        samples.extend(spectrum(material, index)?);
    }
    let names: Vec<String> = entries.iter().map(|index| name(material, axes, index)).collect();
    check_size(samples.len().checked_mul(4), options, "name one entry by its index")?;
    let bytes = write_spectra(grid, &samples, &names)?;
    finish(material, CSV.name, bytes, &samples, entries.len(), Vec::new())
}

fn grid(material: &Material) -> Result<&WavelengthGrid, ExportError> {
    wavelengths(material).map_or_else(|| setting(OptionError::NoWavelengths), Ok)
}

fn spectrum(material: &Material, index: &[usize]) -> Result<Vec<f32>, ExportError> {
    let mut samples = vec![0.0; material.lambdas()];
    material.evaluate(Place { index, wi: None, wo: None }, Interpolation::Constant, &mut samples)?;
    Ok(samples)
}

/// Returns the column name of a spectrum in an exported table: its labels on the index axes or its index numbers. A
/// single spectrum is named by its quantity.
fn name(material: &Material, axes: &[Axis], index: &[usize]) -> String {
    let parts: Vec<String> = axes
        .iter()
        .zip(index)
        .map(|(axis, &i)| match axis {
            Axis::Index { labels, .. } if !labels.is_empty() => labels[i].clone(),
            _ => i.to_string(),
        })
        .collect();
    if parts.is_empty() { material.quantity().to_string() } else { parts.join(" ") }
}

/// Reads the exported spectra back and compares every sample with the original.
fn finish(
    material: &Material,
    format: &'static str,
    bytes: Vec<u8>,
    samples: &[f32],
    spectra: usize,
    lost: Vec<String>,
) -> Result<Exported, ExportError> {
    // Read as a plain spectrum: a reflectance might be taken for percent.
    let how = Interpretation {
        quantity: Some(Quantity::Spectrum.into()),
        wavelength_unit: Some("nm".to_owned()),
        ..Interpretation::default()
    };
    let acquisition = formats::read(&bytes, &how)?;
    let found = match &acquisition.samples {
        Samples::OnAxes { tensor, .. } if tensor.len() == samples.len() => tensor.samples(),
        _ => {
            let message = "the written file does not read back as the same spectra, a bug of wavelume".to_owned();
            let kind = FormatErrorKind::Malformed;
            return Err(FormatError { kind, format: acquisition.format, position: None, message }.into());
        }
    };
    let error = AddedError::of("every sample", samples.len(), &ErrorReport::measure(samples, found, 0.0));
    let about = Summary {
        warning: None,
        format,
        resolution: format!("{spectra} spectra of {} samples", samples.len() / spectra),
        unit: material.unit().to_string(),
        lost,
        filled: 0,
        clipped: 0,
        flux_error: None,
        lamp: None,
        error,
    };
    Ok(Exported { bytes, about })
}
