//! Arrays of an ASD file: the spectrum, and from version 2 on the white reference with its own small header.

use super::about::NAME;
use super::header::{Header, LENGTH, short, text_of};
use crate::formats::error::{FormatError, FormatErrorKind};

/// Length of the header of the white reference in bytes without its text: a flag, two times, the length of the text.
const REFERENCE_HEADER: usize = 20;
/// Offset of the length of the text in the header of the white reference.
const TEXT_LENGTH: usize = 18;

/// Arrays of a file: the spectrum, and the white reference if one was taken.
pub(super) struct Arrays {
    pub(super) spectrum: Vec<f64>,
    pub(super) reference: Option<Vec<f64>>,
    /// Text that the user wrote beside the white reference.
    pub(super) description: String,
    /// Number of bytes behind the arrays.
    pub(super) rest: usize,
}

pub(super) fn read(file: &[u8], header: &Header) -> Result<Arrays, FormatError> {
    let length = header.channels * header.element.bytes();
    let spectrum = array(file, LENGTH, header, "the spectrum")?;
    let at = LENGTH + length;
    let mut arrays = Arrays { spectrum, reference: None, description: String::new(), rest: file.len() - at };
    if header.version < 2 || arrays.rest == 0 {
        return Ok(arrays);
    }
    if arrays.rest < REFERENCE_HEADER {
        let message =
            format!("the file ends, expected {REFERENCE_HEADER} bytes from byte {at} before the white reference");
        return Err(FormatError::at_byte(FormatErrorKind::Malformed, NAME, file.len(), message));
    }
    let is_taken = match short(file, at) {
        0 => false,
        1 | 0xffff => true,
        other => {
            let message = format!(
                "found {other:#06x}, expected 0 or 0xffff (a white reference was taken): export the spectrum as text, if its \
                 program reads the file"
            );
            return Err(FormatError::at_byte(FormatErrorKind::Malformed, NAME, at, message));
        }
    };
    if !is_taken {
        return Ok(arrays);
    }
    let text = at + REFERENCE_HEADER;
    let start = text + usize::from(short(file, at + TEXT_LENGTH));
    arrays.reference = Some(array(file, start, header, "the white reference")?);
    arrays.description = text_of(&file[text..start]);
    arrays.rest = file.len() - start - length;
    Ok(arrays)
}

/// Returns the numbers of an array that starts at a byte offset; `what` names it in the refusal of a file that is too
/// short.
fn array(file: &[u8], start: usize, header: &Header, what: &str) -> Result<Vec<f64>, FormatError> {
    let (element, channels) = (header.element, header.channels);
    let end = start + channels * element.bytes();
    let part = file.get(start..end).ok_or_else(|| {
        let message = format!(
            "the file ends, expected {what} of {channels} numbers of {} bytes from byte {start} to {end}",
            element.bytes()
        );
        FormatError::at_byte(FormatErrorKind::Malformed, NAME, file.len(), message)
    })?;
    Ok(part.chunks_exact(element.bytes()).map(|number| element.number(number)).collect())
}
