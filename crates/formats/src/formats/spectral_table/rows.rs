//! Tables with one row per wavelength: names of the columns, choice of the wavelengths, rows.

use super::about::NAME;
use super::columns::{self, Columns};
use super::holds::{names_wavelength, says_percent};
use super::library::{self, Library};
use super::table::{Table, position};
use super::wavelength_unit::WavelengthUnit;
use crate::domain::limits::MAX_ENTRIES;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::interpretation::Interpretation;
use crate::formats::text::{Brief, Source, Token, snippet};
use crate::formats::text_table::cells::{Delimiter, name_of};
use crate::formats::text_table::header::{self, Header};
use crate::formats::text_table::layout::{self, Layout, MAX_PREAMBLE, ROWS_LOOKED_AT};
use crate::formats::text_table::lines::{contents, split_comment};
use crate::formats::text_table::rows::{self, Rows};
use crate::notes::{SpectrumNote, TextNote};
use std::collections::HashMap;

/// Upper bound on the characters of a line that is kept as a keyword.
const LONGEST: usize = 4096;

/// Reads a table of spectra with one row per wavelength.
pub(super) fn read(source: &Source, how: &Interpretation, report: &mut ParseReport) -> Result<Table, FormatError> {
    let library = library::read(source);
    let data = library.as_ref().map_or(0, |library| library.data);
    let looked_at: Vec<Token<'_>> =
        contents(source).skip_while(|line| line.offset < data).take(MAX_PREAMBLE + ROWS_LOOKED_AT).collect();
    let Some(layout) = layout::find(&looked_at) else { return Err(no_table(source, &looked_at)) };
    if layout.width - 1 > MAX_ENTRIES {
        let message = format!("{} columns, expected at most {MAX_ENTRIES}", layout.width - 1);
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    }
    let mut preamble = Preamble::of(source, &layout, report);
    let known = preamble.known_names(layout.width);
    let header = if library.is_some() || known.is_some() { None } else { header::of(&preamble.tokens(), &layout) };
    let header = header.filter(|header| !header.is_split_otherwise || columns::fit(&layout, &header.names));
    let lines = header.as_ref().map_or(0, |header| header.lines);
    preamble.lines.truncate(preamble.lines.len() - lines);
    match &header {
        Some(header) => {
            let names = header.names.join(" | ").chars().take(LONGEST).collect();
            report.metadata.push(("columns".to_owned(), names));
        }
        None => preamble.refuse_decimal_commas(source, &layout)?,
    }
    if let Some(library) = &library {
        report.metadata.extend(library.fields.iter().cloned());
    } else if preamble.skipped() > 0 {
        report.note(TextNote::LinesBeforeData { lines: preamble.skipped() });
    }
    let names = names(header.as_ref(), library.as_ref(), known, layout.width);
    let columns = columns::choose(&layout, &names, how.wavelength_column.as_deref(), how.wavelength_unit.is_some())?;
    let rows = rows::read(source, &layout, &columns.roles, "a wavelength")?;
    note_lines_after(&rows, report);
    note_columns(&columns, report);
    let mut scale_name = columns.scales().first().map(|&i| names[i].clone()).filter(|name| !name.is_empty());
    if let (Some(name), Some(unit)) = (&mut scale_name, preamble.stated_unit)
        && WavelengthUnit::of_header(name).is_none()
    {
        *name = format!("{name} ({unit})");
    }
    if header.is_none() && library.is_none() && columns.scale.len() > 1 && scale_name.is_none() {
        report.note(TextNote::ColumnsWithoutHeader { columns: columns.scale.len() });
    }
    let dialect = if library.is_some() { "spectral library" } else { layout.delimiter.dialect() };
    let labels = header.map(|header| header.labels).unwrap_or_default();
    let mut table = Table {
        wavelengths: Vec::new(),
        values: rows.values,
        names: columns.value_names(&names, &labels),
        holds: columns.of_values().map(|i| columns.holds[i]).collect(),
        percent: columns.of_values().map(|i| layout.in_percent[i] || says_percent(&names[i].to_lowercase())).collect(),
        wavelength_name: scale_name.or_else(|| preamble.stated_unit.map(str::to_owned)),
        prose: preamble.prose(),
        heading: String::new(),
        library,
        dialect,
    };
    joined(&mut table, rows.keys, &columns, how)?;
    table.drop_empty_columns(report);
    Ok(table)
}

/// Returns the name of each column; empty for a column without a name.
fn names(header: Option<&Header>, library: Option<&Library>, known: Option<&[&str]>, width: usize) -> Vec<String> {
    if let Some(header) = header {
        return header.names.clone();
    }
    let mut names = vec![String::new(); width];
    if let Some(library) = library {
        names[0].clone_from(&library.x_units);
    } else if let Some(known) = known {
        names = known.iter().map(|&name| name.to_owned()).collect();
    }
    names
}

fn no_table(source: &Source, looked_at: &[Token<'_>]) -> FormatError {
    let at = looked_at.first().map_or(0, |line| line.offset);
    let is_number = |line: &&Token<'_>| Delimiter::Blank.number(line.text.trim()).is_some();
    let single = looked_at.iter().filter(is_number).count();
    source.malformed(
        at,
        if single > 0 && 2 * single > looked_at.len() {
            "one column of numbers without wavelengths, expected two or more columns: wavelength and values (spectral \
             libraries have a file of wavelengths beside such files: put the two columns side by side)"
        } else {
            "no rows of numbers, expected wavelengths and values separated by tab, `;`, `,` or blanks, as many cells in \
             each row"
        },
    )
}

fn note_lines_after(rows: &Rows, report: &mut ParseReport) {
    if rows.after == 0 {
        return;
    }
    report.note(if rows.has_end_mark {
        TextNote::LinesAfterEndMark { lines: rows.after }
    } else {
        TextNote::LinesAfterData { lines: rows.after }
    });
}

fn note_columns(columns: &Columns, report: &mut ParseReport) {
    if columns.is_first_taken {
        report.note(SpectrumNote::FirstColumnTaken);
    }
    if !columns.numbering.is_empty() {
        report.note(SpectrumNote::NumberingLeftOut { columns: columns.numbering.join(", ") });
    }
    if !columns.texts.is_empty() {
        report.note(SpectrumNote::TextLeftOut { columns: columns.texts.join(", ") });
    }
}

/// Returns the unit of wavelengths that a line before the numbers states, such as `Wavelength units: microns`.
fn unit_in_prose(line: &str) -> Option<WavelengthUnit> {
    let lower = line.to_lowercase();
    let separators =
        |c: char| c.is_whitespace() || matches!(c, '(' | ')' | '[' | ']' | ',' | ':' | '{' | '}' | '=' | ';' | '"');
    let units: Vec<WavelengthUnit> = lower.split(separators).filter_map(WavelengthUnit::of_name).collect();
    let is_about_wavelengths =
        names_wavelength(&lower) || ["wave", "lambda", "x unit", "xunit"].iter().any(|word| lower.contains(word));
    // A line with a number is about one wavelength, not about the unit of all.
    if WavelengthUnit::of_name(&lower).is_some() {
        return units.first().copied();
    }
    let has_number =
        lower.split(separators).any(|word| word.starts_with(|c: char| c.is_ascii_digit()) && !word.contains("cm"));
    match units.as_slice() {
        [unit, rest @ ..] if is_about_wavelengths && !has_number && rest.iter().all(|other| other == unit) => {
            Some(*unit)
        }
        _ => None,
    }
}

/// Lines of a file before the rows of its table.
struct Preamble<'a> {
    /// Lines that are not blank, each with a flag that is true for a comment after `#`.
    lines: Vec<(Token<'a>, bool)>,
    /// Lower-case text of comments behind content on the same line.
    asides: String,
    /// Unit of the wavelengths, if a line states it.
    stated_unit: Option<&'static str>,
}

impl<'a> Preamble<'a> {
    fn of(source: &'a Source, layout: &Layout, report: &mut ParseReport) -> Self {
        let mut preamble = Self { lines: Vec::new(), asides: String::new(), stated_unit: None };
        for line in source.lines().take_while(|line| line.offset < layout.start) {
            let (content, comment) = split_comment(line);
            let is_blank = content.text.trim().is_empty();
            if let Some(comment) = comment.map(|comment| comment.trim_start_matches('#'))
                && !comment.trim().is_empty()
                && preamble.lines.len() < MAX_PREAMBLE
            {
                report.metadata.push(("comment".to_owned(), comment.trim().chars().take(LONGEST).collect()));
                if is_blank {
                    preamble.lines.push((Token { text: comment, offset: content.offset }, true));
                } else {
                    preamble.asides.push_str(&comment.to_lowercase());
                    preamble.asides.push('\n');
                }
            }
            if !is_blank && preamble.lines.len() < MAX_PREAMBLE {
                preamble.lines.push((content, false));
            }
        }
        let mut units = preamble.lines.iter().filter_map(|(line, _)| unit_in_prose(line.text));
        preamble.stated_unit = units.next().map(WavelengthUnit::name);
        preamble
    }

    fn tokens(&self) -> Vec<Token<'a>> {
        self.lines.iter().map(|(line, _)| *line).collect()
    }

    fn skipped(&self) -> usize {
        self.lines.iter().filter(|(_, is_comment)| !is_comment).count()
    }

    fn prose(&self) -> String {
        let mut prose = self.asides.clone();
        for (line, _) in &self.lines {
            prose.push_str(&line.text.to_lowercase());
            prose.push('\n');
        }
        prose
    }

    /// Returns the names of the `width` columns of files that do not name them: those of the International Glazing
    /// Database, with labels in braces, and of Spectra Vista's spectroradiometers (.sig).
    fn known_names(&self, width: usize) -> Option<&'static [&'static str]> {
        let says = |word: &str| self.lines.iter().any(|(line, _)| line.text.to_lowercase().contains(word));
        let begins = |mark: &str| self.lines.iter().any(|(line, _)| line.text.trim_start().starts_with(mark));
        let names: &[&str] = if begins("{") && says("wavelength units") && says("emissivity") {
            &["wavelength", "transmittance", "front reflectance", "back reflectance"]
        } else if begins("/*** Spectra Vista SIG Data") {
            &["wavelength (nm)", "reference (raw)", "target (raw)", "reflectance (%)"]
        } else {
            return None;
        };
        (names.len() == width).then_some(names)
    }

    /// Refuses a table of spectra whose decimal commas cannot be told from separators: its row of names has half as
    /// many cells as its rows of numbers.
    fn refuse_decimal_commas(&self, source: &Source, layout: &Layout) -> Result<(), FormatError> {
        let Some((line, _)) = self.lines.last().filter(|_| layout.delimiter == Delimiter::Comma) else {
            return Ok(());
        };
        let names = layout.delimiter.cells(*line);
        let halves = [2 * names.len(), 2 * names.len() - 1].contains(&layout.width);
        if names.len() < 2 || !halves || !names_wavelength(&name_of(names[0].text)) {
            return Ok(());
        }
        let message = format!(
            "{} names over rows of {} cells, expected as many: where commas are decimal marks, cells must be separated by \
             `;`, tabs or blanks",
            names.len(),
            layout.width
        );
        Err(source.malformed(line.offset, message))
    }
}

/// Joins the rows of several scales of wavelengths side by side to one table. Scales with other wavelengths must agree
/// where they overlap; otherwise the user must choose one column.
fn joined(
    table: &mut Table,
    keys: Vec<(f64, usize)>,
    columns: &Columns,
    how: &Interpretation,
) -> Result<(), FormatError> {
    let scales = columns.scales().len();
    if scales == 1 {
        table.wavelengths = keys;
        return Ok(());
    }
    let of_scale = |scale: usize| keys.iter().skip(scale).step_by(scales).copied();
    if let Some(wanted) = &how.column {
        let picked = position(&table.names, wanted)?;
        let scale = columns.scale[picked];
        table.keep(&[picked]);
        table.names[0].clone_from(wanted);
        let rows: Vec<((f64, usize), f32)> = of_scale(scale).zip(table.values.drain(..)).collect();
        (table.wavelengths, table.values) = rows.into_iter().filter(|((key, _), _)| !key.is_nan()).unzip();
        return Ok(());
    }
    let bits = |scale: usize| of_scale(scale).map(|(key, _)| key.to_bits());
    if (1..scales).all(|scale| bits(scale).eq(bits(0))) {
        table.wavelengths = of_scale(0).collect();
        return Ok(());
    }
    let mut union: Vec<(f64, usize)> = keys.iter().filter(|(key, _)| !key.is_nan()).copied().collect();
    union.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    union.dedup_by(|a, b| a.0 == b.0);
    let width = table.names.len();
    let mut values = vec![f32::NAN; union.len() * width];
    for scale in 0..scales {
        let own: Vec<(usize, f64)> =
            of_scale(scale).map(|(key, _)| key).enumerate().filter(|(_, key)| !key.is_nan()).collect();
        let (low, high) = own.iter().fold((f64::MAX, f64::MIN), |(a, b), &(_, key)| (a.min(key), b.max(key)));
        if own.len() != union.iter().filter(|(key, _)| (low..=high).contains(key)).count() {
            let message = format!(
                "{scales} columns of wavelengths side by side, of which those of {} (from {} to {}, {} in all) are others than \
                 those of the first: choose one spectrum with column: {}",
                columns.scale.iter().position(|&of| of == scale).map_or(String::new(), |i| snippet(&table.names[i])),
                Brief(low),
                Brief(high),
                own.len(),
                table.column_list()
            );
            return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
        }
        let of_values: Vec<usize> = (0..width).filter(|&column| columns.scale[column] == scale).collect();
        for (row, key) in own {
            let place = union.partition_point(|(other, _)| *other < key);
            for &column in &of_values {
                values[place * width + column] = table.values[row * width + column];
            }
        }
    }
    (table.wavelengths, table.values) = (union, values);
    Ok(())
}

impl Columns {
    /// Returns the columns of wavelengths, in the order of the file.
    fn scales(&self) -> Vec<usize> {
        let is_key = |&i: &usize| self.roles[i] == rows::Role::Key;
        (0..self.roles.len()).filter(is_key).collect()
    }

    /// Returns the columns of values, in the order of the file.
    fn of_values(&self) -> impl Iterator<Item = usize> {
        (0..self.roles.len()).filter(|&i| self.roles[i] == rows::Role::Value)
    }

    /// Returns the names of the columns of values. A name that several columns share is told apart by its label; a
    /// column without a name has its number.
    fn value_names(&self, names: &[String], labels: &[String]) -> Vec<String> {
        let own: Vec<usize> = self.of_values().collect();
        let mut counts: HashMap<&str, usize> = HashMap::new();
        for &i in &own {
            *counts.entry(&names[i]).or_default() += 1;
        }
        let name = |(number, &i): (usize, &usize)| {
            let label = labels.get(i).map_or("", String::as_str);
            let is_shared = counts[names[i].as_str()] > 1;
            match (names[i].as_str(), label) {
                ("", "") => (number + 1).to_string(),
                ("", label) => label.to_owned(),
                (name, label) if label.is_empty() || !is_shared => name.to_owned(),
                (name, label) => format!("{label} {name}"),
            }
        };
        own.iter().enumerate().map(name).collect()
    }
}

impl Table {
    /// Removes columns of values without any: a separator at the end of every row makes one, and so do spreadsheets.
    fn drop_empty_columns(&mut self, report: &mut ParseReport) {
        let columns = self.names.len();
        let is_empty = |column: &usize| self.values.iter().skip(*column).step_by(columns).all(|value| value.is_nan());
        let kept: Vec<usize> = (0..columns).filter(|column| !is_empty(column)).collect();
        if kept.is_empty() || kept.len() == columns {
            return;
        }
        report.note(TextNote::BlankColumns { columns: columns - kept.len() });
        self.keep(&kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_columns_at_the_end_of_rows_are_left_out() {
        let rows = (400..=700).step_by(10).map(|nm| format!("{nm},0.{nm},,")).collect::<Vec<_>>().join("\n");
        for (header, note) in [("Wavelength (nm),R,,\n", "2 columns that are blank"), ("", "2 columns that are blank")]
        {
            let text = format!("{header}{rows}");
            let read = crate::formats::read(text.as_bytes(), &crate::formats::Interpretation::default()).unwrap();
            let notes: Vec<&str> = read.report.notes.iter().map(|note| note.message.as_str()).collect();
            assert!(notes.iter().any(|text| text.contains(note)), "{notes:?}");
            assert!(!notes.iter().any(|text| text.contains("no wavelength unit")) || header.is_empty(), "{notes:?}");
            let crate::formats::Samples::OnAxes { tensor, .. } = &read.samples else { panic!("no list of values") };
            assert_eq!((tensor.len(), tensor.masked()), (31, 0));
        }
    }

    #[test]
    fn units_are_read_from_lines_about_wavelengths() {
        for (line, unit) in [
            ("{ Units, Wavelength Units } SI Microns", Some(WavelengthUnit::Micrometre)),
            ("Wavelength units: nm", Some(WavelengthUnit::Nanometre)),
            ("X Units; Nanometers", Some(WavelengthUnit::Nanometre)),
            ("RAD->  Wave:643nm  Pix:10", None),
            ("Bandwidth 2 nm", None),
            ("Thickness (um)", None),
            ("wavelength range 380 to 780 nm", None),
        ] {
            assert_eq!(unit_in_prose(line), unit, "{line}");
        }
    }
}
