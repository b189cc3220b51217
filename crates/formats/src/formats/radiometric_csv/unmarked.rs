//! Tables of directions as goniometers write them, without the lines of radiometric-csv: the row of names, and what it
//! and the lines before it say.

use super::about::NAME;
use super::columns::{ANGLES, Columns, Row};
use super::head::{Head, complete};
use super::header::{Field, KNOWN};
use super::names::{self, Meaning, ValueName, ValueUnit};
use super::rows::Rows;
use super::written::{Count, Marks};
use crate::domain::{Quantity, Unit};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind, Position};
use crate::formats::interpretation::Interpretation;
use crate::formats::spectral_table::wavelength_unit::WavelengthUnit;
use crate::formats::stated::StatedQuantity;
use crate::formats::text::{Brief, Source, Token, snippet};
use crate::formats::text_table::cells::{Delimiter, is_missing};
use crate::formats::text_table::header::is_unit;
use crate::notes::{Quoted, ScatteringNote, ValueNote};
use std::f64::consts::FRAC_PI_2;

/// Upper bound on the lines before the row of names. Raising it reads files with longer preambles.
const LOOKED_AT: usize = 500;
/// Upper bound on the bytes of a row of names; a longer line is none.
const LONGEST: usize = 1 << 16;
/// Upper bound on the bytes of a name before a colon; a longer text is prose.
const LONGEST_KEY: usize = 60;

/// Statements of the lines before a table.
#[derive(Default)]
struct Preamble {
    /// Angle of incidence in degrees.
    theta_i: Option<f64>,
    /// Wavelength in nm.
    wavelength: Option<f64>,
}

/// Row of names of a table of directions.
struct Found {
    names: Row,
    meanings: Vec<Meaning>,
    delimiter: Delimiter,
    /// Number of lines before the rows of numbers, and the byte offset at which these start.
    lines: usize,
    end: usize,
    preamble: Preamble,
}

/// Returns true if a text is a table of values over directions of the source and of the detector, by the names of its
/// columns. `quantity` is that stated by the user.
pub(in crate::formats) fn claims(head: &str, quantity: Option<Quantity>) -> bool {
    let over_directions = quantity.is_none_or(|quantity| quantity.directions() == 2 && quantity != Quantity::Phase);
    over_directions && hints_at_angles(head) && find(&Source::decode(head.as_bytes(), NAME)).is_some()
}

/// Returns true if a text has a part of the name of an angle of the source. The search for them all takes longer.
fn hints_at_angles(text: &str) -> bool {
    const PARTS: [&str; 11] = ["thet", "θ", "ϑ", "th_", "aoi", "incid", "einfall", "winkel", "angl", "ngul", "angol"];
    const UNITS: [&str; 4] = ["°", "deg", "gra", "rad"];
    let lower = text.to_lowercase();
    PARTS.iter().chain(&UNITS).any(|part| lower.contains(part))
}

/// Returns the row of names of a table of directions: the first line with an angle of the source and one of the
/// detector above a row of numbers.
fn find(source: &Source) -> Option<Found> {
    let lines: Vec<Token<'_>> = source.lines().take(LOOKED_AT + 4).collect();
    let mut preamble = Preamble::default();
    for (i, line) in lines.iter().enumerate().take(LOOKED_AT) {
        let text = without_mark(line.text);
        if text.is_empty() || text.len() > LONGEST {
            continue;
        }
        let offset = line.text.len() - line.text.trim_start().trim_start_matches('#').trim_start().len();
        let may_name = text.chars().any(char::is_alphabetic) && hints_at_angles(text);
        for delimiter in Delimiter::ALL.into_iter().filter(|_| may_name) {
            let mut names = Row::of(text, delimiter, i + 1);
            // Spreadsheets pad rows with separators.
            while names.cells.last().is_some_and(|(name, _)| name.is_empty()) {
                names.cells.pop();
            }
            let columns = names.cells.len();
            if columns < 3 - usize::from(preamble.theta_i.is_some()) {
                continue;
            }
            names.cells.iter_mut().for_each(|(_, column)| *column += line.text[..offset].chars().count());
            (names.alone, names.with_source) = (true, preamble.theta_i.is_some());
            let is_comment =
                |line: &Token<'_>| line.text.trim_start().starts_with('#') && units(line, delimiter, columns).is_none();
            let below = lines[i + 1..].iter().enumerate();
            let below = below.filter(|(_, line)| !line.text.trim().is_empty() && !is_comment(line));
            let mut below = below.map(|(j, line)| (i + 1 + j, line));
            let Some((mut first, mut row)) = below.next() else { continue };
            if let Some(cells) = units(row, delimiter, columns) {
                for ((name, _), unit) in names.cells.iter_mut().zip(&cells) {
                    let bracketed = unit.text.starts_with(['[', '(']) || unit.text.is_empty();
                    *name = if bracketed { format!("{name} {}", unit.text) } else { format!("{name} [{}]", unit.text) };
                    name.truncate(name.trim_end().len());
                }
                let Some(next) = below.next() else { continue };
                (first, row) = next;
            }
            let texts: Vec<&String> = names.cells.iter().map(|(name, _)| name).collect();
            let meanings = names::meanings(&texts, names.with_source);
            let has = |angle: usize| meanings.iter().any(|is| matches!(is, Meaning::Angle { k, .. } if *k == angle));
            let is_table = (has(0) || preamble.theta_i.is_some()) && has(2) && is_row(row.text, delimiter, &meanings);
            if is_table {
                let end = row.offset;
                return Some(Found { names, meanings, delimiter, lines: first, end, preamble });
            }
        }
        preamble.take(text);
    }
    None
}

/// Returns the cells of a row of units beneath the names of columns; `None` for any other line.
fn units<'a>(line: &Token<'a>, delimiter: Delimiter, columns: usize) -> Option<Vec<Token<'a>>> {
    let cells = delimiter.cells(Token { text: without_mark(line.text), offset: 0 });
    // A row of ones is one of numbers.
    let is_word = |cell: &Token<'_>| delimiter.number(cell.text).is_none() && !is_missing(cell.text);
    let are_units = cells.iter().all(|cell| is_unit(&cell.text.to_lowercase())) && cells.iter().any(is_word);
    (cells.len() >= columns && are_units).then_some(cells)
}

/// Returns true if the cells of a line are numbers, or missing, where the columns are angles. Rows with a cell too many
/// or too few are told as errors later.
fn is_row(line: &str, delimiter: Delimiter, meanings: &[Meaning]) -> bool {
    let cells = delimiter.cells(Token { text: line, offset: 0 });
    let marks = [false, true].map(|has_commas| Marks { has_commas, ..Marks::default() });
    let is_number = |text: &str| marks.iter().any(|marks| marks.number(text).is_some());
    let (mut numbers, mut others) = (0, 0);
    for (i, _) in meanings.iter().enumerate().filter(|(_, is)| matches!(is, Meaning::Angle { .. })) {
        match cells.get(i) {
            Some(cell) if is_number(cell.text) => numbers += 1,
            Some(cell) if is_missing(cell.text) => {}
            _ => others += 1,
        }
    }
    numbers > 0 && others == 0
}

/// Returns a line without comment marks, blanks and the separators that pad it.
fn without_mark(line: &str) -> &str {
    line.trim().trim_start_matches('#').trim()
}

/// Splits a line of the preamble into a name and what it says; `None` for prose.
fn statement(text: &str) -> Option<(&str, &str)> {
    let text = text.trim_end_matches([';', ',', '\t', ' ']);
    let at = text.find([':', '=', '\t', ';']).or_else(|| text.find(','))?;
    let (key, value) = text.split_at(at);
    let (key, value) = (key.trim(), value[1..].trim().trim_start_matches([';', ',', ':']).trim());
    let is_key = !key.is_empty() && key.len() <= LONGEST_KEY && !value.is_empty();
    is_key.then_some((key.trim_matches('"'), value.trim_matches('"')))
}

impl Preamble {
    /// Takes the angle of incidence or the wavelength that a line states.
    fn take(&mut self, text: &str) {
        let Some((key, value)) = statement(text) else { return };
        let length =
            value.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | ',' | '-' | '+'))).unwrap_or(value.len());
        let mut count = Count::default();
        count.add(&value[..length]);
        let Some((number, _)) = count.marks().number(&value[..length]) else { return };
        let unit =
            value[length..].trim().trim_matches(['[', ']', '(', ')']).trim_end_matches([';', ',']).to_lowercase();
        match names::of_line(key) {
            Meaning::Angle { k: 0, radians } => {
                let radians = radians.unwrap_or(unit == "rad");
                let known = unit.is_empty()
                    || unit.starts_with("rad")
                    || unit.starts_with("deg")
                    || unit.starts_with(['°', 'º'])
                    || unit.starts_with("gra");
                if known {
                    self.theta_i = Some(if radians { number.to_degrees() } else { number });
                }
            }
            Meaning::Wavelength(named) => {
                let unit = if unit.is_empty() { named } else { WavelengthUnit::of_name(&unit) };
                self.wavelength =
                    unit.map(|unit| unit.to_nanometres(number)).filter(|nm| *nm > 0.0).or(self.wavelength);
            }
            _ => {}
        }
    }
}

/// Constant statements of the lines before the table, for all of its rows.
pub(super) struct Constants {
    pub(super) theta_i: Option<f64>,
    pub(super) wavelength: Option<f64>,
    /// True if nothing states the unit of the angles.
    pub(super) angle_unit_assumed: bool,
}

impl Constants {
    /// Gives all rows the stated angle of incidence, and refuses angles in degrees that are hardly meant so.
    pub(super) fn apply(
        &self,
        rows: &mut Rows,
        columns: &mut Columns,
        report: &mut ParseReport,
    ) -> Result<(), FormatError> {
        if let Some(theta_i) = self.theta_i {
            rows.directions.iter_mut().for_each(|direction| direction[0] = theta_i);
        }
        if !columns.is_wide() && !columns.has_wavelength {
            report.note(ScatteringNote::BandNotStated);
        }
        let largest = rows.directions.iter().map(|direction| direction[2].abs().max(direction[0])).fold(0.0, f64::max);
        if self.angle_unit_assumed && largest > 0.0 && largest <= FRAC_PI_2 {
            let message = format!(
                "angles up to {} without a unit, which may be degrees or radians: expected one in the names of the columns, \
                 such as theta_o [rad], or a line `# angle_unit: rad`",
                Brief(largest)
            );
            return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
        }
        Ok(())
    }
}

/// Reads the names of the columns and the lines before them as the header of a radiometric-csv file. What they do not
/// say is assumed with a note, or asked for.
pub(super) fn head(
    source: &Source,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<(Head, Constants), FormatError> {
    let Some(found) = find(source) else {
        let message =
            "no row of names with an angle of the source and one of the detector, expected one above the numbers";
        return Err(FormatError::new(FormatErrorKind::Malformed, NAME, message));
    };
    refuse_repeated(&found)?;
    let mut fields = Vec::new();
    let mut prose = String::new();
    for (i, line) in source.lines().enumerate().take(found.names.line.saturating_sub(1)) {
        let text = without_mark(line.text);
        if text.is_empty() {
            continue;
        }
        prose.push_str(text);
        prose.push('\n');
        keep(text, line.text.trim_start().starts_with('#'), i + 1, &mut fields, report);
    }
    let Found { names, meanings, delimiter, lines, end, preamble } = found;
    let wavelength = preamble.wavelength.filter(|_| {
        let has_band = |is: &Meaning| match is {
            Meaning::Wavelength(_) | Meaning::Number(_) => true,
            Meaning::Value(value) => value.band.is_some(),
            _ => false,
        };
        !meanings.iter().any(has_band)
    });
    let theta_i = preamble.theta_i.filter(|_| !meanings.iter().any(|is| matches!(is, Meaning::Angle { k: 0, .. })));
    complete(&mut fields, &names);
    let angle_unit_assumed = state(&mut fields, &names, &meanings, &prose, how, report)?;
    if let Some(degrees) = theta_i {
        report.note(ScatteringNote::AngleOfIncidenceStated { degrees: Brief(degrees) });
    }
    if let Some(nanometres) = wavelength {
        report.note(ScatteringNote::BandStated { wavelength_nm: Brief(nanometres) });
    }
    let head = Head { fields, names, delimiter, lines, end };
    Ok((head, Constants { theta_i, wavelength, angle_unit_assumed }))
}

/// Refuses a table in which several columns are named as one angle: their names are angles at which the values in them
/// were measured.
fn refuse_repeated(found: &Found) -> Result<(), FormatError> {
    for (angle, name) in ANGLES.iter().enumerate() {
        let of_angle = |i: &usize| matches!(found.meanings[*i], Meaning::Angle { k, .. } if k == angle);
        let columns: Vec<usize> = (0..found.meanings.len()).filter(of_angle).collect();
        if columns.len() > 1 {
            let listed: Vec<String> = columns.iter().take(4).map(|&i| snippet(&found.names.cells[i].0)).collect();
            let message = format!(
                "{} columns of {name}, {}, expected one: values at several angles side by side are written one below the \
                 other, a row for each pair of angles",
                columns.len(),
                listed.join(", ")
            );
            let position = Some(Position::Text { line: found.names.line, column: found.names.cells[columns[1]].1 });
            return Err(FormatError { kind: FormatErrorKind::Unsupported, format: NAME, position, message });
        }
    }
    Ok(())
}

/// Keeps a line before the table as a line of the header if it is one, else as a keyword or a comment.
fn keep(text: &str, is_marked: bool, line: usize, fields: &mut Vec<Field>, report: &mut ParseReport) {
    let short = |text: &str| text.chars().take(4096).collect::<String>();
    let Some((key, value)) = statement(text) else {
        report.metadata.push(("comment".to_owned(), short(text.trim_end_matches([';', ',', '\t']))));
        return;
    };
    let lower = key.to_lowercase().replace([' ', '-'], "_");
    let says = match lower.as_str() {
        // In a line of prose these words may mean anything.
        "quantity" => StatedQuantity::in_file(value).is_some(),
        "unit" | "value_unit" => ValueUnit::of(value).is_some(),
        other => KNOWN.contains(&other) && other != NAME && other != "wavelengths" && other != "frame",
    };
    let is_known = is_marked && (KNOWN.contains(&lower.as_str()) || lower == "unit") && lower != NAME;
    if is_known || says {
        fields.push(Field { key: lower, value: short(value), line });
    } else {
        report.metadata.push((short(key), short(value)));
    }
}

/// Adds the lines of the header that the names of the columns stand for: quantity, units and cosine. Returns true if
/// the unit of the angles is assumed.
fn state(
    fields: &mut Vec<Field>,
    names: &Row,
    meanings: &[Meaning],
    prose: &str,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<bool, FormatError> {
    let stated = |fields: &[Field], key: &str| fields.iter().any(|field| field.key == key);
    let values: Vec<(usize, ValueName)> = meanings
        .iter()
        .enumerate()
        .filter_map(|(i, is)| if let Meaning::Value(value) = is { Some((i, *value)) } else { None })
        .collect();
    let add = |fields: &mut Vec<Field>, key: &str, value: &str| {
        fields.push(Field { key: key.to_owned(), value: value.to_owned(), line: names.line });
    };
    let asked = how.quantity;
    let of_field =
        fields.iter().find(|field| field.key == "quantity").and_then(|field| StatedQuantity::in_file(&field.value));
    let quantity = match asked.or(of_field) {
        Some(quantity) => Some(quantity),
        None if stated(fields, "quantity") => None,
        None => {
            let quantity = quantity(names, &values, prose, report)?;
            add(fields, "quantity", quantity.name());
            Some(quantity)
        }
    };
    let is_factor = quantity.is_some_and(StatedQuantity::is_factor);
    if !stated(fields, "value_unit") && !stated(fields, "unit") {
        let of_quantity = |value: &&(usize, ValueName)| value.1.quantity.is_some() || value.1.is_reflectance;
        let named = values.iter().find(of_quantity).or(values.first()).and_then(|(_, value)| value.unit);
        let unit = match named {
            Some(ValueUnit::Percent) => "%",
            Some(ValueUnit::One) => "1",
            Some(ValueUnit::PerSteradian) => "1/sr",
            None if is_factor => "1",
            None => {
                if how.unit.is_none() {
                    report.note(ValueNote::UnitNotStated { unit: Unit::PerSteradian });
                }
                "1/sr"
            }
        };
        add(fields, "value_unit", unit);
    }
    let angle_unit_assumed = !stated(fields, "angle_unit");
    if angle_unit_assumed {
        let of_column = |is: &Meaning| if let Meaning::Angle { radians, .. } = is { *radians } else { None };
        let known: Vec<bool> = meanings.iter().filter_map(of_column).collect();
        let radians = !known.is_empty() && known.iter().all(|&radians| radians);
        add(fields, "angle_unit", if radians { "rad" } else { "deg" });
        if known.is_empty() {
            report.note(ValueNote::AngleUnitNotStated);
        }
    }
    if !is_factor && !stated(fields, "cosine_included") {
        let has_cosine = values.iter().any(|(_, value)| value.has_cosine);
        add(fields, "cosine_included", if has_cosine { "true" } else { "false" });
        if !has_cosine {
            report.note(ScatteringNote::CosineNotStated);
        }
    }
    Ok(angle_unit_assumed && !meanings.iter().any(|is| matches!(is, Meaning::Angle { radians: Some(_), .. })))
}

/// Returns the quantity that the names of the values say, else the lines before the table.
fn quantity(
    names: &Row,
    values: &[(usize, ValueName)],
    prose: &str,
    report: &mut ParseReport,
) -> Result<StatedQuantity, FormatError> {
    let name = |i: usize| snippet(&names.cells[i].0);
    let mut found: Vec<(usize, StatedQuantity)> = Vec::new();
    for (i, value) in values {
        if let Some(quantity) = value.quantity
            && !found.iter().any(|(_, known)| *known == quantity)
        {
            found.push((*i, quantity));
        }
    }
    let position = Some(Position::Text { line: names.line, column: 1 });
    match found.as_slice() {
        [(_, quantity)] => return Ok(*quantity),
        [] => {}
        several => {
            let list: Vec<String> = several.iter().map(|(i, quantity)| format!("{} ({quantity})", name(*i))).collect();
            let message =
                format!("columns of several quantities, {}, expected those of one in a file", list.join(", "));
            return Err(FormatError { kind: FormatErrorKind::Unsupported, format: NAME, position, message });
        }
    }
    if let Some((i, _)) = values.iter().find(|(_, value)| value.is_reflectance) {
        report.note(ScatteringNote::ReflectanceAsFactor { name: Quoted::of(&names.cells[*i].0) });
        return Ok(StatedQuantity::ReflectanceFactor);
    }
    if let Some(quantity) = names::quantity_of_text(prose) {
        return Ok(quantity);
    }
    let angles: Vec<String> =
        names::meanings(&names.cells.iter().map(|(name, _)| name).collect::<Vec<_>>(), names.with_source)
            .iter()
            .enumerate()
            .filter_map(|(i, is)| match is {
                Meaning::Angle { k, .. } => Some(format!("{} {}", ANGLES[*k], name(i))),
                _ => None,
            })
            .collect();
    let of_values: Vec<String> = values.iter().take(4).map(|(i, _)| name(*i)).collect();
    let of_values = if of_values.is_empty() { String::new() } else { format!(" {}", of_values.join(", ")) };
    let message = format!(
        "a table over directions ({}) whose values{of_values} have no stated quantity, expected the option quantity: brdf, \
         reflectance-factor, btdf or bsdf",
        angles.join(", ")
    );
    Err(FormatError { kind: FormatErrorKind::NeedsOption, format: NAME, position, message })
}
