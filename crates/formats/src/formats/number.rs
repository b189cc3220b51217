//! Exact parser of decimal numbers at a position in a byte string, without a separate search for their end.

/// Powers of ten, from 10⁰ to 10²², that are exact in f64.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];
/// Number of decimal digits that fit a u64 whatever the digits are.
const DIGITS: usize = 19;
/// Power of two up to which every whole number is exact in f64.
const EXACT: u64 = 1 << 53;

/// Parses the decimal number that starts at byte `start` and returns it with the offset of its end; `None` if no finite
/// decimal number starts there.
///
/// The value is the f64 nearest to the text. A mantissa and a power of ten that are exact in f64 give one correctly
/// rounded product or quotient (W. D. Clinger, "How to Read Floating Point Numbers Accurately", PLDI 1990). Everything
/// else goes to the parser of the standard library.
#[inline]
pub(super) fn decimal(bytes: &[u8], start: usize) -> Option<(f64, usize)> {
    let mut at = start;
    let negative = bytes.get(at) == Some(&b'-');
    if negative || bytes.get(at) == Some(&b'+') {
        at += 1;
    }
    let first = at;
    let mut mantissa = 0_u64;
    at = digits(bytes, at, &mut mantissa);
    let mut count = at - first;
    let mut exponent = 0_i32;
    if bytes.get(at) == Some(&b'.') {
        let point = at + 1;
        at = digits(bytes, point, &mut mantissa);
        count += at - point;
        exponent = i32::try_from(at - point).ok()?.checked_neg()?;
    }
    if count == 0 {
        return None;
    }
    if let Some(b'e' | b'E') = bytes.get(at) {
        let (written, end) = exponent_of(bytes, at + 1)?;
        at = end;
        exponent = exponent.saturating_add(written);
    }
    let size = exponent.unsigned_abs() as usize;
    if count <= DIGITS && mantissa <= EXACT && size < POWERS.len() {
        let value = if exponent < 0 { mantissa as f64 / POWERS[size] } else { mantissa as f64 * POWERS[size] };
        return Some((if negative { -value } else { value }, at));
    }
    let value: f64 = std::str::from_utf8(&bytes[start..at]).ok()?.parse().ok()?;
    value.is_finite().then_some((value, at))
}

/// Appends the decimal digits from byte `at` on to `mantissa` (modulo 2^64) and returns the offset of their end.
/// Processes eight bytes at a time, because the number of digits is unpredictable and a branch per digit would be slow.
#[inline]
fn digits(bytes: &[u8], mut at: usize, mantissa: &mut u64) -> usize {
    while let Some(eight) = bytes.get(at..).and_then(|rest| rest.first_chunk::<8>()) {
        let values = u64::from_le_bytes(*eight) ^ 0x3030_3030_3030_3030;
        // The high bit of each byte above 9; a carry only affects bytes after the first of them.
        let others = (values.wrapping_add(0x7676_7676_7676_7676) | values) & 0x8080_8080_8080_8080;
        let count = others.trailing_zeros() / 8;
        if count == 0 {
            return at;
        }
        *mantissa = mantissa.wrapping_mul(TENS[count as usize]).wrapping_add(eight_digits(values << (64 - 8 * count)));
        at += count as usize;
        if count < 8 {
            return at;
        }
    }
    while let Some(digit) = bytes.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|&digit| digit < 10) {
        *mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
        at += 1;
    }
    at
}

/// Powers of ten, from 10⁰ to 10⁸, by which a number is multiplied before up to eight digits are appended.
const TENS: [u64; 9] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

/// Returns the integer that is written with eight decimal digits. The first digit, as a value from 0 to 9, is in the
/// lowest byte of `digits`. Neighbours are combined to numbers of two, then four, then eight digits.
#[inline]
fn eight_digits(digits: u64) -> u64 {
    let pairs = digits.wrapping_mul(2561) >> 8;
    let fours = (pairs & 0x00FF_00FF_00FF_00FF).wrapping_mul(6_553_601) >> 16;
    (fours & 0x0000_FFFF_0000_FFFF).wrapping_mul(42_949_672_960_001) >> 32
}

/// Parses the decimal exponent at byte `at` and returns it with the offset of its end. An exponent out of range
/// saturates.
fn exponent_of(bytes: &[u8], mut at: usize) -> Option<(i32, usize)> {
    let negative = bytes.get(at) == Some(&b'-');
    if negative || bytes.get(at) == Some(&b'+') {
        at += 1;
    }
    let first = at;
    let mut value = 0_i32;
    while let Some(digit) = bytes.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|&digit| digit < 10) {
        value = value.saturating_mul(10).saturating_add(i32::from(digit));
        at += 1;
    }
    (at > first).then_some((if negative { -value } else { value }, at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn whole(text: &str) -> Option<f64> {
        decimal(text.as_bytes(), 0).filter(|&(_, end)| end == text.len()).map(|(value, _)| value)
    }

    #[test]
    fn numbers_are_decimal_finite_and_whole_cells() {
        for text in
            ["0", "-0", "1", ".5", "5.", "+1e3", "0.1", "1e22", "1e23", "9007199254740993", "123456789012345678901"]
        {
            assert_eq!(whole(text).map(f64::to_bits), text.parse().ok().map(f64::to_bits), "{text}");
        }
        for text in ["", "-", ".", "e5", "1e", "1e+", "nan", "inf", "1e999", "0x10", "1O", "1 ", "1,5", "--1"] {
            assert_eq!(whole(text), None, "{text}");
        }
        assert_eq!(decimal(b"30,0.5\n", 3), Some((0.5, 6)));
        assert_eq!(whole("1e99999999999999999999"), None);
        assert_eq!(whole("1e-99999999999999999999"), Some(0.0));
        assert_eq!(whole(&format!("0.{}1", "0".repeat(400))), Some(0.0));
    }

    proptest! {
        #[test]
        fn they_are_those_of_the_standard_library(value in any::<f64>(), digits in 0_usize..25, small in -1e6_f64..1e6) {
            for text in [format!("{value:e}"), format!("{small:.digits$}"), format!("{small}"), format!("{small:.digits$e}")] {
                if let Ok(expected) = text.parse::<f64>() && expected.is_finite() {
                    prop_assert_eq!(whole(&text).map(f64::to_bits), Some(expected.to_bits()), "{}", text);
                    // Whatever follows: eight bytes are looked at together.
                    for next in [",", "\n12345678", " .9e9", "\u{b7}1234567", "/:/:/:/:", "\u{ff}\u{ff}\u{ff}\u{ff}"] {
                        let found = decimal(format!("7{text}{next}").as_bytes(), 1);
                        prop_assert_eq!(found.map(|(value, end)| (value.to_bits(), end)), Some((expected.to_bits(), 1 + text.len())));
                    }
                }
            }
        }
    }
}
