//! Number types of arrays: names, sizes, and conversion of bytes to samples.

/// Number type of an array's elements, with its conversion to samples.
#[derive(Clone, Copy)]
pub(super) struct Element {
    pub(super) name: &'static str,
    pub(super) size: usize,
    pub(super) big_endian: bool,
    pub(super) convert: Convert,
    pub(super) value: Value,
}

/// Converts a half-precision number (IEEE 754 binary16: sign, 5 bits of exponent, 10 bits of mantissa), which is exact
/// in f64.
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

/// Row of the table of number types for a type of whole numbers.
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

/// Function that converts the bytes of an array's numbers to float32 samples; the flag is true if they are big-endian.
type Convert = fn(&[u8], bool, &mut [f32]);
/// Function that converts the bytes of one number of an array to f64; the flag is true if they are big-endian.
type Value = fn(&[u8], bool) -> f64;

/// Converts the numbers of a NumPy array, `N` bytes each, to float32 samples. Every NaN becomes the standard NaN that
/// masks a sample.
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

/// Decodes one number of an array, an integer or a floating-point number, from the first `N` bytes of `bytes` and
/// converts it to f64.
fn number<const N: usize>(bytes: &[u8], big_endian: bool, value: impl Fn([u8; N]) -> f64) -> f64 {
    let mut word = bytes.first_chunk::<N>().copied().unwrap_or([0; N]);
    if big_endian {
        word.reverse();
    }
    value(word)
}

/// Number types of arrays: names, sizes in bytes and conversions.
#[allow(clippy::cast_lossless, reason = "one row for each width, of which the widest are rounded")]
pub(super) const ELEMENTS: &[(&str, usize, Convert, Value)] = &[
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

pub(super) fn element(descr: &str) -> Option<Element> {
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
