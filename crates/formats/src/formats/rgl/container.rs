//! Tensor-file container: named arrays behind a table of their types, shapes and offsets, all little-endian.
//!
//! Layout: `tensor_file\0`, version 1.0 as two bytes, u32 number of fields. Each field has u16 length of its name, the
//! name, u16 number of dimensions, u8 type, u64 offset from the beginning of the file, and one u64 per dimension.
//! Arrays are row-major, at any offset.

use super::super::error::{FormatError, FormatErrorKind};
use super::super::text::snippet;
use super::about::NAME;
use super::refusal::{malformed, over_limit};
use crate::domain::limits::{MAX_AXES, MAX_SAMPLES};

/// First bytes of every tensor file, the container of RGL measurements.
pub(super) const MAGIC: &[u8; 12] = b"tensor_file\0";

const MAX_FIELDS: u32 = 64;
const MAX_NAME: u16 = 256;

/// Number types of a tensor file by their code, with their sizes in bytes; code 0 is invalid.
const TYPES: [(&str, usize); 12] = [
    ("invalid", 0),
    ("u8", 1),
    ("i8", 1),
    ("u16", 2),
    ("i16", 2),
    ("u32", 4),
    ("i32", 4),
    ("u64", 8),
    ("i64", 8),
    ("f16", 2),
    ("f32", 4),
    ("f64", 8),
];

/// Named array in a tensor file, known to lie within the file.
pub(super) struct Field<'a> {
    pub(super) name: &'a str,
    /// Byte offset of the array's entry in the file's list of named arrays (fields).
    pub(super) entry: usize,
    pub(super) shape: Vec<usize>,
    /// Byte offset of the array's data in the tensor file.
    pub(super) at: usize,
    kind: &'static str,
    data: &'a [u8],
}

/// All fields (named arrays) of a tensor file.
pub(super) struct Fields<'a> {
    fields: Vec<Field<'a>>,
    /// Byte offset of the end of the file's list of named arrays (fields).
    end: usize,
}

impl<'a> Fields<'a> {
    /// Reads the table of fields of a tensor file and checks that every array lies within `bytes`. Array data are not
    /// copied.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, FormatError> {
        let mut cursor = Cursor { bytes, at: 0 };
        let magic = cursor.take::<12>("the signature")?;
        if magic != *MAGIC {
            let found = String::from_utf8_lossy(&magic).into_owned();
            return Err(malformed(0, format!("found {}, expected `tensor_file` and a zero byte", snippet(&found))));
        }
        let [major, minor] = cursor.take::<2>("the version")?;
        if (major, minor) != (1, 0) {
            let message = format!("version {major}.{minor} of the tensor file, expected 1.0");
            return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, 12, message));
        }
        let count = u32::from_le_bytes(cursor.take("the number of fields")?);
        if count > MAX_FIELDS {
            return Err(over_limit(14, format!("{count} fields, expected at most {MAX_FIELDS}")));
        }
        let mut fields: Vec<Field<'a>> = Vec::with_capacity(count as usize);
        for _ in 0..count {
            let field = cursor.field()?;
            if fields.iter().any(|other| other.name == field.name) {
                let message = format!("the field {} is listed twice, expected each once", snippet(field.name));
                return Err(malformed(field.entry, message));
            }
            fields.push(field);
        }
        Ok(Self { fields, end: cursor.at })
    }

    /// Returns the named array `name` of a tensor file; `None` if the file has none.
    pub(super) fn get(&self, name: &str) -> Option<&Field<'a>> {
        self.fields.iter().find(|field| field.name == name)
    }

    /// Returns the named array `name` of a tensor file, or an error if the file has none.
    pub(super) fn require(&self, name: &str) -> Result<&Field<'a>, FormatError> {
        self.get(name).ok_or_else(|| self.missing(name))
    }

    /// Returns the error for a tensor file without the named array `name`.
    pub(super) fn missing(&self, name: &str) -> FormatError {
        malformed(self.end, format!("the list of fields ends without `{name}`, expected this field"))
    }

    /// Returns the names of all arrays of a tensor file, in file order.
    pub(super) fn names(&self) -> impl Iterator<Item = &'a str> {
        self.fields.iter().map(|field| field.name)
    }
}

impl<'a> Field<'a> {
    /// Refuses an array of a tensor file unless it has number type `kind`, `rank` dimensions and at least one number.
    pub(super) fn check(&self, kind: &str, rank: usize) -> Result<(), FormatError> {
        let Self { name, entry, shape, .. } = self;
        if self.kind != kind || shape.len() != rank {
            let message = format!(
                "`{name}` is an array of {} with the shape {shape:?}, expected {kind} with {rank} dimensions",
                self.kind
            );
            return Err(malformed(*entry, message));
        }
        if shape.contains(&0) {
            return Err(malformed(
                *entry,
                format!("`{name}` has the shape {shape:?} with nothing in it, expected 1 or more along each axis"),
            ));
        }
        let count = shape.iter().try_fold(1_usize, |n, &length| n.checked_mul(length));
        if count.is_none_or(|n| n > MAX_SAMPLES) {
            let message = format!("`{name}` has the shape {shape:?}, more than the limit of {MAX_SAMPLES} numbers");
            return Err(over_limit(*entry, message));
        }
        Ok(())
    }

    /// Refuses an array of a tensor file unless its shape (the number of entries along each axis) is `expected`.
    pub(super) fn check_shape(&self, expected: &[usize], why: &str) -> Result<(), FormatError> {
        if self.shape == expected {
            return Ok(());
        }
        let Self { name, shape, .. } = self;
        Err(malformed(self.entry, format!("`{name}` has the shape {shape:?}, expected {expected:?} ({why})")))
    }

    /// Returns the data of a named array of a tensor file; an error unless it is a one-dimensional array of bytes.
    pub(super) fn bytes(&self) -> Result<&'a [u8], FormatError> {
        if self.kind == "u8" && self.shape.len() == 1 {
            return Ok(self.data);
        }
        let Self { name, entry, shape, kind, .. } = self;
        Err(malformed(*entry, format!("`{name}` is an array of {kind} with the shape {shape:?}, expected u8 in a row")))
    }

    /// Returns the numbers of a checked f32 array of a tensor file, in file order.
    pub(super) fn floats(&self) -> impl ExactSizeIterator<Item = f32> + Clone {
        self.words().iter().map(|bytes| f32::from_le_bytes(*bytes))
    }

    /// Returns the numbers of a checked f32 array of a tensor file as groups of four bytes.
    pub(super) fn words(&self) -> &'a [[u8; 4]] {
        self.data.as_chunks().0
    }
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], FormatError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let Some(chunk) = rest.first_chunk::<N>() else {
            return Err(malformed(self.at, format!("the file ends in {what}: {} bytes, expected {N}", rest.len())));
        };
        self.at += N;
        Ok(*chunk)
    }

    fn field(&mut self) -> Result<Field<'a>, FormatError> {
        let entry = self.at;
        let length = u16::from_le_bytes(self.take("the length of a field's name")?);
        if length > MAX_NAME {
            return Err(over_limit(entry, format!("a field's name of {length} bytes, expected at most {MAX_NAME}")));
        }
        let start = self.at;
        let name = self.bytes.get(start..start + usize::from(length)).ok_or_else(|| {
            malformed(start, format!("the file ends in a field's name, expected {length} bytes from byte {start} on"))
        })?;
        let name = std::str::from_utf8(name).map_err(|e| {
            malformed(start + e.valid_up_to(), "a byte in a field's name that is not UTF-8, expected text")
        })?;
        self.at = start + usize::from(length);
        let rank = u16::from_le_bytes(self.take("the number of a field's dimensions")?);
        if usize::from(rank) > MAX_AXES {
            let message = format!("the field {} has {rank} dimensions, expected at most {MAX_AXES}", snippet(name));
            return Err(over_limit(self.at - 2, message));
        }
        let [code] = self.take("the type of a field")?;
        let Some(&(kind, size)) = TYPES.get(usize::from(code)).filter(|(_, size)| *size > 0) else {
            let message = format!("the field {} has the type {code}, expected 1 (u8) to 11 (f64)", snippet(name));
            return Err(malformed(self.at - 1, message));
        };
        let offset = u64::from_le_bytes(self.take("the offset of a field")?);
        let mut lengths = Vec::with_capacity(usize::from(rank));
        for _ in 0..rank {
            lengths.push(u64::from_le_bytes(self.take("the shape of a field")?));
        }
        let data = self.data(&lengths, size, offset).ok_or_else(|| {
            let message = format!(
                "the field {} of shape {lengths:?} and type {kind} starts at byte {offset}, expected it within the \
                 file's {} bytes",
                snippet(name),
                self.bytes.len()
            );
            malformed(entry, message)
        })?;
        // Conversion only saturates for an empty array, because the total size fits the file.
        let shape = lengths.iter().map(|&n| usize::try_from(n).unwrap_or(usize::MAX)).collect();
        Ok(Field { name, entry, shape, at: offset as usize, kind, data })
    }

    /// Returns the bytes of an array in a tensor file; `None` if it does not lie within the file.
    fn data(&self, lengths: &[u64], size: usize, offset: u64) -> Option<&'a [u8]> {
        let count = lengths.iter().try_fold(size as u64, |product, &n| product.checked_mul(n))?;
        let end = offset.checked_add(count)?;
        self.bytes.get(usize::try_from(offset).ok()?..usize::try_from(end).ok()?)
    }
}
