//! Schema of a stream: header keys, and the type of each column (numbers, lists of numbers, or not read).

use super::super::header::Field;
use super::flat::{Broken, Table};
use crate::domain::limits::MAX_ENTRIES;

/// Number type of a column in an Arrow stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    F32,
    F64,
    Signed(usize),
    Unsigned(usize),
}

impl Element {
    /// Returns the size of one number of the column in bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F64 => 8,
            Self::Signed(size) | Self::Unsigned(size) => size,
        }
    }

    /// Returns the number stored in `bytes`, whose count must be the size of the number type.
    #[inline]
    pub(super) fn value(self, bytes: &[u8]) -> f64 {
        if let (Self::F64, Some(bytes)) = (self, bytes.first_chunk()) {
            return f64::from_le_bytes(*bytes);
        }
        let mut little = [0; 8];
        little[..bytes.len()].copy_from_slice(bytes);
        let bits = u64::from_le_bytes(little);
        match self {
            Self::F32 => f64::from(f32::from_bits(bits as u32)),
            Self::F64 => f64::from_bits(bits),
            Self::Signed(size) => {
                let unused = 64 - 8 * size as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
            Self::Unsigned(_) => bits as f64,
        }
    }
}

/// Content of a column in an Arrow stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Numbers(Element),
    /// Each row of the column holds a list of numbers, described by their type and their fixed count per row.
    Lists(Element, usize),
    /// The column is not read; it is skipped by the number of its nodes and buffers in a record batch.
    Other {
        nodes: usize,
        buffers: usize,
    },
}

impl Kind {
    /// Returns the number of Arrow nodes, and the number of buffers, that the column has in a record batch.
    pub(super) fn parts(self) -> (usize, usize) {
        match self {
            Self::Numbers(_) => (1, 2),
            Self::Lists(..) => (2, 3),
            Self::Other { nodes, buffers } => (nodes, buffers),
        }
    }
}

/// Column of an Arrow stream with its name and content.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// Contents of the schema of an Arrow stream.
pub(super) struct Schema {
    pub(super) fields: Vec<Field>,
    pub(super) columns: Vec<Column>,
}

/// Reason why the schema of an Arrow stream is rejected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    Malformed,
    Unsupported(String),
    OverLimit(String),
}

impl From<Broken> for Refusal {
    fn from(_: Broken) -> Self {
        Self::Malformed
    }
}

/// Upper bounds on the number of metadata keys in a schema, and on the nesting depth of its fields. Raising them
/// accepts larger schemas.
const MAX_KEYS: usize = 1000;
const MAX_DEPTH: usize = 8;
/// Upper bound on the characters that are kept of a metadata value.
const MAX_TEXT: usize = 1 << 20;

/// Reads the schema of an Arrow stream (the table `Schema` in Arrow's `Schema.fbs`).
pub(super) fn read(schema: Table<'_>) -> Result<Schema, Refusal> {
    if schema.short(0)? != 0 {
        return Err(Refusal::Unsupported("big-endian numbers, expected little-endian".to_owned()));
    }
    let keys = schema.tables(2)?;
    if keys.len() > MAX_KEYS {
        return Err(Refusal::OverLimit(format!("{} keys of metadata, expected at most {MAX_KEYS}", keys.len())));
    }
    let mut fields = Vec::with_capacity(keys.len());
    for i in 0..keys.len() {
        let pair = keys.table(i)?;
        let (key, value) = (pair.text(0)?.unwrap_or_default(), pair.text(1)?.unwrap_or_default());
        let (key, value) = (key.trim().to_lowercase(), value.trim());
        // Other libraries store their own schemas under these keys.
        if !matches!(key.as_str(), "pandas" | "arrow:schema" | "huggingface") {
            fields.push(Field { key, value: value.chars().take(MAX_TEXT).collect(), line: 0 });
        }
    }
    let described = schema.tables(1)?;
    if described.len() > MAX_ENTRIES {
        return Err(Refusal::OverLimit(format!("{} columns, expected at most {MAX_ENTRIES}", described.len())));
    }
    let mut columns = Vec::with_capacity(described.len());
    let mut looked_at = 0;
    for i in 0..described.len() {
        let field = described.table(i)?;
        let name = field.text(0)?.unwrap_or_default();
        let kind = kind(field, name, MAX_DEPTH, &mut looked_at)?;
        // The names are parsed like a text row, so commas and control characters are replaced.
        let name = name.chars().take(256).map(|c| if c == ',' || c.is_control() { '\u{fffd}' } else { c }).collect();
        columns.push(Column { name, kind });
    }
    Ok(Schema { fields, columns })
}

fn kind(field: Table<'_>, name: &str, depth: usize, looked_at: &mut usize) -> Result<Kind, Refusal> {
    const MOST: usize = 4 * MAX_ENTRIES;
    *looked_at += 1;
    if depth == 0 || *looked_at > MOST {
        return Err(Refusal::OverLimit(format!(
            "columns inside columns, expected at most {MAX_DEPTH} levels and {MOST} in all"
        )));
    }
    // Dictionary-encoded values are indices.
    if field.table(4)?.is_some() {
        return Ok(Kind::Other { nodes: 1, buffers: 2 });
    }
    let children = field.tables(5)?;
    let mut parts = |buffers: usize| -> Result<Kind, Refusal> {
        let mut all = (1, buffers);
        for i in 0..children.len() {
            let (nodes, buffers) = kind(children.table(i)?, name, depth - 1, looked_at)?.parts();
            all = (all.0 + nodes, all.1 + buffers);
        }
        Ok(Kind::Other { nodes: all.0, buffers: all.1 })
    };
    let ty = field.table(3)?;
    // Type codes of the union `Type`.
    match field.byte(2)? {
        // Null; run-end encoded values.
        1 => Ok(Kind::Other { nodes: 1, buffers: 0 }),
        22 => parts(0),
        2 | 3 => Ok(element(field)?.map_or(Kind::Other { nodes: 1, buffers: 2 }, Kind::Numbers)),
        // Booleans, decimals, times, fixed-size binary.
        6..=11 | 15 | 18 => Ok(Kind::Other { nodes: 1, buffers: 2 }),
        // Variable-size binary and texts.
        4 | 5 | 19 | 20 => Ok(Kind::Other { nodes: 1, buffers: 3 }),
        // Variable-size lists, maps.
        12 | 17 | 21 => parts(2),
        13 => parts(1),
        16 => {
            let size = ty.map_or(Ok(0), |ty| ty.int(0))?;
            let inner = if children.len() == 1 { element(children.table(0)?)? } else { None };
            match (inner, usize::try_from(size)) {
                (Some(element), Ok(size)) if (1..=MAX_ENTRIES).contains(&size) => Ok(Kind::Lists(element, size)),
                _ => parts(1),
            }
        }
        other => Err(Refusal::Unsupported(format!(
            "column {} is of type {other} of Arrow, expected numbers, or lists of numbers of one length",
            crate::formats::text::snippet(name)
        ))),
    }
}

/// Returns the number type of a field in an Arrow schema; `None` if fields of its type are not read.
fn element(field: Table<'_>) -> Result<Option<Element>, Broken> {
    if field.table(4)?.is_some() {
        return Ok(None);
    }
    let Some(ty) = field.table(3)? else { return Ok(None) };
    Ok(match field.byte(2)? {
        2 => {
            let signed = ty.byte(1)? != 0;
            let size = match ty.int(0)? {
                8 => 1,
                16 => 2,
                32 => 4,
                64 => 8,
                _ => return Ok(None),
            };
            Some(if signed { Element::Signed(size) } else { Element::Unsigned(size) })
        }
        3 => match ty.short(0)? {
            1 => Some(Element::F32),
            2 => Some(Element::F64),
            _ => None,
        },
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_type_are_their_values() {
        assert_eq!(Element::F32.value(&(-2.5_f32).to_le_bytes()), -2.5);
        assert_eq!(Element::F64.value(&0.1_f64.to_le_bytes()), 0.1);
        assert_eq!(Element::Signed(1).value(&[0xFF]), -1.0);
        assert_eq!(Element::Signed(2).value(&(-300_i16).to_le_bytes()), -300.0);
        assert_eq!(Element::Signed(4).value(&(-3_i32).to_le_bytes()), -3.0);
        assert_eq!(Element::Signed(8).value(&i64::MIN.to_le_bytes()), i64::MIN as f64);
        assert_eq!(Element::Unsigned(2).value(&60_000_u16.to_le_bytes()), 60_000.0);
        assert_eq!(Element::Unsigned(8).value(&u64::MAX.to_le_bytes()), u64::MAX as f64);
    }
}
