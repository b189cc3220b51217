//! `radiometric-arrow`: the columns and header keys of `radiometric-csv` as an Arrow IPC stream or file.
//!
//! The keys are metadata of the schema and the columns have the same names. A single column `values` of equally long
//! lists may replace `v400`, `v405` and so on; the key `wavelengths` then holds its wavelengths. A null or NaN is a
//! missing value.
//!
//! The body of a message is read in place. Its metadata are five small flatbuffer tables, read here with every offset
//! checked, because an array library would be more code to trust. Reference: Apache Arrow, "Arrow Columnar Format",
//! format version 1.5; the fields are numbered as in `Message.fbs` and `Schema.fbs`. A file is a stream between two
//! signatures.

mod batch;
mod flat;
mod schema;
#[cfg(test)]
mod tests;

use super::assemble;
use super::columns::{self, Columns, Row};
use super::header::{self, Field, Header};
use super::in_plane;
use super::problems::Problems;
use super::remarks::remarks;
use crate::formats::acquisition::{Acquisition, ParseReport};
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::interpretation::Interpretation;
use crate::formats::reader::{FACTOR, Format, Reader, Sample};
use crate::formats::text::{Brief, number, snippet};
use crate::notes::ValueNote;
use batch::{Batches, Refusal};
use flat::{Broken, Table};
use schema::{Column, Kind, Schema};

const NAME: &str = "radiometric-arrow";

pub(in crate::formats) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "radiometric-arrow: the columns of radiometric-csv as an Arrow IPC stream or file (.arrow, .arrows)",
        extensions: &["arrow", "arrows"],
        reads: true,
        writes: false,
    },
    options: &["wavelength_unit", "normalization", "in_plane_sign", FACTOR],
    probe: |sample: &Sample<'_>| {
        let is_stream = sample.bytes.starts_with(CONTINUES) || sample.bytes.starts_with(FILE);
        if is_stream { 95 } else { 0 }
    },
    read,
};

/// Marker of four bytes before each message of an Arrow stream, and the signature of an Arrow file.
const CONTINUES: &[u8] = b"\xff\xff\xff\xff";
const FILE: &[u8] = b"ARROW1\0\0";
/// Upper bound on the metadata of one Arrow message in bytes; the largest schema that is read is smaller.
const MAX_METADATA: usize = 1 << 24;

/// Types of Arrow messages, as numbered in the union `MessageHeader` of Arrow's `Message.fbs`.
const SCHEMA: u8 = 1;
const DICTIONARY: u8 = 2;
const BATCH: u8 = 3;

fn refused(kind: FormatErrorKind, at: usize, message: impl Into<String>) -> FormatError {
    FormatError::at_byte(kind, NAME, at, message)
}

fn malformed(at: usize, message: impl Into<String>) -> FormatError {
    refused(FormatErrorKind::Malformed, at, message)
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let mut report = ParseReport::default();
    let mut messages = Messages { bytes, at: if bytes.starts_with(FILE) { FILE.len() } else { 0 } };
    let start = messages.at;
    let schema = match messages.next()? {
        Some(Message { kind: SCHEMA, header, .. }) => schema::read(header).map_err(|refusal| match refusal {
            schema::Refusal::Malformed => {
                malformed(start, "a reference in the Arrow schema leads outside it, expected one within it")
            }
            schema::Refusal::Unsupported(message) => refused(FormatErrorKind::Unsupported, start, message),
            schema::Refusal::OverLimit(message) => refused(FormatErrorKind::OverLimit, start, message),
        })?,
        _ => return Err(malformed(start, "the stream does not begin with a schema, expected one before the batches")),
    };
    let named = |error: FormatError| FormatError { format: NAME, ..error };
    let mut problems = Problems::default();
    let header = header::read(&schema.fields, how, &mut report, &mut problems).map_err(named)?;
    let (columns, cells) = match &header {
        Some(header) => columns(&schema, header, &mut report, &mut problems)?,
        None => (None, Vec::new()),
    };
    let (Some(header), Some(columns)) = (header, columns) else {
        return Err(named(problems.into_error().unwrap_or_else(|| {
            malformed(start, "the columns of the Arrow stream make no table, expected columns as in radiometric-csv")
        })));
    };
    let mut batches = Batches::new(&schema.columns, &cells, &columns, header.cosine_included);
    let mut count = 0_usize;
    while let Some(Message { kind, at, header, body }) = messages.next()? {
        match kind {
            BATCH => batches.batch(header, body).map_err(|refusal| match refusal {
                Refusal::Broken(message) => malformed(at, format!("batch {count}: {message}")),
                Refusal::Unsupported(message) => refused(FormatErrorKind::Unsupported, at, message),
                Refusal::OverLimit(message) => refused(FormatErrorKind::OverLimit, at, message),
            })?,
            DICTIONARY => continue,
            _ => return Err(malformed(at, format!("an Arrow message of kind {kind}, expected a batch of rows"))),
        }
        count += 1;
    }
    let Batches { mut rows, problems, rounded, .. } = batches;
    if let Some(error) = problems.into_error() {
        return Err(named(error));
    }
    if rounded {
        report.note(ValueNote::AnglesRounded { stored_as: "float32" });
    }
    decimal_wavelengths(&mut rows.wavelengths.values);
    let mut columns = columns;
    in_plane::turn(&mut rows, &mut columns, &header, false, how, &mut report).map_err(named)?;
    remarks(&header, &columns, rows.grazing, &mut report);
    let form = if columns.is_wide() { "wide" } else { "long" };
    let places = rows.values.len() / columns.width();
    let samples = assemble::samples(rows, &columns, &header, &mut report).map_err(named)?;
    Ok(Acquisition {
        format: NAME,
        dialect: format!("{form} form, {places} rows in {count} batches, {}", assemble::kind(&samples)),
        quantity: header.quantity,
        unit: header.unit_of(&samples),
        samples,
        spectral_factor: None,
        instrument: header.instrument,
        report,
    })
}

/// Replaces wavelengths stored in float32 by the shortest decimal numbers they represent: 550.1, not 550.099976.
fn decimal_wavelengths(values: &mut [f64]) {
    for value in values {
        let single = *value as f32;
        if f64::from(single) == *value
            && let Some(decimal) = number(&single.to_string())
        {
            *value = decimal;
        }
    }
}

/// Returns the columns of an Arrow schema as if they were named in a text file: a column of lists gets one name for
/// each list entry. Also returns, for each column of the schema, the index of its first name in the list of all names.
fn columns(
    schema: &Schema,
    header: &Header,
    report: &mut ParseReport,
    problems: &mut Problems,
) -> Result<(Option<Columns>, Vec<usize>), FormatError> {
    let (mut names, mut cells) = (Vec::new(), Vec::new());
    for column in &schema.columns {
        cells.push(names.len());
        let letter = match column.name.trim().to_lowercase().as_str() {
            "values" | "value" => "v",
            "sigma" | "sigmas" => "s",
            _ => "list ",
        };
        match column.kind {
            Kind::Lists(_, length) => names.extend(spelled_out(column, letter, length, &schema.fields)?),
            _ => names.push(column.name.clone()),
        }
    }
    let cells_of = names.into_iter().map(|name| (name, 0)).collect();
    let row = Row { cells: cells_of, line: 0, alone: false, with_source: false };
    let read = columns::read(&row, header, None, report, problems);
    if let Some(read) = &read {
        for (column, &first) in schema.columns.iter().zip(&cells) {
            let is_read = read.cells.get(first).is_some_and(|cell| *cell != columns::Cell::Ignored);
            if is_read && matches!(column.kind, Kind::Other { .. }) {
                let message = format!(
                    "column {} holds no numbers, expected int, float32 or float64, or lists of these of one length",
                    snippet(&column.name)
                );
                return Err(FormatError::new(FormatErrorKind::Unsupported, NAME, message));
            }
        }
    }
    Ok((read, cells))
}

/// Returns a column name for each entry of the lists in a column, for example `v550` for a value at 550 nm.
fn spelled_out(column: &Column, letter: &str, length: usize, fields: &[Field]) -> Result<Vec<String>, FormatError> {
    if !matches!(letter, "v" | "s") {
        return Ok((0..length).map(|i| format!("{letter}{i} of {}", column.name)).collect());
    }
    let needs = |found: String| {
        let message = format!(
            "column {} has lists of {length} numbers, {found}: expected the metadata `wavelengths` with {length} numbers \
             separated by blanks",
            snippet(&column.name)
        );
        FormatError::new(FormatErrorKind::Malformed, NAME, message)
    };
    let Some(field) = fields.iter().find(|field| field.key == "wavelengths") else {
        return Err(needs("but their wavelengths are not stated".to_owned()));
    };
    let separates = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '[' | ']');
    let mut listed = Vec::with_capacity(length);
    for word in field.value.split(separates).filter(|word| !word.is_empty()) {
        let wavelength =
            number(word).ok_or_else(|| needs(format!("but {} stands among their wavelengths", snippet(word))))?;
        if wavelength < 0.0 {
            return Err(needs(format!("but {} stands among their wavelengths", Brief(wavelength))));
        }
        listed.push(format!("{letter}{wavelength}"));
    }
    if listed.len() == length { Ok(listed) } else { Err(needs(format!("but {} wavelengths are stated", listed.len()))) }
}

/// Reader of the messages of an Arrow stream.
struct Messages<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// One message of an Arrow stream.
struct Message<'a> {
    kind: u8,
    /// Byte offset in the Arrow stream at which the message starts.
    at: usize,
    header: Table<'a>,
    body: &'a [u8],
}

impl<'a> Messages<'a> {
    /// Returns the next message (schema, dictionary or batch of rows) of an Arrow IPC stream; `None` at the marker that
    /// ends the stream.
    fn next(&mut self) -> Result<Option<Message<'a>>, FormatError> {
        let at = self.at;
        let Some(rest) = self.bytes.get(at..).filter(|rest| !rest.is_empty()) else {
            return Err(malformed(at, "the stream ends without its end mark, expected a writer that was closed"));
        };
        let Some(length) = rest.strip_prefix(CONTINUES).and_then(|rest| rest.first_chunk::<4>()) else {
            return Err(malformed(at, "no Arrow message starts here, expected 0xFFFFFFFF and a length"));
        };
        let start = at + 8;
        let length = u32::from_le_bytes(*length) as usize;
        if length == 0 {
            return Ok(None);
        }
        if length > MAX_METADATA {
            let message = format!("an Arrow message with metadata of {length} bytes, expected at most {MAX_METADATA}");
            return Err(refused(FormatErrorKind::OverLimit, at, message));
        }
        let cut = |found: usize, expected: usize| {
            malformed(at, format!("the file ends within an Arrow message: {found} bytes, expected {expected}"))
        };
        let metadata = self.bytes.get(start..start + length);
        let metadata = metadata.ok_or_else(|| cut(self.bytes.len().saturating_sub(start), length))?;
        let broken =
            |Broken| malformed(at, "a reference in Arrow message metadata leads outside them, expected one within");
        let message = Table::root(metadata).map_err(broken)?;
        let kind = message.byte(1).map_err(broken)?;
        let header = message
            .table(2)
            .map_err(broken)?
            .ok_or_else(|| malformed(at, "an Arrow message without a header, expected a batch of rows"))?;
        let body_at = start + length;
        let size = message.long(3).map_err(broken)?;
        let size = usize::try_from(size)
            .map_err(|_| malformed(at, format!("an Arrow message has a body of {size} bytes, expected 0 or more")))?;
        let end = body_at.checked_add(size);
        let body =
            end.and_then(|end| self.bytes.get(body_at..end)).ok_or_else(|| cut(self.bytes.len() - body_at, size))?;
        self.at = body_at + size;
        Ok(Some(Message { kind, at, header, body }))
    }
}
