//! Random values for property tests, drawn from the bytes supplied to a test.

use arbtest::arbitrary::{Arbitrary, Result, Unstructured};
use std::ops::{Range, RangeInclusive};

/// Draws a list of random values for a property test; `one` draws each value.
pub(crate) fn list<'a, T>(
    u: &mut Unstructured<'a>,
    lengths: RangeInclusive<usize>,
    mut one: impl FnMut(&mut Unstructured<'a>) -> Result<T>,
) -> Result<Vec<T>> {
    let length = u.int_in_range(lengths)?;
    (0..length).map(|_| one(u)).collect()
}

/// Draws a list of random values of any `Arbitrary` type, such as bytes and numbers.
pub(crate) fn any_list<'a, T: Arbitrary<'a>>(
    u: &mut Unstructured<'a>,
    lengths: RangeInclusive<usize>,
) -> Result<Vec<T>> {
    list(u, lengths, Unstructured::arbitrary)
}

/// Generates a random text of at most `most` characters, without control characters.
pub(crate) fn text(u: &mut Unstructured<'_>, most: usize) -> Result<String> {
    let characters: Vec<char> = any_list(u, 0..=most)?;
    Ok(characters.into_iter().filter(|c| !c.is_control()).collect())
}

/// Draws a random number, uniform in a range.
pub(crate) fn number(u: &mut Unstructured<'_>, range: Range<f64>) -> Result<f64> {
    let t = f64::from(u.arbitrary::<u32>()?) / (f64::from(u32::MAX) + 1.0);
    Ok(range.start + t * (range.end - range.start))
}
