//! Row-wise access to two-dimensional arrays: dimensions from the header, and numbers from a row's bytes.

use super::about::{MAGIC, NAME};
use super::element::Element;
use super::header::{Header, header_of, parse_header};
use super::refusal::malformed;
use crate::formats::error::{FormatError, FormatErrorKind};

/// Layout of the rows of a two-dimensional array file, known from its header alone.
#[derive(Clone, Copy)]
pub struct ArrayRows {
    element: Element,
    rows: usize,
    columns: usize,
    data_at: usize,
}

impl ArrayRows {
    /// Number of bytes at the start of an array file that always contain its header.
    pub const HEAD: usize = (1 << 16) + 16;

    /// Returns true if `head` starts with the signature of a `NumPy` array file.
    pub fn is_array(head: &[u8]) -> bool {
        head.starts_with(MAGIC)
    }

    /// Reads the header of an array from the first bytes of its file, up to [`ArrayRows::HEAD`] of them.
    pub fn of(head: &[u8]) -> Result<Self, FormatError> {
        if !Self::is_array(head) {
            return Err(malformed(0, "the file does not begin with the signature of a NumPy array, expected an array"));
        }
        let (text, data_at) = header_of(head)?;
        let Header { element, fortran_order, shape } = parse_header(text, data_at)?;
        match *shape.as_slice() {
            [rows, columns] if !fortran_order => Ok(Self { element, rows, columns, data_at }),
            _ => {
                let order = if fortran_order { " in Fortran order" } else { "" };
                let message = format!("an array of shape {shape:?}{order}, expected [rows, columns] in C order");
                Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, data_at, message))
            }
        }
    }

    /// Returns the number of rows of a two-dimensional NumPy array.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Returns the number of values in a row of the array.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the byte offset of the array's first row in its file.
    pub fn data_at(&self) -> usize {
        self.data_at
    }

    /// Returns the size in bytes of one value of the array.
    pub fn size(&self) -> usize {
        self.element.size
    }

    /// Decodes the bytes of some rows of the array and appends the values to `numbers`. An incomplete last value is
    /// ignored.
    pub fn numbers(&self, bytes: &[u8], numbers: &mut Vec<f64>) {
        let Element { size, big_endian, value, .. } = self.element;
        numbers.extend(bytes.chunks_exact(size).map(|bytes| value(bytes, big_endian)));
    }
}

impl std::fmt::Debug for ArrayRows {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "[{}, {}] of {}", self.rows, self.columns, self.element.name)
    }
}

#[cfg(test)]
mod tests {
    use super::super::write_npy;
    use super::*;

    #[test]
    fn rows_are_those_that_were_written() {
        let bytes = write_npy(&[2, 3], &[1.0, 2.0, 3.5, -4.0, 0.0, 6.0]);
        let rows = ArrayRows::of(&bytes).unwrap();
        assert_eq!((rows.rows(), rows.columns(), rows.data_at(), rows.size()), (2, 3, bytes.len() - 24, 4));
        let mut found = Vec::new();
        rows.numbers(&bytes[rows.data_at()..bytes.len() - 1], &mut found);
        assert_eq!(found, [1.0, 2.0, 3.5, -4.0, 0.0]);
        assert!(format!("{rows:?}").contains("[2, 3] of f4"));
        for (bytes, word) in [
            (write_npy(&[6], &[0.0; 6]), "expected [rows, columns]"),
            (b"theta_i,phi_i\n".to_vec(), "expected an array"),
            (bytes[..40].to_vec(), "expected it within"),
        ] {
            assert!(ArrayRows::of(&bytes).unwrap_err().to_string().contains(word), "{word}");
        }
    }
}
