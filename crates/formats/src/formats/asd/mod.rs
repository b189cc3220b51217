//! Binary files of ASD's spectrometers (`.asd`, versions 1 to 8): one spectrum and its white reference.
//!
//! The instrument stores raw counts of the target and of the white reference, in whichever quantity it showed them.
//! Reflectance is the quotient of both; integration time and gains are stated once and cancel.

mod about;
mod header;
mod reference;
#[cfg(test)]
mod tests;

use super::acquisition::{Acquisition, ParseReport};
use super::error::{FormatError, FormatErrorKind, Position};
use super::interpretation::Interpretation;
use super::reader::{FACTOR, Reader, Sample};
use super::spectra::{Spectra, other_quantity};
use super::stated::StatedQuantity;
use super::text::{Brief, is_text};
use crate::domain::{Quantity, WavelengthGrid};
use crate::notes::SpectrumNote;
use about::{ABOUT, NAME};
use header::{Header, Kind, LENGTH};
use reference::Arrays;

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &[FACTOR],
    probe: |sample: &Sample<'_>| if is_asd(sample) { 100 } else { 0 },
    read,
};

/// Largest radiance in W/m²/sr/nm, or irradiance in W/m²/nm, that is believed; only the disc of the sun is brighter.
/// Larger numbers are counts; raising it takes more counts for light.
const BRIGHTEST: f64 = 100.0;
/// Largest value of a spectrum that cannot be counts beside a white reference above [`BRIGHTEST`]: it was divided by
/// the reference already. Raising it refuses more dark samples.
const FAINTEST: f64 = 2.0;
/// Step between two detectors, in per cent of the value, from which it is remarked upon. Raising it hides more steps.
const STEP_PERCENT: f64 = 1.0;

fn is_asd(sample: &Sample<'_>) -> bool {
    let start = &sample.bytes[..sample.bytes.len().min(LENGTH)];
    // Text that begins with these letters may be padded with zeros, but has no other control characters.
    header::version(start).is_some() && start.contains(&0) && (start.len() < LENGTH || !is_text(&sample.head))
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let header = header::read(bytes)?;
    let arrays = reference::read(bytes, &header)?;
    let mut report = ParseReport::default();
    report.metadata.clone_from(&header.fields);
    if !arrays.description.is_empty() {
        report.metadata.push(("description".to_owned(), arrays.description.clone()));
    }
    let (quantity, values) = values(&header, &arrays, how, &mut report)?;
    if !header.saturated.is_empty() {
        report.note(SpectrumNote::DetectorsSaturated { detectors: header.saturated.join(", ") });
    }
    steps(&header, &values, &mut report);
    if arrays.rest > 0 {
        report.note(SpectrumNote::BytesAfterSpectra { bytes: arrays.rest });
    }
    let wavelengths = WavelengthGrid::even(header.first, header.step, header.channels).map_err(|error| {
        FormatError::at_byte(
            FormatErrorKind::Malformed,
            NAME,
            LENGTH,
            format!("{error}, expected wavelengths in nm that rise"),
        )
    })?;
    let narrowed = |value: f64| Some(value as f32).filter(|value| value.is_finite()).unwrap_or(f32::NAN);
    let spectra = Spectra {
        format: NAME,
        place: Position::Byte(LENGTH),
        dialect: format!(
            "version {}, {} wavelengths, saved as {}",
            header.version,
            header.channels,
            header.kind.name()
        ),
        quantity,
        wavelengths,
        names: vec!["spectrum".to_owned()],
        values: values.into_iter().map(narrowed).collect(),
    };
    spectra.acquisition(how, report)
}

/// Returns the quantity and the values of a file, with notes on what is assumed of them.
fn values(
    header: &Header,
    arrays: &Arrays,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<(StatedQuantity, Vec<f64>), FormatError> {
    use StatedQuantity::{Reflectance, ReflectanceFactor, Spectrum};
    let is_light = matches!(header.kind, Kind::Radiance | Kind::Irradiance);
    let is_ratio = matches!(header.kind, Kind::Raw | Kind::Reflectance | Kind::Transmittance);
    match how.quantity {
        None if is_light => light(header, arrays, report).map(|values| (Spectrum, values)),
        Some(Spectrum) => {
            kept(header, arrays, report);
            Ok((Spectrum, arrays.spectrum.clone()))
        }
        None | Some(Reflectance | ReflectanceFactor) if is_ratio || is_light => {
            let values = ratio(header, arrays, report)?;
            report.note(SpectrumNote::RelativeToPanel);
            match how.quantity {
                Some(ReflectanceFactor) => report.note(SpectrumNote::FactorsAsAsked),
                None if header.kind != Kind::Transmittance => report.note(SpectrumNote::FactorsKept),
                _ => {}
            }
            Ok((how.quantity.unwrap_or(Reflectance), values))
        }
        None | Some(Reflectance | ReflectanceFactor) => Err(unsupported(format!(
            "the file was saved as {}, expected raw counts, reflectance, transmittance, radiance or irradiance: save it as \
             reflectance in the instrument's program, or export it as text (quantity spectrum keeps the numbers as they are)",
            header.kind.name()
        ))),
        Some(other) => {
            Err(other_quantity(other, "reflectance, reflectance-factor or spectrum: the file holds one spectrum", NAME))
        }
    }
}

fn unsupported(message: String) -> FormatError {
    FormatError::new(FormatErrorKind::Unsupported, NAME, message)
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().filter(|value| value.is_finite()).fold(0.0, f64::max)
}

/// Returns the spectrum of a file that was saved as radiance or irradiance, unless its numbers are counts.
fn light(header: &Header, arrays: &Arrays, report: &mut ParseReport) -> Result<Vec<f64>, FormatError> {
    let found = largest(&arrays.spectrum);
    if found > BRIGHTEST {
        let way_out = match arrays.reference {
            Some(_) => "quantity reflectance divides them by the white reference",
            None => "quantity spectrum keeps the counts",
        };
        return Err(unsupported(format!(
            "values up to {}, raw counts of a file that was saved as {}, expected at most {BRIGHTEST}: export the spectrum \
             as text from the instrument's program, which applies the calibration ({way_out})",
            Brief(found),
            header.kind.name()
        )));
    }
    kept(header, arrays, report);
    Ok(arrays.spectrum.clone())
}

/// Notes in which quantity the numbers of the spectrum are kept.
fn kept(header: &Header, arrays: &Arrays, report: &mut ParseReport) {
    let is_calibrated = largest(&arrays.spectrum) <= BRIGHTEST;
    let note = match header.kind {
        Kind::Radiance if is_calibrated => SpectrumNote::LightKept { what: "radiance in W/m²/sr/nm" },
        Kind::Irradiance if is_calibrated => SpectrumNote::LightKept { what: "irradiance in W/m²/nm" },
        Kind::Raw | Kind::Reflectance | Kind::Transmittance | Kind::Radiance | Kind::Irradiance
            if !is_quotient(header) =>
        {
            dark(header, report);
            SpectrumNote::SignalKept
        }
        other => {
            let (asked, held) = (Quantity::Spectrum.to_string(), other.name().to_owned());
            SpectrumNote::QuantityAsAsked { asked, held }
        }
    };
    report.note(note);
}

/// Returns true for a file of version 1 that was saved as reflectance or transmittance: it holds the quotient itself.
fn is_quotient(header: &Header) -> bool {
    header.version == 1 && matches!(header.kind, Kind::Reflectance | Kind::Transmittance)
}

fn dark(header: &Header, report: &mut ParseReport) {
    if !header.is_dark_corrected {
        report.note(SpectrumNote::DarkNotSubtracted);
    }
}

/// Returns the spectrum divided by the white reference, or as it is where the file holds the quotient itself.
fn ratio(header: &Header, arrays: &Arrays, report: &mut ParseReport) -> Result<Vec<f64>, FormatError> {
    let Some(reference) = &arrays.reference else {
        if is_quotient(header) {
            return Ok(arrays.spectrum.clone());
        }
        let message = format!(
            "{} without a white reference in the file, which are no reflectance: export the spectrum as reflectance, radiance \
             or irradiance from the instrument's program, or say quantity spectrum, which keeps the numbers",
            header.kind.name()
        );
        return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    };
    if largest(&arrays.spectrum) < FAINTEST && largest(reference) > BRIGHTEST {
        return Err(unsupported(format!(
            "values up to {} beside a white reference up to {}, expected counts in both: export the spectrum as text from the \
             instrument's program",
            Brief(largest(&arrays.spectrum)),
            Brief(largest(reference))
        )));
    }
    let zeros = reference.iter().filter(|white| **white == 0.0).count();
    if zeros == reference.len() {
        return Err(unsupported(format!(
            "a white reference of zeros beside {}, expected its counts: export the spectrum as text from the instrument's \
             program",
            header.kind.name()
        )));
    }
    if header.kind == Kind::Raw {
        report.note(SpectrumNote::CountsDivided);
    }
    dark(header, report);
    if zeros > 0 {
        report.note(SpectrumNote::ReferenceZero { values: zeros });
    }
    let divided = |(target, white): (&f64, &f64)| if *white == 0.0 { f64::NAN } else { target / white };
    Ok(arrays.spectrum.iter().zip(reference).map(divided).collect())
}

/// Notes steps of the values between detectors: the difference of two neighbours that the slopes beside them do not
/// explain.
fn steps(header: &Header, values: &[f64], report: &mut ParseReport) {
    for splice in header.splices {
        let last = (splice - header.first) / header.step;
        if !(last >= 1.0 && last + 2.0 < values.len() as f64) {
            continue;
        }
        let last = last.floor() as usize;
        let [a, b, c, d] = [last - 1, last, last + 1, last + 2].map(|at| values.get(at).copied().unwrap_or(f64::NAN));
        let percent = 100.0 * ((c - b) - f64::midpoint(b - a, d - c)) / f64::midpoint(b, c).abs();
        if percent.is_finite() && percent.abs() > STEP_PERCENT {
            let nm = |at: usize| Brief(header.first + at as f64 * header.step);
            let percent = Brief((percent * 10.0).round() / 10.0);
            report.note(SpectrumNote::DetectorStep { percent, from: nm(last), to: nm(last + 1) });
        }
    }
}
