//! `NumPy` arrays (`.npy`, versions 1 to 3) with a manifest of their axes, read and written.

use super::text::snippet;
use super::turned::turn;
use super::{
    Acquisition, FACTOR, Format, FormatError, FormatErrorKind, Interpretation, NoteKind, ParseReport, Reader, Sample,
    manifest,
};
use crate::domain::first_where;
use crate::domain::limits::{MAX_AXES, MAX_SAMPLES};

pub(super) const NAME: &str = "npy";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "NumPy array (.npy) with a manifest of its axes",
        extensions: &["npy"],
        reads: true,
        writes: true,
    },
    options: &["axes", FACTOR],
    probe: |sample: &Sample<'_>| if sample.bytes.starts_with(MAGIC) { 100 } else { 0 },
    read,
};

const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header taken; `NumPy` itself writes about 120 bytes.
const MAX_HEADER: usize = 1 << 16;

/// Writes little-endian float32 samples, row-major, as version 1.0; NaN = masked.
///
/// # Panics
/// If the shape does not hold as many samples as there are.
pub fn write_npy(shape: &[usize], samples: &[f32]) -> Vec<u8> {
    assert_eq!(shape.iter().product::<usize>(), samples.len(), "an array holds the product of its shape");
    let lengths = match shape {
        [only] => format!("({only},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    };
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {lengths}, }}");
    // The data start at a multiple of 64 bytes: magic, two version bytes, a u16 length, the header, a line feed.
    let unpadded = MAGIC.len() + 4 + header.len() + 1;
    header.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
    header.push('\n');
    let mut bytes = Vec::with_capacity(MAGIC.len() + 4 + header.len() + 4 * samples.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&[1, 0]);
    bytes.extend_from_slice(&(header.len() as u16).to_le_bytes());
    bytes.extend_from_slice(header.as_bytes());
    for sample in samples {
        bytes.extend_from_slice(&sample.to_le_bytes());
    }
    bytes
}

/// The samples of an array in row-major order.
struct Array {
    shape: Vec<usize>,
    samples: Vec<f32>,
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let mut report = ParseReport::default();
    let Array { shape, samples } = read_array(bytes, &mut report)?;
    let Some(axes) = &how.axes else {
        return Err(FormatError::new(
            FormatErrorKind::NeedsOption,
            NAME,
            format!(
                "an array of shape {shape:?} says nothing about its axes, expected a manifest (`axes`, or \
                 NAME.axes.json beside it) such as {{\"quantity\": \"brdf\", \"axes\": [\"hemi:1\", \"hemi:4\", \
                 \"lambda:380:5:75\"]}}"
            ),
        ));
    };
    manifest::interpret(axes, &shape, samples, how, report)
}

fn read_array(bytes: &[u8], report: &mut ParseReport) -> Result<Array, FormatError> {
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
        report.note(NoteKind::Assumed, format!("{} values were rounded to float32", element.name));
    }
    Ok(Array { shape, samples })
}

fn malformed(offset: usize, message: impl Into<String>) -> FormatError {
    FormatError::at_byte(FormatErrorKind::Malformed, NAME, offset, message)
}

/// The header's text and where the data start.
fn header_of(bytes: &[u8]) -> Result<(&str, usize), FormatError> {
    let at = MAGIC.len();
    let (length, start) = match bytes.get(at..) {
        Some([1, _, a, b, ..]) => (usize::from(u16::from_le_bytes([*a, *b])), at + 4),
        Some([2 | 3, _, a, b, c, d, ..]) => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, at + 6),
        Some([version, _, _, _, _, _, ..]) => {
            let message = format!("version {version}, expected 1, 2 or 3");
            return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, at, message));
        }
        _ => {
            return Err(malformed(
                bytes.len(),
                "the file ends in its header, expected a version, a length and a dictionary",
            ));
        }
    };
    if length > MAX_HEADER {
        let message = format!("a header of {length} bytes, expected at most {MAX_HEADER}");
        return Err(FormatError::at_byte(FormatErrorKind::OverLimit, NAME, at + 2, message));
    }
    let header = bytes.get(start..start + length).ok_or_else(|| {
        malformed(at + 2, format!("a header of {length} bytes in a file of {} bytes, expected it within", bytes.len()))
    })?;
    let header =
        std::str::from_utf8(header).map_err(|_| malformed(start, "the header is not text, expected a dictionary"))?;
    Ok((header, start + length))
}

struct Header {
    element: Element,
    fortran_order: bool,
    shape: Vec<usize>,
}

/// A number type of an array.
#[derive(Clone, Copy)]
struct Element {
    name: &'static str,
    size: usize,
    big_endian: bool,
    convert: Convert,
    value: Value,
}

/// Half precision: sign, 5 bits of exponent, 10 bits of mantissa (IEEE 754 binary16), exact in f64.
fn half(bits: u64) -> f64 {
    let fraction = bits & 0x3FF;
    let mantissa = fraction as f64;
    let exponent = (bits >> 10) & 0x1F;
    let magnitude = match exponent {
        0 => mantissa * f64::from_bits((1023 - 24) << 52),
        0x1F if fraction == 0 => f64::INFINITY,
        0x1F => f64::NAN,
        _ => (1024.0 + mantissa) * f64::from_bits((1023 - 25 + exponent) << 52),
    };
    if bits & 0x8000 == 0 { magnitude } else { -magnitude }
}

/// A row of the table for a type of whole numbers.
macro_rules! whole {
    ($name:literal, $kind:ty) => {
        (
            $name,
            size_of::<$kind>(),
            |body, big, samples| convert(body, big, samples, |word| <$kind>::from_le_bytes(word) as f64 as f32),
            |body, big| number(body, big, |word| <$kind>::from_le_bytes(word) as f64),
        )
    };
}

/// Samples from bytes in either order, and the number that the bytes of one of them are.
type Convert = fn(&[u8], bool, &mut [f32]);
type Value = fn(&[u8], bool) -> f64;

/// Each number of `N` bytes as a sample; all of NaN is one.
fn convert<const N: usize>(body: &[u8], big_endian: bool, samples: &mut [f32], sample: impl Fn([u8; N]) -> f32) {
    let masked = |sample: f32| if sample.is_nan() { f32::NAN } else { sample };
    let (words, _) = body.as_chunks::<N>();
    if big_endian {
        for (to, &(mut word)) in samples.iter_mut().zip(words) {
            word.reverse();
            *to = masked(sample(word));
        }
    } else {
        samples.iter_mut().zip(words).for_each(|(to, &word)| *to = masked(sample(word)));
    }
}

/// The number that starts `bytes`.
fn number<const N: usize>(bytes: &[u8], big_endian: bool, value: impl Fn([u8; N]) -> f64) -> f64 {
    let mut word = bytes.first_chunk::<N>().copied().unwrap_or([0; N]);
    if big_endian {
        word.reverse();
    }
    value(word)
}

/// Name, bytes, and how they are read.
#[allow(clippy::cast_lossless, reason = "one row for each width, of which the widest are rounded")]
const ELEMENTS: &[(&str, usize, Convert, Value)] = &[
    (
        "f4",
        4,
        |body, big, samples| convert(body, big, samples, f32::from_le_bytes),
        |body, big| number(body, big, |word| f64::from(f32::from_le_bytes(word))),
    ),
    (
        "f8",
        8,
        |body, big, samples| convert(body, big, samples, |word| f64::from_le_bytes(word) as f32),
        |body, big| number(body, big, f64::from_le_bytes),
    ),
    (
        "f2",
        2,
        |body, big, samples| convert(body, big, samples, |word| half(u16::from_le_bytes(word).into()) as f32),
        |body, big| number(body, big, |word| half(u16::from_le_bytes(word).into())),
    ),
    whole!("i1", i8),
    whole!("i2", i16),
    whole!("i4", i32),
    whole!("i8", i64),
    whole!("u1", u8),
    whole!("u2", u16),
    whole!("u4", u32),
    whole!("u8", u64),
];

fn element(descr: &str) -> Option<Element> {
    let (order, kind) = descr.split_at_checked(1)?;
    let &(name, size, convert, value) = ELEMENTS.iter().find(|(name, ..)| *name == kind)?;
    let big_endian = match order {
        "<" => false,
        ">" => true,
        "|" if size == 1 => false,
        _ => return None,
    };
    Some(Element { name, size, big_endian, convert, value })
}

/// The samples in row-major order; or the number of the first in the file that is infinite.
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

/// From first axis fastest to last axis fastest; `read(at, piece)` writes samples as they come in the file, from number
/// `at` on.
fn to_row_major(shape: &[usize], ordered: &mut [f32], mut read: impl FnMut(usize, &mut [f32])) {
    let [first, middle @ .., last] = shape else { return };
    let (outer, inner) = (ordered.len() / first, ordered.len() / last);
    // The tables of the first and the last axis, one for each place on the axes between them.
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

/// Parses the Python dictionary literal of a header: string keys; strings, booleans and tuples of integers as values.
fn parse_header(header: &str, data_at: usize) -> Result<Header, FormatError> {
    let start = data_at - header.len();
    let mut literal = Literal { text: header, at: 0, start };
    let (mut descr, mut fortran_order, mut shape) = (None, None, None);
    literal.expect('{')?;
    while !literal.accept('}') {
        let key = literal.string("a key in quotes")?;
        literal.expect(':')?;
        let repeated = match key {
            "descr" => {
                if literal.peek() == Some('[') {
                    let message = "records with fields, expected an array of plain numbers";
                    return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, literal.byte(), message));
                }
                let at = literal.byte();
                descr.replace((literal.string("a number type in quotes")?, at)).is_some()
            }
            "fortran_order" => fortran_order.replace(literal.boolean()?).is_some(),
            "shape" => shape.replace(literal.tuple()?).is_some(),
            other => {
                let message = format!("key {}, expected descr, fortran_order and shape", snippet(other));
                return Err(literal.malformed(message));
            }
        };
        if repeated {
            return Err(literal.malformed(format!("key {} twice", snippet(key))));
        }
        if !literal.accept(',') && literal.peek() != Some('}') {
            return Err(literal.malformed("expected `,` or `}`"));
        }
    }
    if literal.peek().is_some() {
        return Err(literal.malformed("text after the dictionary, expected the end of the header"));
    }
    let (Some((descr, descr_at)), Some(fortran_order), Some(shape)) = (descr, fortran_order, shape) else {
        return Err(malformed(start, "the header lacks one of descr, fortran_order and shape, expected all of them"));
    };
    let Some(element) = element(descr) else {
        let known: Vec<&str> = ELEMENTS.iter().map(|(name, ..)| *name).collect();
        let message = format!("number type {}, expected < or > and one of {}", snippet(descr), known.join(", "));
        return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, descr_at, message));
    };
    Ok(Header { element, fortran_order, shape })
}

/// A cursor over a literal; blanks are skipped before each item.
struct Literal<'a> {
    text: &'a str,
    at: usize,
    start: usize,
}

impl<'a> Literal<'a> {
    fn byte(&self) -> usize {
        self.start + self.at
    }

    fn malformed(&self, message: impl Into<String>) -> FormatError {
        malformed(self.byte(), message)
    }

    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text[self.at..].chars().next()
    }

    fn accept(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        if found {
            self.at += wanted.len_utf8();
        }
        found
    }

    fn expect(&mut self, wanted: char) -> Result<(), FormatError> {
        if self.accept(wanted) {
            return Ok(());
        }
        let message = format!("found {}, expected `{wanted}`", snippet(&self.text[self.at..]));
        Err(self.malformed(message))
    }

    fn string(&mut self, expected: &str) -> Result<&'a str, FormatError> {
        let quote = self.peek().filter(|c| matches!(c, '\'' | '"'));
        let rest = &self.text[self.at..];
        let closed = quote.and_then(|quote| rest[1..].split_once(quote)).map(|(string, _)| string);
        let Some(string) = closed else {
            return Err(self.malformed(format!("found {}, expected {expected}", snippet(rest))));
        };
        self.at += string.len() + 2;
        Ok(string)
    }

    fn boolean(&mut self) -> Result<bool, FormatError> {
        self.peek();
        for (name, value) in [("True", true), ("False", false)] {
            if self.text[self.at..].starts_with(name) {
                self.at += name.len();
                return Ok(value);
            }
        }
        Err(self.malformed(format!("found {}, expected True or False", snippet(&self.text[self.at..]))))
    }

    fn tuple(&mut self) -> Result<Vec<usize>, FormatError> {
        self.expect('(')?;
        let mut lengths = Vec::new();
        while !self.accept(')') {
            self.peek();
            let rest = &self.text[self.at..];
            let digits = &rest[..rest.bytes().take_while(u8::is_ascii_digit).count()];
            let Ok(length) = digits.parse() else {
                return Err(self.malformed(format!("found {}, expected the length of an axis", snippet(rest))));
            };
            self.at += digits.len();
            // Python 2 wrote long integers with an L.
            if self.text[self.at..].starts_with('L') {
                self.at += 1;
            }
            lengths.push(length);
            if !self.accept(',') && self.peek() != Some(')') {
                return Err(self.malformed("expected `,` or `)`"));
            }
        }
        Ok(lengths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{Position, Samples};
    use serde_json::json;

    fn file(version: u8, header: &str, body: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend_from_slice(&[version, 0]);
        if version == 1 {
            bytes.extend_from_slice(&(header.len() as u16).to_le_bytes());
        } else {
            bytes.extend_from_slice(&(header.len() as u32).to_le_bytes());
        }
        bytes.extend_from_slice(header.as_bytes());
        bytes.extend_from_slice(body);
        bytes
    }

    fn header(descr: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n")
    }

    fn samples(bytes: &[u8]) -> Result<(Vec<usize>, Vec<f32>), FormatError> {
        read_array(bytes, &mut ParseReport::default()).map(|array| (array.shape, array.samples))
    }

    #[test]
    fn what_is_written_reads_back() {
        for shape in [vec![6], vec![2, 3], vec![1, 2, 1, 3]] {
            let values = [1.5, -2.0, f32::NAN, f32::MAX, f32::MIN_POSITIVE / 8.0, 0.0];
            let bytes = write_npy(&shape, &values);
            assert_eq!((bytes.len() - 24) % 64, 0);
            let (found_shape, found) = samples(&bytes).unwrap();
            assert_eq!(found_shape, shape);
            assert!(found.iter().zip(&values).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }

    #[test]
    fn every_number_type_reads_as_its_values() {
        let halves: [u16; 3] = [0x3C00, 0xC000, 0x0001];
        let all: Vec<(&str, Vec<u8>, Vec<f32>)> = vec![
            ("<f4", [1.0_f32, -2.5].iter().flat_map(|v| v.to_le_bytes()).collect(), vec![1.0, -2.5]),
            (">f4", [1.0_f32, -2.5].iter().flat_map(|v| v.to_be_bytes()).collect(), vec![1.0, -2.5]),
            ("<f8", [1.0_f64, -0.1].iter().flat_map(|v| v.to_le_bytes()).collect(), vec![1.0, -0.1]),
            (">f8", [1.0_f64, -0.1].iter().flat_map(|v| v.to_be_bytes()).collect(), vec![1.0, -0.1]),
            ("<f2", halves.iter().flat_map(|v| v.to_le_bytes()).collect(), vec![1.0, -2.0, 5.960_464_5e-8]),
            ("<i2", [-3_i16, 400].iter().flat_map(|v| v.to_le_bytes()).collect(), vec![-3.0, 400.0]),
            (">i4", [-3_i32, 70_000].iter().flat_map(|v| v.to_be_bytes()).collect(), vec![-3.0, 70_000.0]),
            ("<u4", u32::MAX.to_le_bytes().to_vec(), vec![4_294_967_296.0]),
            ("|u1", vec![0, 255], vec![0.0, 255.0]),
            ("|i1", vec![0, 255], vec![0.0, -1.0]),
            ("<i8", (-5_i64).to_le_bytes().to_vec(), vec![-5.0]),
        ];
        for (descr, body, values) in all {
            let bytes = file(1, &header(descr, "False", &format!("({},)", values.len())), &body);
            assert_eq!(samples(&bytes).unwrap().1, values, "{descr}");
        }
    }

    #[test]
    fn fortran_order_is_turned_to_row_major() {
        let body: Vec<u8> = (0..24).map(|i| i as u8).collect();
        let (_, found) = samples(&file(2, &header("|u1", "True", "(2, 3L, 4)"), &body)).unwrap();
        let expected: Vec<f32> =
            (0..24).map(|i| (i / 12, i / 4 % 3, i % 4)).map(|(a, b, c)| (a + 2 * (b + 3 * c)) as f32).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn hostile_headers_are_refused_before_anything_is_allocated() {
        use FormatErrorKind::{Malformed, OverLimit, Unsupported};
        let v1 = |descr: &str, shape: &str| file(1, &header(descr, "False", shape), &[0; 1000]);
        let mut endless = file(2, &header("<f4", "False", "(1,)"), &[0; 4]);
        endless[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        let raw = |text: &str| file(1, text, &[0; 4]);
        for (bytes, kind) in [
            (v1("<f4", "(100000000000,)"), OverLimit),
            (v1("<f4", "(18446744073709551615, 18446744073709551615)"), OverLimit),
            (v1("<f4", "(99999999999999999999999,)"), Malformed),
            (v1("<f4", "(1, 1, 1, 1, 1, 1, 1, 1, 1)"), OverLimit),
            (v1("<f4", "(1073741824,)"), OverLimit),
            (v1("<f4", "(251,)"), Malformed),
            (v1("<f4", "(249,)"), Malformed),
            (v1("<f4", "()"), Malformed),
            (v1("<f4", "(0,)"), Malformed),
            (v1("<f4", "(-1,)"), Malformed),
            (v1("|O", "(1,)"), Unsupported),
            (v1("<c8", "(1,)"), Unsupported),
            (v1("<U8", "(1,)"), Unsupported),
            (v1("\u{e9}", "(1,)"), Unsupported),
            (endless, OverLimit),
            (file(4, &header("<f4", "False", "(1,)"), &[0; 4]), Unsupported),
            (raw("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,)}"), Unsupported),
            (raw("{'descr': '<f4', 'fortran_order': False}"), Malformed),
            (raw("{'descr': '<f4', 'descr': '<f4', 'fortran_order': False, 'shape': (1,)}"), Malformed),
            (raw("{'descr': '<f4', 'fortran_order': Maybe, 'shape': (1,)}"), Malformed),
            (raw("{'descr': '<f4', 'fortran_order': False, 'shape': (1,)} x"), Malformed),
            (raw("{'other': 1}"), Malformed),
            (raw("'"), Malformed),
            (MAGIC.to_vec(), Malformed),
        ] {
            let error = samples(&bytes).unwrap_err();
            assert_eq!(error.kind, kind, "{error}");
        }
    }

    #[test]
    fn infinities_have_a_position_and_nan_is_masked() {
        let bytes = write_npy(&[3], &[f32::NAN, 1.0, 2.0]);
        assert!(samples(&bytes).unwrap().1[0].is_nan());
        let body: Vec<u8> = [1.0, f64::NEG_INFINITY].iter().flat_map(|v| v.to_le_bytes()).collect();
        let bytes = file(1, &header("<f8", "False", "(2,)"), &body);
        let error = samples(&bytes).unwrap_err();
        assert_eq!(error.position, Some(Position::Byte(bytes.len() - 8)));
        assert!(error.message.contains("sample 1 is -inf"), "{error}");
        // Finite as float64, not as float32.
        let bytes = file(1, &header("<f8", "False", "(1,)"), &1e39_f64.to_le_bytes());
        assert!(samples(&bytes).unwrap_err().message.contains("1e39"));
    }

    #[test]
    fn an_array_without_a_manifest_says_what_it_needs() {
        let bytes = write_npy(&[4, 3], &[0.0; 12]);
        let error = read(&bytes, &Interpretation::default()).unwrap_err();
        assert_eq!(error.kind, FormatErrorKind::NeedsOption);
        assert!(error.message.contains("[4, 3]") && error.message.contains("hemi:4"), "{error}");
        let axes = Some(json!({"quantity": "edf", "axes": ["hemi:0", "rgb"]}));
        let read = read(&bytes, &Interpretation { axes, ..Interpretation::default() }).unwrap();
        assert!(matches!(read.samples, Samples::OnAxes { .. }));
    }
}
