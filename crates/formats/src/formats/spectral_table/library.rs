//! Files of the ASTER and ECOSTRESS spectral libraries: labelled lines such as `X Units: Wavelength (micrometers)`,
//! then pairs of numbers.

use crate::domain::Quantity;
use crate::formats::acquisition::ParseReport;
use crate::formats::text::{Source, Token, number};
use crate::notes::SpectrumNote;

/// Upper bound on the lines that are searched for the labels of a spectral library; files have 20 to 30 of them.
const LOOKED_AT: usize = 200;
/// Upper bound on the characters that are kept of the value after a label, such as `X Units:`, in a spectral library's
/// file.
const LONGEST: usize = 4096;
/// Labels of a spectral library's file after which the data begin.
const LAST_LABELS: [&str; 5] = ["X Units", "Y Units", "First X Value", "Last X Value", "Number of X Values"];

/// Labels in a file of the ASTER or ECOSTRESS spectral library.
pub(in crate::formats) struct Library {
    /// Labels with their values in the header of a spectral library's file; a line without a label continues the
    /// previous value.
    pub(super) fields: Vec<(String, String)>,
    /// Value of the label `X Units`, which is the unit of wavelengths.
    pub(super) x_units: String,
    /// Value of the label `Y Units`, in lower case, which names the quantity.
    y_units: String,
    /// Byte offset of the line after the last label, such as `X Units:`, at the head of a spectral library's file. Data
    /// can begin there.
    pub(super) data: usize,
}

/// Returns the label of a line of a spectral library's file, and the text after it; `None` for a line without a label.
fn labelled(line: Token<'_>) -> Option<(&str, &str)> {
    let (label, value) = line.text.split_once(':')?;
    let label = label.trim_end();
    // A continued line of prose may contain a colon, too.
    let is_label = label.len() <= 40 && label.starts_with(|c: char| c.is_ascii_alphabetic()) && !label.contains(". ");
    is_label.then_some((label, value.trim()))
}

/// Returns the byte offset of the data in a spectral library's file; 0 for any other text.
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

/// Returns the labels of a spectral library's file; `None` for a text without both `X Units` and `Y Units`.
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
    /// Returns the quantity of the values in a spectral library's file: reflectance for reflectances and
    /// transmittances, spectrum for emissivities and all else.
    pub(super) fn quantity(&self) -> Quantity {
        // The libraries also write "Reflectence" and "Transmisson".
        let is_factor = ["reflect", "transm"].iter().any(|stem| self.y_units.contains(stem));
        if is_factor { Quantity::Reflectance } else { Quantity::Spectrum }
    }

    /// Returns true if `Y Units` states percent.
    pub(super) fn is_percent(&self) -> bool {
        self.y_units.contains("percent") || self.y_units.contains('%')
    }

    /// Adds notes if a spectral library's file states a wrong number of rows, or if its reflectance may be a
    /// bidirectional one.
    pub(super) fn check(&self, rows: usize, report: &mut ParseReport) {
        let value = |label: &str| {
            let found = self.fields.iter().find(|(found, _)| found.eq_ignore_ascii_case(label));
            found.map(|(_, value)| value.to_lowercase()).unwrap_or_default()
        };
        let stated = value("Number of X Values");
        if number(&stated).is_some_and(|stated| stated != rows as f64) {
            report.note(SpectrumNote::RowsDiffer { rows, stated });
        }
        if value("Measurement").contains("bidirectional") && self.quantity() == Quantity::Reflectance {
            report.note(SpectrumNote::BidirectionalKept);
        }
    }
}
