//! Files of the ASTER and ECOSTRESS spectral libraries: labelled lines such as `X Units: Wavelength (micrometers)`, then
//! pairs of numbers.

use crate::domain::Quantity;
use crate::formats::acquisition::{NoteKind, ParseReport};
use crate::formats::text::{Source, Token, number};

/// Lines in which the labels are looked for: files have 20 to 30 of them.
const LOOKED_AT: usize = 200;
/// Characters of a value that are kept.
const LONGEST: usize = 4096;
/// Labels behind the last of which the data begin.
const LAST_LABELS: [&str; 5] = ["X Units", "Y Units", "First X Value", "Last X Value", "Number of X Values"];

/// The labels of a library's file.
pub(in crate::formats) struct Library {
    /// Every label and its value, lines without a label joined to the one before.
    pub(super) fields: Vec<(String, String)>,
    /// The value of `X Units`.
    pub(super) x_units: String,
    /// The value of `Y Units`, lower case.
    y_units: String,
    /// Where the first line that may be data begins.
    pub(super) data: usize,
}

/// The label of a line and what follows it.
fn labelled(line: Token<'_>) -> Option<(&str, &str)> {
    let (label, value) = line.text.split_once(':')?;
    let label = label.trim_end();
    // A line of prose that goes on may hold a colon, too.
    let is_label = label.len() <= 40 && label.starts_with(|c: char| c.is_ascii_alphabetic()) && !label.contains(". ");
    is_label.then_some((label, value.trim()))
}

/// Where the data of a library's file begin; 0 in any other text.
pub(super) fn data_offset(source: &Source) -> usize {
    let (mut data, mut found) = (0, [false; LAST_LABELS.len()]);
    let mut lines = source.lines();
    for _ in 0..LOOKED_AT {
        let Some(line) = lines.next() else { break };
        let Some((label, _)) = labelled(line) else { continue };
        if let Some(i) = LAST_LABELS.iter().position(|last| label.eq_ignore_ascii_case(last)) {
            (found[i], data) = (true, lines.offset());
        }
    }
    if found[0] && found[1] { data } else { 0 }
}

/// The labels of a text that has both `X Units` and `Y Units`.
pub(super) fn read(source: &Source) -> Option<Library> {
    let data = data_offset(source);
    if data == 0 {
        return None;
    }
    let mut fields: Vec<(String, String)> = Vec::new();
    for line in source.lines().take(LOOKED_AT).filter(|line| !line.text.trim().is_empty()) {
        let first = line.text.split_whitespace().next().unwrap_or_default();
        match (labelled(line), fields.last_mut()) {
            _ if line.offset >= data && number(first).is_some() => break,
            (Some((label, value)), _) => fields.push((label.to_owned(), value.chars().take(LONGEST).collect())),
            (None, Some((_, value))) => {
                value.push(' ');
                value.extend(line.text.trim().chars().take(LONGEST.saturating_sub(value.len())));
            }
            (None, None) => {}
        }
    }
    let value =
        |label: &str| fields.iter().find(|(found, _)| found.eq_ignore_ascii_case(label)).map(|(_, v)| v.clone());
    let (x_units, y_units) = (value("X Units")?, value("Y Units")?.to_lowercase());
    Some(Library { fields, x_units, y_units, data })
}

impl Library {
    /// The quantity of the values: reflectances and transmittances are called so, emissivities and all else are spectra.
    pub(super) fn quantity(&self) -> Quantity {
        // "Reflectence", "Transmisson": the libraries' own spellings differ.
        let is_factor = ["reflect", "transm"].iter().any(|stem| self.y_units.contains(stem));
        if is_factor { Quantity::Reflectance } else { Quantity::Spectrum }
    }

    /// Returns true where `Y Units` says percent.
    pub(super) fn is_percent(&self) -> bool {
        self.y_units.contains("percent") || self.y_units.contains('%')
    }

    /// Compares the number of rows with the one stated, and points at what a bidirectional reflectance may be.
    pub(super) fn check(&self, rows: usize, report: &mut ParseReport) {
        let value = |label: &str| {
            let found = self.fields.iter().find(|(found, _)| found.eq_ignore_ascii_case(label));
            found.map(|(_, value)| value.to_lowercase()).unwrap_or_default()
        };
        let stated = value("Number of X Values");
        if number(&stated).is_some_and(|stated| stated != rows as f64) {
            report.note(NoteKind::Warning, format!("{rows} rows, but `Number of X Values` says {stated}"));
        }
        if value("Measurement").contains("bidirectional") && self.quantity() == Quantity::Reflectance {
            let message = "bidirectional reflectance, relative to a diffuse white, kept as a reflectance: \
                           `--quantity reflectance-factor` reads it as a BRDF (divided by π)";
            report.note(NoteKind::Assumed, message);
        }
    }
}
