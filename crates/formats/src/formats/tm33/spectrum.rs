//! Spectrum of an emitter as the file lists it, and its join with the intensities.

use super::about::NAME;
use super::distribution::{Distribution, Metric};
use super::words::number_of;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::domain::{Axis, Quantity, Sampling, Tensor, Unit, WavelengthGrid};
use crate::formats::acquisition::{Acquisition, ParseReport, Samples};
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::instrument::Instrument;
use crate::formats::photometry::attach_spectrum;
use crate::formats::text::{Brief, Source};
use crate::formats::tm27::{Point, ordered};
use crate::notes::LuminaireNote;
use crate::numeric::bracket::polyline;

/// Spectrum of an emitter as the file lists it.
#[derive(Default)]
pub(super) struct Listed {
    offset: usize,
    points: Vec<Point>,
    wavelengths: Vec<f64>,
    values: Vec<f64>,
    /// First wavelength and step in nm, where the file does not list the wavelengths.
    even: [Option<f64>; 2],
    units: String,
    is_quantum: bool,
}

impl Listed {
    pub(super) fn new(offset: usize) -> Self {
        Self { offset, ..Self::default() }
    }

    /// Takes a value at a wavelength in nm.
    pub(super) fn push(
        &mut self,
        wavelength: f64,
        value: f64,
        offset: usize,
        source: &Source,
    ) -> Result<(), FormatError> {
        if self.points.len() >= MAX_WAVELENGTHS {
            return Err(too_many(offset, source));
        }
        self.points.push(point(wavelength, value, offset, source)?);
        Ok(())
    }

    /// Takes the text of the element `name` of the spectrum.
    pub(super) fn set(&mut self, name: &str, text: &str, offset: usize, source: &Source) -> Result<(), FormatError> {
        let number = |word: &str| number_of(word, name, offset, source);
        let list = || text.split_whitespace().map(number).collect::<Result<Vec<f64>, FormatError>>();
        match name {
            "Wavelengths" => self.wavelengths = list()?,
            "Values" => self.values = list()?,
            "StartWavelength" => self.even[0] = Some(number(text)?),
            "WavelengthInterval" => self.even[1] = Some(number(text)?),
            "Units" => text.clone_into(&mut self.units),
            "Quantum" => self.is_quantum = number(text)? != 0.0,
            _ => {}
        }
        Ok(())
    }

    /// Returns true if the file lists values of the spectrum.
    pub(super) fn has_values(&self) -> bool {
        !self.points.is_empty() || !self.values.is_empty()
    }

    /// Returns the wavelengths and values of the spectrum, from either of the forms in which files list them.
    fn points(self, source: &Source) -> Result<Vec<Point>, FormatError> {
        let Self { offset, mut points, mut wavelengths, values, even, .. } = self;
        if let (true, [Some(first), Some(step)]) = (wavelengths.is_empty(), even) {
            wavelengths = (0..values.len()).map(|i| first + i as f64 * step).collect();
        }
        if wavelengths.len() != values.len() {
            let message = format!("{} wavelengths and {} values, expected as many", wavelengths.len(), values.len());
            return Err(source.malformed(offset, message));
        }
        if points.len() + values.len() > MAX_WAVELENGTHS {
            return Err(too_many(offset, source));
        }
        for (wavelength, value) in wavelengths.into_iter().zip(values) {
            points.push(point(wavelength, value, offset, source)?);
        }
        Ok(points)
    }

    /// Returns the reason why the spectrum is not joined with intensities, if it counts or may count photons.
    fn refusal(&self) -> Option<String> {
        let units = self.units.to_lowercase();
        let counts = ["photon", "mol", "quant"].iter().any(|word| units.contains(word));
        if counts {
            return Some("it counts photons, expected energy".to_owned());
        }
        self.is_quantum.then(|| "its Quantum says that it may count photons, expected energy".to_owned())
    }
}

fn too_many(offset: usize, source: &Source) -> FormatError {
    source.error(FormatErrorKind::OverLimit, offset, format!("more than {MAX_WAVELENGTHS} wavelengths"))
}

fn point(wavelength: f64, value: f64, offset: usize, source: &Source) -> Result<Point, FormatError> {
    if wavelength <= 0.0 {
        let message = format!("wavelength {}, expected a positive number of nm", Brief(wavelength));
        return Err(source.malformed(offset, message));
    }
    let value = Some(value as f32).filter(|value| value.is_finite());
    let value = value.ok_or_else(|| {
        source.malformed(offset, format!("a value at {} nm, expected one within float32", Brief(wavelength)))
    })?;
    Ok(Point { wavelength, value, offset })
}

/// Joins the intensities of a distribution with the spectrum that its emitter lists. Several spectra and those that
/// count photons are left out with a note. `is_wanted` is false if the user asks for intensities in a unit.
pub(super) fn join(
    acquisition: &mut Acquisition,
    distribution: &Distribution,
    spectra: Vec<Listed>,
    is_wanted: bool,
    source: &Source,
) -> Result<(), FormatError> {
    let mut listed = spectra.into_iter().filter(Listed::has_values);
    let (Some(first), others) = (listed.next(), listed.count()) else { return Ok(()) };
    let reason = if !is_wanted {
        Some("a unit of the intensities was asked for".to_owned())
    } else if others > 0 {
        Some(format!("{} spectra, expected one", others + 1))
    } else {
        first.refusal()
    };
    if let Some(reason) = reason {
        acquisition.report.note(LuminaireNote::SpectrumLeftOut { reason });
        return Ok(());
    }
    let mut report = ParseReport::default();
    let (wavelengths, values) = ordered(first.points(source)?, source, &mut report)?;
    let part = match distribution.metric {
        Metric::Luminous => Some((wavelengths, values)),
        metric => within(&wavelengths, values, metric, distribution.range, &mut acquisition.report),
    };
    let Some((wavelengths, values)) = part else {
        let reason = "it lies outside the range of wavelengths of the intensities".to_owned();
        acquisition.report.note(LuminaireNote::SpectrumLeftOut { reason });
        return Ok(());
    };
    let refuse = |message: String| source.malformed(distribution.offset, message);
    let grid = WavelengthGrid::listed(wavelengths).map_err(|error| refuse(error.to_string()))?;
    let tensor = Tensor::new(vec![Axis::Wavelength(grid)], values).map_err(|error| refuse(error.to_string()))?;
    let spectrum = Acquisition {
        format: NAME,
        dialect: String::new(),
        quantity: Quantity::Spectrum,
        unit: Unit::Relative,
        samples: Samples::OnAxes { tensor, sampling: Sampling::default() },
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    };
    let unit = acquisition.unit;
    attach_spectrum(acquisition, &spectrum).map_err(|error| FormatError {
        message: format!("{}; ask for the unit {unit} to leave the spectrum of the file out", error.message),
        ..error
    })?;
    acquisition.report.note(LuminaireNote::SpectrumOfFile { unit });
    Ok(())
}

/// Returns the part of a spectrum within the range of wavelengths of radiant or photon intensities, `None` if there is
/// none. Energy becomes a number of photons for the latter.
fn within(
    wavelengths: &[f64],
    values: Vec<f32>,
    metric: Metric,
    range: [Option<f64>; 2],
    report: &mut ParseReport,
) -> Option<(Vec<f64>, Vec<f32>)> {
    let values: Vec<f64> = values.into_iter().map(f64::from).collect();
    let (&first, &last) = wavelengths.first().zip(wavelengths.last())?;
    let (low, high) = (range[0].unwrap_or(first).max(first), range[1].unwrap_or(last).min(last));
    if low >= high {
        return None;
    }
    if low > first || high < last {
        report.note(LuminaireNote::SpectrumCut { first_nm: Brief(low), last_nm: Brief(high) });
    }
    let mut cut: Vec<f64> = wavelengths.iter().copied().filter(|nm| (low..=high).contains(nm)).collect();
    cut.extend([low, high]);
    cut.sort_by(f64::total_cmp);
    cut.dedup();
    let of = |nm: f64| polyline(wavelengths, &values, nm) * if metric == Metric::Photon { nm } else { 1.0 };
    let values = cut.iter().map(|&nm| of(nm) as f32).collect();
    Some((cut, values))
}
