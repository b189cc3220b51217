//! EULUMDAT luminaires (`.ldt`): one value a line, C planes by symmetry, intensities in cd per 1000 lm.
//!
//! A stored intensity is `value · conversion factor · Φ / 1000`, Φ the lumens of the first lamp set: the total of its
//! lamps, or, where its number of lamps is negative (absolute photometry), the flux of the luminaire (Stockmar,
//! "EULUMDAT – ein Leuchtendatenformat für den europäischen Beleuchtungsplaner", Licht '90). Outside the stated gamma
//! angles the intensity is 0.

mod about;
mod header;
mod lines;
mod planes;
mod restate;
#[cfg(test)]
mod tests;
mod write;

pub use restate::restate_eulumdat;
pub use write::write_eulumdat;

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::FormatError;
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::photometry::check_emission;
use super::reader::{Reader, Sample};
use super::text::Source;
use super::type_c::{flux, type_c};
use crate::domain::{Quantity, Unit};
use about::{ABOUT, NAME};
use header::Header;
use lines::{HEAD_LINES, Lines, decimal};

pub(super) const READER: Reader = Reader { about: ABOUT, options: &[], probe, read };

/// Returns the confidence that a file is EULUMDAT: line 2 has a type 0..3, line 3 a symmetry 0..4, and lines 4 and 6
/// the numbers of planes and angles, each alone on its line. Other whole numbers there are accepted if lines 13 to 26
/// are numbers, too.
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
        // A file of bare numbers only is not EULUMDAT.
        && lines[7..12].iter().any(|text| decimal(text).is_none());
    if found && !sample.head.contains('\0') { 80 } else { 0 }
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    check_emission(NAME, how)?;
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
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
        instrument: Instrument::default(),
        report,
    })
}
