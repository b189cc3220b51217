//! Tabulated phase functions: angle (or its cosine) and value, a list over the cosine, Legendre moments, and volume
//! scattering functions. Each becomes a function of two directions that integrates to 1 over the sphere.
//!
//! * Two columns or more: the scattering angle in degrees (0 = forward), then values, of which the first column is
//!   used. If all numbers of the first column lie in -1..1 and some are negative, they are cosines (+1 = forward).
//! * One line of numbers: values at evenly spaced cosines from -1 to 1 (the plug-in `tabphase` of Mitsuba 3).
//! * One number per line, the first equal to 1: moments k of `p(mu) = Σ (2m+1) k_m P_m(mu) / 4π`, with or without the
//!   factor 2m+1 (libRadtran, DISORT).
//!
//! The integral of the values determines their normalisation: 1 or 4π. On request it is arbitrary: a volume scattering
//! function in m⁻¹ sr⁻¹ integrates to the scattering coefficient b.

mod about;
mod columns;
mod function;
mod lists;
mod normalised;
mod refusal;
#[cfg(test)]
mod tests;

pub(super) use normalised::tabulated;

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::FormatError;
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::normalization::Normalization;
use super::reader::{Reader, Sample};
use super::spectral_table::layouts;
use super::text::{Brief, Source, is_text};
use crate::domain::{Quantity, Unit};
use crate::notes::PhaseNote;
use about::{ABOUT, NAME};
use columns::says_volume;
use normalised::{modelled, normalise};
use refusal::needs;

pub(super) const READER: Reader = Reader { about: ABOUT, options: &["column", "normalization"], probe, read };

/// Words in the header of a file that occur with phase functions only.
const WORDS: [&str; 7] =
    ["phase function", "phasefunction", "scattering angle", "scattering_angle", "legendre", "tabphase", "cos_theta"];
fn probe(sample: &Sample<'_>) -> u8 {
    if !is_text(&sample.head) {
        return 0;
    }
    let table = layouts::probe(&sample.head);
    // Ranks above a bare quantity name and above the probe of a spectral table, which returns 30.
    if sample.quantity == Some(Quantity::Phase) && (table > 0 || lists::is_line(&sample.head)) {
        return 48;
    }
    if sample.quantity == Some(Quantity::Phase) && sample.head.contains(|c: char| c.is_ascii_digit()) {
        return 5;
    }
    let mut prose = String::new();
    for line in sample.head.lines().take(40).filter(|line| line.contains(char::is_alphabetic)) {
        prose.push_str(&line.to_lowercase());
        prose.push('\n');
    }
    let said = WORDS.iter().any(|word| prose.contains(word)) || says_volume(&prose);
    if (said && table > 0) || (table >= 30 && lists::is_angular(&sample.head)) {
        return 40;
    }
    // A single row is not a spectrum unless it consists of pairs or its comments mention wavelengths.
    if lists::is_line(&sample.head) && (said || !lists::is_spectral(&sample.head, &prose)) {
        return 35;
    }
    if lists::is_moments(&sample.head) { 20 } else { 0 }
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    if let Some(other) = how.quantity().filter(|quantity| *quantity != Quantity::Phase) {
        return Err(needs(format!("quantity {other} was asked for, expected phase, which the file holds")));
    }
    if let Some(other) = how.unit.filter(|unit| *unit != Unit::PerSteradian) {
        return Err(needs(format!(
            "unit {other} was asked for, expected 1/sr, to which a phase function is brought (say what it integrates to: normalization)"
        )));
    }
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let (mut curve, form, vsf) = match lists::read(&source, how, &mut report)? {
        Some((curve, form)) => (curve, form, false),
        None => columns::read(&source, how, &mut report)?,
    };
    let negative = curve.values.iter().filter(|v| **v < 0.0).count();
    if negative > 0 {
        let lowest = curve.values.iter().copied().fold(0.0, f64::min);
        report.note(PhaseNote::Negative { values: negative, lowest: Brief(lowest) });
    }
    normalise(&mut curve, how.normalization.or(vsf.then_some(Normalization::Vsf)), &mut report)?;
    Ok(Acquisition {
        format: NAME,
        dialect: form,
        quantity: Quantity::Phase,
        unit: Unit::PerSteradian,
        samples: Samples::Function(modelled(vec![curve], None, &mut report)),
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}
