//! `NumPy` arrays (`.npy`, versions 1 to 3) with a manifest of their axes, read and written.

use super::text::snippet;
use super::{
    Acquisition, Format, FormatError, FormatErrorKind, Interpretation, NoteKind, ParseReport, Reader, Sample, manifest,
};
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
    options: &["axes"],
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
    let shape = header.shape;
    if shape.is_empty() {
        return Err(malformed(MAGIC.len(), "the array has no axes, expected at least one"));
    }
    if shape.len() > MAX_AXES {
        return Err(FormatError::new(
            FormatErrorKind::OverLimit,
            NAME,
            format!("{} axes are more than the limit of {MAX_AXES}", shape.len()),
        ));
    }
    let count = shape.iter().try_fold(1_usize, |n, &length| n.checked_mul(length)).filter(|&n| n <= MAX_SAMPLES);
    let Some(count) = count else {
        return Err(FormatError::new(
            FormatErrorKind::OverLimit,
            NAME,
            format!("an array of shape {shape:?} has more than the limit of {MAX_SAMPLES} samples"),
        ));
    };
    if count == 0 {
        return Err(malformed(MAGIC.len(), format!("an array of shape {shape:?} holds nothing")));
    }
    // At most 2^28 samples of 8 bytes: no overflow, and nothing was allocated yet.
    let body = &bytes[data_at..];
    let expected = count * header.element.size;
    if body.len() != expected {
        return Err(malformed(
            data_at,
            format!("{} bytes of data, expected {expected} for the shape {shape:?}", body.len()),
        ));
    }
    let samples = decode(body, header.element, data_at)?;
    if header.element.name != "f4" && header.element.name != "f2" {
        report.note(NoteKind::Assumed, format!("{} values were rounded to float32", header.element.name));
    }
    let samples = if header.fortran_order { to_row_major(&shape, &samples) } else { samples };
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
        _ => return Err(malformed(bytes.len(), "the file ends in its header")),
    };
    if length > MAX_HEADER {
        let message = format!("a header of {length} bytes, expected at most {MAX_HEADER}");
        return Err(FormatError::at_byte(FormatErrorKind::OverLimit, NAME, at + 2, message));
    }
    let header = bytes
        .get(start..start + length)
        .ok_or_else(|| malformed(at + 2, format!("a header of {length} bytes in a file of {} bytes", bytes.len())))?;
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
    /// From `size` bytes, little-endian in the low bytes.
    value: fn(u64) -> f64,
}

/// Half precision: sign, 5 bits of exponent, 10 bits of mantissa (IEEE 754 binary16), exact in f64.
fn half(bits: u64) -> f64 {
    let mantissa = (bits & 0x3FF) as f64;
    let exponent = (bits >> 10) & 0x1F;
    let magnitude = match exponent {
        0 => mantissa * f64::from_bits((1023 - 24) << 52),
        0x1F if bits & 0x3FF == 0 => f64::INFINITY,
        0x1F => f64::NAN,
        _ => (1024.0 + mantissa) * f64::from_bits((1023 - 25 + exponent) << 52),
    };
    if bits & 0x8000 == 0 { magnitude } else { -magnitude }
}

const ELEMENTS: &[(&str, usize, fn(u64) -> f64)] = &[
    ("f4", 4, |bits| f64::from(f32::from_bits(bits as u32))),
    ("f8", 8, f64::from_bits),
    ("f2", 2, half),
    ("i1", 1, |bits| f64::from(bits as i8)),
    ("i2", 2, |bits| f64::from(bits as i16)),
    ("i4", 4, |bits| f64::from(bits as i32)),
    ("i8", 8, |bits| bits as i64 as f64),
    ("u1", 1, |bits| bits as f64),
    ("u2", 2, |bits| bits as f64),
    ("u4", 4, |bits| bits as f64),
    ("u8", 8, |bits| bits as f64),
];

fn element(descr: &str) -> Option<Element> {
    let (order, kind) = descr.split_at_checked(1)?;
    let &(name, size, value) = ELEMENTS.iter().find(|(name, ..)| *name == kind)?;
    let big_endian = match order {
        "<" => false,
        ">" => true,
        "|" if size == 1 => false,
        _ => return None,
    };
    Some(Element { name, size, big_endian, value })
}

fn decode(body: &[u8], element: Element, data_at: usize) -> Result<Vec<f32>, FormatError> {
    let mut samples = Vec::with_capacity(body.len() / element.size);
    for (i, chunk) in body.chunks_exact(element.size).enumerate() {
        let mut little = [0; 8];
        little[..element.size].copy_from_slice(chunk);
        if element.big_endian {
            little[..element.size].reverse();
        }
        let value = (element.value)(u64::from_le_bytes(little));
        let sample = value as f32;
        if sample.is_infinite() {
            return Err(malformed(
                data_at + i * element.size,
                format!("sample {i} is {value:e}, expected a float32, or NaN where nothing was measured"),
            ));
        }
        samples.push(if sample.is_nan() { f32::NAN } else { sample });
    }
    Ok(samples)
}

/// From first axis fastest to last axis fastest.
fn to_row_major(shape: &[usize], samples: &[f32]) -> Vec<f32> {
    let mut strides = Vec::with_capacity(shape.len());
    let mut stride = 1;
    for &length in shape {
        strides.push(stride);
        stride *= length;
    }
    let mut index = vec![0; shape.len()];
    let mut at = 0;
    let mut ordered = Vec::with_capacity(samples.len());
    for _ in 0..samples.len() {
        ordered.push(samples[at]);
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            at += strides[axis];
            if index[axis] < shape[axis] {
                break;
            }
            at -= strides[axis] * shape[axis];
            index[axis] = 0;
        }
    }
    ordered
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
        return Err(literal.malformed("text after the dictionary"));
    }
    let (Some((descr, descr_at)), Some(fortran_order), Some(shape)) = (descr, fortran_order, shape) else {
        return Err(malformed(start, "the header lacks one of descr, fortran_order and shape"));
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
        let closed = quote.and_then(|quote| Some(&rest[1..1 + rest[1..].find(quote)?]));
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
