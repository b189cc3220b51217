//! Samples of an array in row-major order, for any element type and storage order.

use super::about::{MAGIC, NAME};
use super::element::Element;
use super::header::{Header, header_of, parse_header};
use super::refusal::malformed;
use crate::domain::first_where;
use crate::domain::limits::{MAX_AXES, MAX_SAMPLES};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::turned::turn;
use crate::notes::ValueNote;

/// Shape of an array and its samples in row-major order.
pub(super) struct Array {
    pub(super) shape: Vec<usize>,
    pub(super) samples: Vec<f32>,
}

pub(super) fn read_array(bytes: &[u8], report: &mut ParseReport) -> Result<Array, FormatError> {
    let (header, data_at) = header_of(bytes)?;
    let header = parse_header(header, data_at)?;
    let Header { element, fortran_order, shape } = header;
    if shape.is_empty() {
        return Err(malformed(MAGIC.len(), "the array has no axes, expected at least one"));
    }
    if shape.len() > MAX_AXES {
        return Err(FormatError::new(
            FormatErrorKind::OverLimit,
            NAME,
            format!("{} axes, expected at most {MAX_AXES}", shape.len()),
        ));
    }
    let count = shape.iter().try_fold(1_usize, |n, &length| n.checked_mul(length)).filter(|&n| n <= MAX_SAMPLES);
    let Some(count) = count else {
        return Err(FormatError::new(
            FormatErrorKind::OverLimit,
            NAME,
            format!("an array of shape {shape:?}, expected at most {MAX_SAMPLES} samples"),
        ));
    };
    if count == 0 {
        return Err(malformed(
            MAGIC.len(),
            format!("an array of shape {shape:?} holds nothing, expected one sample or more"),
        ));
    }
    // At most 2^28 samples of 8 bytes: no overflow, and nothing was allocated yet.
    let body = &bytes[data_at..];
    let expected = count * element.size;
    if body.len() != expected {
        return Err(malformed(
            data_at,
            format!("{} bytes of data, expected {expected} for the shape {shape:?}", body.len()),
        ));
    }
    let samples = decode(body, &shape, element, fortran_order).map_err(|i| {
        let value = (element.value)(&body[i * element.size..], element.big_endian);
        malformed(
            data_at + i * element.size,
            format!("sample {i} is {value:e}, expected a float32, or NaN where nothing was measured"),
        )
    })?;
    if element.name != "f4" && element.name != "f2" {
        report.note(ValueNote::RoundedToFloat32 { element: element.name });
    }
    Ok(Array { shape, samples })
}

/// Decodes the samples of an array in row-major order. The error is the number of the first infinite sample in file
/// order, from 0.
fn decode(body: &[u8], shape: &[usize], element: Element, fortran_order: bool) -> Result<Vec<f32>, usize> {
    let Element { size, big_endian, convert, .. } = element;
    let count = body.len() / size;
    let mut samples = vec![0.0; count];
    if fortran_order && shape.len() > 1 {
        to_row_major(shape, &mut samples, |at, piece| convert(&body[at * size..], big_endian, piece));
    } else {
        convert(body, big_endian, &mut samples);
    }
    if first_where(&samples, f32::is_infinite).is_none() {
        return Ok(samples);
    }
    convert(body, big_endian, &mut samples);
    Err(samples.iter().take_while(|sample| !sample.is_infinite()).count())
}

/// Reorders the samples of an array from first axis fastest to last axis fastest. `read(at, piece)` fills `piece` with
/// the samples from number `at` on, in file order.
fn to_row_major(shape: &[usize], ordered: &mut [f32], mut read: impl FnMut(usize, &mut [f32])) {
    let [first, middle @ .., last] = shape else { return };
    let (outer, inner) = (ordered.len() / first, ordered.len() / last);
    // Transposes one table of first and last axis for each position on the axes between them.
    let mut index = vec![0; middle.len()];
    loop {
        let source = index.iter().zip(middle).rev().fold(0, |at, (i, length)| at * length + i) * first;
        let target = index.iter().zip(middle).fold(0, |at, (i, length)| at * length + i) * last;
        let read = |column, row, piece: &mut [f32]| read(source + column * inner + row, piece);
        turn((&mut ordered[target..], outer), *first, *last, read);
        let Some(axis) = (0..middle.len()).rev().find(|&axis| index[axis] + 1 < middle[axis]) else { break };
        index[axis] += 1;
        index[axis + 1..].fill(0);
    }
}
