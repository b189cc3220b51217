//! Numbers in the text of elements, with their positions.

use crate::formats::error::FormatError;
use crate::formats::text::{Source, number, snippet};

/// Content of an element with its byte offset in the text of the file.
pub(super) type Placed<T> = (T, usize);

/// Returns the number in the text of the element `name`.
pub(super) fn number_of(text: &str, name: &str, offset: usize, source: &Source) -> Result<f64, FormatError> {
    number(text)
        .ok_or_else(|| source.malformed(offset, format!("found {}, expected a number as {name}", snippet(text))))
}
