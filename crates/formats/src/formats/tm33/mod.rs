//! IES TM-33 luminaires (XML): intensities by direction in cd, W/sr or µmol/s/sr, with the emitter's spectrum.
//!
//! Revisions 18 and 23, and ATLA S001 and UNI 11733, of which TM-33 was made. An intensity is `number · Multiplier`;
//! outside the listed vertical angles it is 0. Angles and planes are those of LM-63 type C. The standards are not
//! public: files are read as public schemas and the library `eulumdat-rs` have them. Other goniometers, spectra and
//! colours by direction, and near fields are refused by name.

mod about;
mod choice;
mod distribution;
mod document;
mod spectrum;
#[cfg(test)]
mod tests;
mod words;

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::foreign;
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::photometry::check_emission;
use super::reader::{Reader, Sample};
use super::text::{Brief, Source, snippet};
use super::type_c::{Planes, flux, type_c};
use super::xml::{Root, walk};
use crate::domain::{Quantity, Unit};
use crate::notes::LuminaireNote;
use about::{ABOUT, NAME};
use distribution::{Distribution, Metric, plain};
use document::{Document, Emitter};
use words::Placed;

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &["column"],
    probe: |sample: &Sample<'_>| if foreign::xml_root(&sample.head).is_some_and(is_root) { 100 } else { 0 },
    read,
};

/// Largest relative difference between the flux of the intensities and the stated one that is not warned of. Raising
/// it warns of fewer files.
const FLUX_TOLERANCE: f64 = 0.05;

/// Returns true for the name of the root element of a TM-33 file, in any revision.
fn is_root(name: &str) -> bool {
    name == "LuminaireOpticalData"
        || ["IESTM33", "ATLA_S001", "UNI11733", "UNI_11733"].iter().any(|start| name.starts_with(start))
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    check_emission(NAME, how)?;
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let mut document = Document::new(&source);
    walk(&source, &Root { is: is_root, expected: "IESTM33-22" }, &mut report, &mut document)?;
    let Document { root, fields, goniometer, mut emitters, .. } = document;
    report.metadata = fields;
    let of = emitters.len();
    let number = choice::emitter(&emitters, how, &source, &mut report)?;
    if of > 1 {
        report.metadata.push(("emitter".to_owned(), format!("{} of {of}", number + 1)));
    }
    let mut emitter = emitters.swap_remove(number);
    let distribution = choice::distribution(&mut emitter, how, &source, &mut report)?;
    check_goniometer(distribution.photometry.as_ref().or(goniometer.as_ref()), &source, &mut report)?;
    let stated = distribution.stated(&source, &mut report)?;
    let (grid, symmetry) = type_c(stated, Planes::ByAngles, &source, &mut report)?;
    distribution.check_symmetry(symmetry, &source, &mut report)?;
    remarks(&emitter, &distribution, how.unit == Some(Unit::CandelaPerKilolumen), flux(&grid), &mut report);
    let Emitter { fields, spectra, .. } = emitter;
    report.metadata.extend(fields.into_iter().map(|(key, text)| (format!("{}/{key}", document::EMITTER), text)));
    let mut acquisition = Acquisition {
        format: NAME,
        dialect: format!("{}, {}, type C, {symmetry}", revision(&root), distribution.metric.name()),
        quantity: Quantity::Edf,
        unit: how.unit.unwrap_or(distribution.metric.unit()),
        samples: Samples::Grid(grid),
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    };
    spectrum::join(&mut acquisition, &distribution, spectra, how.unit.is_none(), &source)?;
    Ok(acquisition)
}

/// Returns the revision of the format that has the root element `root`.
fn revision(root: &str) -> &'static str {
    match root {
        "IESTM33-22" => "TM-33-23",
        "LuminaireOpticalData" | "IESTM33" => "TM-33-18",
        _ if root.starts_with("ATLA") => "ATLA S001",
        _ if root.starts_with("UNI") => "UNI 11733",
        _ => "TM-33",
    }
}

/// Refuses types of goniometers other than C, whose angles mean something else.
fn check_goniometer(
    stated: Option<&Placed<String>>,
    source: &Source,
    report: &mut ParseReport,
) -> Result<(), FormatError> {
    let Some((text, offset)) = stated else {
        report.note(LuminaireNote::GoniometerNotStated);
        return Ok(());
    };
    if ["C", "TYPEC", "CIEC", "IESC"].contains(&plain(text).as_str()) {
        return Ok(());
    }
    let message = format!("a goniometer of type {}, expected type C (IES_C or CIE_C)", snippet(text));
    Err(source.error(FormatErrorKind::Unsupported, *offset, message))
}

/// Adds notes on what the file says of the emitter beside its intensities, of which the flux in lumens, watts or µmol/s
/// is `found`. `is_per_kilolumen` is true if the user says that intensities hold for 1000 lm.
fn remarks(
    emitter: &Emitter,
    distribution: &Distribution,
    is_per_kilolumen: bool,
    found: f64,
    report: &mut ParseReport,
) {
    let is_luminous = distribution.metric == Metric::Luminous;
    let rated_lm = emitter.number("RatedLumens").filter(|lumens| *lumens > 0.0).map(Brief);
    match distribution.is_absolute {
        _ if is_per_kilolumen => {}
        None if is_luminous => report.note(LuminaireNote::AbsoluteNotStated { flux_lm: found, rated_lm }),
        Some(false) if is_luminous => report.note(LuminaireNote::RelativeToRated { flux_lm: found, rated_lm }),
        Some(false) => report.note(LuminaireNote::RelativeNotLuminous { names: distribution.metric.name() }),
        Some(true) | None => {}
    }
    // A count of -1, also without its sign, says that there are no lamps.
    if let Some(quantity) = emitter.number("Quantity").filter(|quantity| (2.0..1e6).contains(quantity)) {
        report.note(LuminaireNote::EmittersTogether { quantity: Brief(quantity) });
    }
    if let Some(factor) = emitter.number("BallastFactor").filter(|factor| *factor != 1.0) {
        report.note(LuminaireNote::BallastFactorKept { factor: Brief(factor) });
    }
    if emitter.fields.iter().any(|(key, _)| key == "TiltAngles/Tilt") {
        report.note(LuminaireNote::TiltFactors);
    }
    if !emitter.unread.is_empty() {
        report.note(LuminaireNote::DataNotRead { names: emitter.unread.join(", ") });
    }
    let measured =
        || emitter.number("MeasuredLumens").filter(|_| is_luminous && distribution.is_absolute != Some(false));
    let Some(stated) = distribution.flux.or_else(measured).filter(|flux| *flux > 0.0) else { return };
    if is_per_kilolumen || (found / stated - 1.0).abs() <= FLUX_TOLERANCE {
        return;
    }
    let part_percent = 100.0 * found / stated;
    report.note(match distribution.metric {
        Metric::Luminous => LuminaireNote::FluxDiffers { flux_lm: found, part_percent, stated_lm: Brief(stated) },
        Metric::Radiant => {
            LuminaireNote::OtherFluxDiffers { flux: found, unit: "W", part_percent, stated: Brief(stated) }
        }
        Metric::Photon => {
            LuminaireNote::OtherFluxDiffers { flux: found, unit: "umol/s", part_percent, stated: Brief(stated) }
        }
    });
}
