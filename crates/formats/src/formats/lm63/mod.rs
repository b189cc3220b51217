//! IES LM-63 luminaires (`.ies`), revisions 1986 to 2019, photometric types A, B and C.
//!
//! A stored intensity is `value · candela multiplier · ballast factor`, and up to 1991 also `· ballast-lamp photometric
//! factor`; the number and the lumens of the lamps do not enter (ANSI/IES LM-63-19; the comments of Radiance's
//! `ies2rad.c` describe all revisions). Outside the stated vertical angles the intensity is 0.

mod about;
mod header;
mod labels;
mod lines;
mod native;
mod numbers;
mod restate;
mod write;

pub use restate::restate_lm63;
pub use write::write_lm63;

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::photometry::check_emission;
use super::reader::{Reader, Sample};
use super::text::{Brief, Source};
use super::type_c::{Planes, flux, type_c};
use crate::domain::{Quantity, Unit};
use crate::notes::LuminaireNote;
use about::{ABOUT, NAME};
use header::Header;
use labels::{Labels, Revision};
use native::Photometry;
use numbers::Numbers;

pub(super) const READER: Reader = Reader { about: ABOUT, options: &[], probe, read };

fn probe(sample: &Sample<'_>) -> u8 {
    let first = sample.head.split(['\n', '\r']).find(|line| !line.trim().is_empty());
    if first.is_some_and(|line| Revision::of_tag(line).is_some()) {
        return 100;
    }
    let mut lines = sample.head.split(['\n', '\r']).filter(|line| !line.trim().is_empty());
    if !lines.any(|line| labels::tilt(line).is_some()) {
        return 0;
    }
    // A line of a program that sets a variable of this name is followed by more program.
    let begins = |line: &str| line.trim_start().starts_with(|c: char| c.is_ascii_digit() || "+-.,".contains(c));
    if lines.next().is_none_or(begins) { 90 } else { 0 }
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    check_emission(NAME, how)?;
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let labels = labels::read(&source, &mut report)?;
    let pointed = if labels.tilt_included { None } else { numbers::with_points(source.text(), labels.numbers_at) };
    let source = match pointed {
        Some(text) => {
            report.note(LuminaireNote::DecimalCommas);
            source.with_text(text)
        }
        None => source,
    };
    let mut numbers = Numbers::new(&source, labels.numbers_at);
    if labels.tilt_included {
        numbers.tilt(&mut report)?;
    }
    let mut header = numbers.header(&labels, &mut report)?;
    let unit = unit(&labels, &header, how, &mut report)?;
    let stated = numbers.distribution(&header, &labels, &mut report)?;
    if labels.revision == Revision::Lm63_1986
        && header.photometry == Photometry::C
        && stated.vertical.iter().any(|&(angle, _)| angle < 0.0)
    {
        // In 1986 type 1 denoted both, and gamma is never negative.
        report.note(LuminaireNote::TypeAOfNegativeAngles);
        header.photometry = Photometry::A;
    }
    let (grid, shape) = match header.photometry {
        Photometry::C => type_c(stated, Planes::ByAngles, &source, &mut report)?,
        photometry => native::convert(stated, photometry, &source, &mut report)?,
    };
    if header.lumens > 0.0 && unit == Unit::Candela {
        check_flux(flux(&grid), header.lamps as f64 * header.lumens, &mut report);
    }
    Ok(Acquisition {
        format: NAME,
        dialect: format!("{}, type {}, {shape}", labels.revision.name(), header.photometry.name()),
        quantity: Quantity::Edf,
        unit,
        samples: Samples::Grid(grid),
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}

/// Returns the unit of the intensities: the requested one, else the one stated in the file's text, else candela.
fn unit(labels: &Labels, header: &Header, how: &Interpretation, report: &mut ParseReport) -> Result<Unit, FormatError> {
    if let Some(unit) = how.unit {
        let is_intensity = unit.per_nanometre().is_some() || matches!(unit, Unit::Candela | Unit::CandelaPerKilolumen);
        return if is_intensity {
            Ok(unit)
        } else {
            Err(FormatError::new(
                FormatErrorKind::NeedsOption,
                NAME,
                format!(
                    "unit {unit} was asked for, expected an intensity: cd, cd/klm, W/sr, mW/sr, uW/sr, umol/s/sr or relative"
                ),
            ))
        };
    }
    let unit = labels.unit(report);
    if unit == Unit::Candela && header.lumens == 0.0 {
        report.note(LuminaireNote::FluxZero);
    } else if unit == Unit::Candela && header.lumens > 0.0 {
        report.note(LuminaireNote::RelativePhotometry { lamps: header.lamps, flux_lm: Brief(header.lumens) });
    }
    Ok(unit)
}

/// Adds a note if the luminaire efficiency is implausible: the flux of the intensities divided by that of the lamps.
fn check_flux(flux: f64, lamp_lumens: f64, report: &mut ParseReport) {
    let efficiency = flux / lamp_lumens;
    if lamp_lumens > 0.0 && !(0.05..=1.05).contains(&efficiency) {
        report.note(LuminaireNote::EfficiencyImplausible {
            efficiency_percent: Brief((1000.0 * efficiency).round() / 10.0),
            lamps_lm: Brief(lamp_lumens),
        });
    }
}
