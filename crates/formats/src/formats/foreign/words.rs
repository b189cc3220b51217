//! Recognition of foreign tables by the words of their header: angles in words, lamp summaries, surface properties.

use crate::domain::Quantity;
use crate::formats::reader::Sample;
use crate::formats::spectral_table::holds::names_wavelength;
use crate::formats::spectral_table::layouts;
use crate::formats::text::{Source, Token};
use crate::formats::text_table::cells::{Delimiter, has_words, is_missing, name_of};

/// Upper bound on the lines of a file that are searched for column names.
const LOOKED_AT: usize = 200;
/// Upper bound on the bytes of a column name; a longer cell in a row of names counts as prose.
const LONGEST: usize = 60;

/// Returns true for a table in which a column is named as an angle in words ("Viewing Zenith", "Relative Azimuth").
pub(super) fn is_directions(sample: &Sample<'_>) -> bool {
    // Phase functions have a reader of their own, whatever the name of their angle.
    let of_phase = || ["phase function", "scattering"].iter().any(|word| sample.head.to_lowercase().contains(word));
    sample.quantity != Some(Quantity::Phase) && has_columns(sample, is_angle, 1) && !of_phase()
}

/// Returns true for a table in which columns are named as angles by symbols (`theta_i`, `theta` beside `phi`).
pub(super) fn is_under_symbols(sample: &Sample<'_>) -> bool {
    has_columns(sample, is_angle_of_a_side, 1) || has_columns(sample, is_symbol, 2)
}

/// Returns true for a file with figures of a lamp (CCT, CRI, illuminance) but no spectrum: in columns, or one per line.
pub(super) fn is_summary(sample: &Sample<'_>) -> bool {
    const FEWEST: usize = 2;
    if has_columns(sample, is_figure, FEWEST) {
        return !layouts::holds_wide(&sample.head);
    }
    let source = source(sample);
    let is_line = |line: &Token<'_>| {
        Delimiter::ALL.into_iter().any(|delimiter| {
            let cells = delimiter.cells(*line);
            matches!(&cells[..], [name, value, ..] if is_figure(&name.text.to_lowercase()) && delimiter.number(value.text).is_some())
        })
    };
    source.lines().take(LOOKED_AT).filter(|line| has_words(line.text)).filter(is_line).count() >= FEWEST
        && layouts::probe(&sample.head) == 0
}

/// Returns true for a file with a surface property of `TracePro`, by its title or its column names.
pub(super) fn is_tracepro(sample: &Sample<'_>) -> bool {
    let begins = |line: &str| line.starts_with("TracePro") || line.trim() == "Table_BSDF_Data";
    let names = |line: &str| line.contains("ScatterBeta") && line.contains("ScatterAzimuth");
    sample.head.lines().take(LOOKED_AT).any(|line| begins(line.trim_start_matches(['#', ' ', '"'])) || names(line))
}

/// Decodes the beginning of a file as text. Its error messages are never shown, so the name of the format is empty.
fn source(sample: &Sample<'_>) -> Source {
    Source::decode(sample.head.as_bytes(), "")
}

/// Returns true if a row of column names has at least `fewest` cells for which `is` is true, with numbers beneath them.
/// The first column must not contain wavelengths.
fn has_columns(sample: &Sample<'_>, is: fn(&str) -> bool, fewest: usize) -> bool {
    let source = source(sample);
    let lines: Vec<Token<'_>> =
        source.lines().filter(|line| !line.text.trim().is_empty()).take(LOOKED_AT + 2).map(without_mark).collect();
    (0..lines.len().min(LOOKED_AT)).filter(|&i| has_words(lines[i].text)).any(|i| {
        Delimiter::ALL.into_iter().any(|delimiter| {
            let names = delimiter.cells(lines[i]);
            if names.len() < 2 || names_wavelength(names[0].text) {
                return false;
            }
            let found: Vec<usize> = (0..names.len())
                .filter(|&k| names[k].text.len() <= LONGEST && is(&name_of(names[k].text).to_lowercase()))
                .collect();
            // A row of units may come between.
            found.len() >= fewest
                && lines[i + 1..].iter().take(2).any(|row| {
                    let row = delimiter.cells(*row);
                    let is_number = |&k: &usize| delimiter.number(row[k].text).is_some();
                    row.len().abs_diff(names.len()) <= 1
                        && found.iter().all(|&k| k < row.len() && (is_number(&k) || is_missing(row[k].text)))
                        && found.iter().any(is_number)
                })
        })
    })
}

/// Returns a line without the comment mark `#` at its start.
fn without_mark(line: Token<'_>) -> Token<'_> {
    let text = line.text.trim_start().trim_start_matches('#').trim_start();
    Token { text, offset: line.offset + line.text.len() - text.len() }
}

/// Returns true if the lower-case name of a column is that of an angle of incidence or view.
fn is_angle(name: &str) -> bool {
    const ACRONYMS: [&str; 6] = ["vza", "sza", "raa", "vaa", "saa", "iza"];
    const OF: [&str; 9] =
        ["view", "incidence", "incident", "illumination", "emission", "detector", "source", "sensor", "solar"];
    let words = name.split(|c: char| !c.is_alphanumeric());
    matches!(name, "incidence" | "reflection")
        || name.contains("zenith")
        || name.contains("azimuth")
        || words.into_iter().any(|word| ACRONYMS.contains(&word))
        || name.contains("angle") && OF.iter().any(|of| name.contains(of))
}

/// Returns the symbol at the start of a column's lower-case name such as `theta_i (deg)`, without unit and underscores.
fn symbol(name: &str) -> String {
    name.split(|c: char| c.is_whitespace() || matches!(c, '(' | '[')).next().unwrap_or_default().replace('_', "")
}

/// Returns true if the lower-case name of a column is the symbol of an angle of incidence, reflection or scattering.
fn is_angle_of_a_side(name: &str) -> bool {
    let symbol = symbol(name);
    ["theta", "phi", "θ", "φ"].iter().any(|angle| {
        symbol.strip_prefix(angle).is_some_and(|side| ["i", "o", "r", "s", "in", "out", "inc", "ref"].contains(&side))
    })
}

/// Returns true if the lower-case name of a column is the symbol `theta` or `phi`, without a subscript.
fn is_symbol(name: &str) -> bool {
    ["theta", "phi", "θ", "φ"].contains(&symbol(name).as_str())
}

/// Returns true if the lower-case name of a column is that of a figure that summarises a lamp's spectrum.
fn is_figure(name: &str) -> bool {
    const FIGURES: [&str; 12] =
        ["cct", "cri", "ra", "duv", "lux", "illuminance", "ppfd", "tlci", "cqs", "rf", "rg", "lambdad"];
    let first = name.trim().split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
    FIGURES.contains(&first)
}
