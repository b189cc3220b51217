//! EULUMDAT luminaires (`.ldt`): one value a line, C planes by symmetry, intensities in cd per 1000 lm.
//!
//! A stored intensity is `value · conversion factor · Φ / 1000`, Φ the lumens of the first lamp set: the total of its
//! lamps, or, where its number of lamps is negative (absolute photometry), the flux of the luminaire (Stockmar,
//! "EULUMDAT – ein Leuchtendatenformat für den europäischen Beleuchtungsplaner", Licht '90). Outside the stated gamma
//! angles the intensity is 0.

mod lines;
mod planes;
#[cfg(test)]
mod tests;
mod write;

pub use write::write_eulumdat;

use super::acquisition::{Acquisition, NoteKind, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::text::{Brief, Source};
use super::type_c::{flux, type_c};
use super::{Format, Interpretation, Reader, Sample};
use crate::domain::{Quantity, Unit};
use lines::{Lines, decimal};

const NAME: &str = "eulumdat";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "EULUMDAT luminaire (.ldt)",
        extensions: &["ldt"],
        reads: true,
        writes: true,
    },
    options: &[],
    probe,
    read,
};

/// Lines before those of the lamp sets.
const HEAD_LINES: usize = 26;

/// Line 2 a type 0..3, line 3 a symmetry 0..4, lines 4 and 6 the numbers of planes and angles, each alone on its line;
/// or any whole numbers there, if lines 13 to 26 are numbers too.
fn probe(sample: &Sample<'_>) -> u8 {
    let text = sample.head.replace("\r\n", "\n");
    let lines: Vec<&str> = text.split(['\n', '\r']).take(HEAD_LINES).map(str::trim).collect();
    let whole = |line: usize, low: i32, high: i32| {
        let value = lines.get(line - 1).and_then(|text| decimal(text));
        value.is_some_and(|v| v.fract() == 0.0 && (f64::from(low)..=f64::from(high)).contains(&v))
    };
    let number = |text: &&str| text.is_empty() || decimal(text).is_some();
    let found = lines.len() == HEAD_LINES
        && (whole(2, 0, 3) && whole(3, 0, 4) && whole(4, 1, 721) && whole(6, 1, 721)
            || [2, 3, 4, 6, 26].iter().all(|&line| whole(line, i32::MIN, i32::MAX)) && lines[12..25].iter().all(number))
        // A column of bare numbers is something else.
        && lines[7..12].iter().any(|text| decimal(text).is_none());
    if found && !sample.head.contains('\0') { 80 } else { 0 }
}

/// One set of lamps that the luminaire may hold; several are alternatives.
struct LampSet {
    /// Negative: absolute photometry.
    count: f64,
    kind: String,
    /// Of all lamps of the set; with a negative count, of the luminaire.
    lumens: f64,
    colour: String,
    rendering: String,
    watts: Option<f64>,
}

/// The numbers that lead to the intensities.
struct Header {
    symmetry: usize,
    planes: usize,
    angles: usize,
    conversion: f64,
    /// Light output ratio of the luminaire in percent.
    output_ratio: Option<f64>,
    sets: Vec<LampSet>,
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    if let Some(other) = how.quantity().filter(|quantity| *quantity != Quantity::Edf) {
        let message = format!("quantity {other} was asked for, expected edf: a luminaire is an emission distribution");
        return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    }
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    if let Some(encoding) = source.odd_encoding() {
        report.note(NoteKind::Assumed, format!("text decoded as {encoding}"));
    }
    let mut lines = Lines::of(&source);
    let header = Header::read(&mut lines, &mut report)?;
    let (unit, scale) = header.unit(how, &mut report)?;
    let (stated, stand_for, symmetry) = planes::read(&mut lines, &header, scale, &mut report)?;
    let (grid, _) = type_c(stated, stand_for, &source, &mut report)?;
    if unit == Unit::Candela {
        header.check_flux(flux(&grid), &mut report);
    }
    let photometry = if header.is_absolute() { "absolute" } else { "relative" };
    Ok(Acquisition {
        format: NAME,
        dialect: format!("EULUMDAT, {photometry} photometry, {symmetry}"),
        quantity: Quantity::Edf,
        unit,
        samples: Samples::Grid(grid),
        spectral_factor: None,
        report,
    })
}

/// Lines 13 to 21: what they measure, in mm.
const DIMENSIONS: [&str; 9] = [
    "luminaire_length_mm",
    "luminaire_width_mm",
    "luminaire_height_mm",
    "luminous_length_mm",
    "luminous_width_mm",
    "luminous_height_c0_mm",
    "luminous_height_c90_mm",
    "luminous_height_c180_mm",
    "luminous_height_c270_mm",
];
/// The room indices of the direct ratios.
const ROOM_INDICES: [&str; 10] = ["0.6", "0.8", "1", "1.25", "1.5", "2", "2.5", "3", "4", "5"];
/// More lamp sets than any luminaire has alternatives.
const MAX_SETS: usize = 1000;

impl Header {
    fn read(lines: &mut Lines<'_>, report: &mut ParseReport) -> Result<Self, FormatError> {
        let mut keep = |key: &str, value: String| {
            if !value.is_empty() {
                report.metadata.push((key.to_owned(), value));
            }
        };
        keep("company", lines.text("the company")?);
        keep("luminaire_type", lines.whole("the type of luminaire", 0, 3)?.to_string());
        let symmetry = lines.whole("the symmetry", 0, 4)?;
        let planes = lines.count("the number of C planes")?;
        let plane_step = lines.optional("the distance between C planes")?;
        let angles = lines.count("the number of gamma angles")?;
        let angle_step = lines.optional("the distance between gamma angles")?;
        keep("symmetry", symmetry.to_string());
        keep("c_planes", planes.to_string());
        keep("c_step", written(plane_step));
        keep("gamma_angles", angles.to_string());
        keep("gamma_step", written(angle_step));
        for (key, expected) in [
            ("report", "the number of the report"),
            ("luminaire", "the name of the luminaire"),
            ("luminaire_number", "the number of the luminaire"),
            ("file_name", "the name of the file"),
            ("date", "the date"),
        ] {
            keep(key, lines.text(expected)?);
        }
        for key in DIMENSIONS {
            keep(key, written(lines.optional("a dimension in mm")?));
        }
        keep("downward_flux_percent", written(lines.optional("the downward flux fraction in percent")?));
        let output_ratio = lines.optional("the light output ratio in percent")?;
        keep("light_output_ratio_percent", written(output_ratio));
        let conversion_at = lines.at();
        let conversion = lines.optional("the conversion factor of the intensities")?;
        keep("conversion_factor", written(conversion));
        if let Some(factor) = conversion.filter(|factor| *factor <= 0.0) {
            let message = format!(
                "conversion factor {}, expected more than 0 (line 24 of the format; are all lines above there?)",
                Brief(factor)
            );
            return Err(lines.refused(conversion_at, message));
        }
        let tilt = lines.optional("the tilt during measurement in degrees")?;
        keep("tilt_degrees", written(tilt));
        let (sets, blocks) = lines::lamp_sets(lines)?;
        for (i, set) in sets.iter().enumerate() {
            let key = |name: &str| if sets.len() == 1 { name.to_owned() } else { format!("set_{}_{name}", i + 1) };
            keep(&key("lamps"), Brief(set.count).to_string());
            keep(&key("lamp"), set.kind.clone());
            keep(&key("lumens"), Brief(set.lumens).to_string());
            keep(&key("colour"), set.colour.clone());
            keep(&key("colour_rendering"), set.rendering.clone());
            keep(&key("watts"), written(set.watts));
        }
        for index in ROOM_INDICES {
            keep(&format!("direct_ratio_k{index}"), written(lines.optional("a direct ratio")?));
        }
        if conversion.is_none() {
            report.note(NoteKind::Assumed, "no conversion factor of the intensities, taken as 1");
        }
        if let Some(tilt) = tilt.filter(|tilt| *tilt != 0.0) {
            report.note(
                NoteKind::Warning,
                format!("measured with a tilt of {}°; the intensities are kept as they stand", Brief(tilt)),
            );
        }
        if blocks {
            report.note(NoteKind::Assumed, "the lamp sets are written field by field, not set by set");
        }
        if sets.len() > 1 {
            report.note(
                NoteKind::Assumed,
                format!("{} lamp sets, which are alternatives: the intensities are those of the first", sets.len()),
            );
        }
        Ok(Self { symmetry, planes, angles, conversion: conversion.unwrap_or(1.0), output_ratio, sets })
    }

    fn is_absolute(&self) -> bool {
        self.sets.first().is_some_and(|set| set.count < 0.0)
    }

    /// The lumens that the intensities refer to.
    fn lumens(&self) -> Option<f64> {
        self.sets.first().map(|set| set.lumens).filter(|lumens| *lumens > 0.0)
    }

    /// The unit as asked, else candela where the lumens are known; and the factor of a stored value.
    fn unit(&self, how: &Interpretation, report: &mut ParseReport) -> Result<(Unit, f64), FormatError> {
        let per_kilolumen = self.conversion;
        let needs = |message: String| FormatError::new(FormatErrorKind::NeedsOption, NAME, message);
        match (how.unit, self.lumens()) {
            (Some(Unit::CandelaPerKilolumen), _) => Ok((Unit::CandelaPerKilolumen, per_kilolumen)),
            (Some(unit), _) if unit != Unit::Candela && unit.per_nanometre().is_none() => Err(needs(format!(
                "unit {unit} was asked for, expected an intensity: cd, cd/klm, W/sr, mW/sr, uW/sr, umol/s/sr or relative"
            ))),
            (asked, Some(lumens)) => {
                let first = &self.sets[0];
                if !self.is_absolute() {
                    report.note(
                        NoteKind::Assumed,
                        format!(
                            "relative photometry: intensities hold for {} lamp(s) of {} lm in all",
                            Brief(first.count),
                            Brief(lumens)
                        ),
                    );
                }
                Ok((asked.unwrap_or(Unit::Candela), per_kilolumen * lumens / 1000.0))
            }
            (None | Some(Unit::Relative), None) => {
                let found =
                    self.sets.first().map_or("no lamp set".to_owned(), |set| format!("{} lm", Brief(set.lumens)));
                report.note(
                    NoteKind::Warning,
                    format!("{found}, expected the lumens of the lamps: intensities stay in cd per 1000 lm"),
                );
                Ok((how.unit.unwrap_or(Unit::CandelaPerKilolumen), per_kilolumen))
            }
            (Some(unit), None) => Err(needs(format!(
                "unit {unit} was asked for, but the file does not state the lumens of its lamps: ask for cd/klm or relative"
            ))),
        }
    }

    /// The flux of the intensities is that of the lamps times the light output ratio; of absolute ones, that stated.
    fn check_flux(&self, found: f64, report: &mut ParseReport) {
        let Some(lumens) = self.lumens() else { return };
        let ratio = if self.is_absolute() { 100.0 } else { self.output_ratio.unwrap_or(0.0) };
        let stated = lumens * ratio / 100.0;
        report.metadata.push(("flux_of_the_intensities_lm".to_owned(), format!("{found:.1}")));
        if stated > 0.0 && (found / stated - 1.0).abs() > 0.05 {
            report.note(
                NoteKind::Warning,
                format!(
                    "the intensities make {found:.1} lm, {:.1} % of the {} lm stated; kept as they are",
                    100.0 * found / stated,
                    Brief(stated)
                ),
            );
        }
    }
}

/// A number for metadata; nothing where the line is blank.
fn written(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| Brief(value).to_string())
}
