//! Searches for the largest step that keeps an error, by bisection or, as a last attempt, among powers of two.

use super::super::error::CompressError;
use super::super::search::{largest, powers_of_two};
use super::super::spectral_basis::SpectralBasis;
use std::cell::Cell;

/// Number of bisections of the quantiser step; the last interval is 2^(1/64), 1 % of the step.
const REFINEMENTS: u32 = 6;
/// Quantiser step (in natural logarithms) at and above which everything may be quantised to 0. Errors then stay equal,
/// and fall again at finer steps.
pub(super) const COARSE: f64 = 1.0;

/// Finds the largest quantiser step that `keeps` accepts, starting at `start`. `None` if none is accepted, or if
/// `keeps` reports that errors no longer fall with the step.
pub(super) fn largest_falling(
    start: f64,
    mut keeps: impl FnMut(f64) -> Result<Result<bool, ()>, CompressError>,
) -> Result<Option<f64>, CompressError> {
    let found = largest(start, REFINEMENTS, |step| match keeps(step) {
        Ok(kept) => kept.map_err(|()| None),
        Err(error) => Err(Some(error)),
    });
    found.or_else(|error| error.map_or(Ok(None), Err))
}

/// Finds the largest quantiser step among [`powers_of_two`] that `keeps` accepts: the last attempt before a wanted
/// error is refused.
///
/// The refusal suggests asking for `closest`, the smallest error found. This is therefore reset first, so that it comes
/// from steps that a search for the suggested error tries again. In basis klt it stays, and only `finest` is tried:
/// there the number of vectors limits the error, not the step.
pub(super) fn largest_power(
    (start, finest): (f64, f64),
    basis: SpectralBasis,
    closest: &Cell<f64>,
    mut keeps: impl FnMut(f64) -> Result<bool, CompressError>,
) -> Result<Option<f64>, CompressError> {
    let start = if basis == SpectralBasis::Klt {
        finest
    } else {
        closest.set(f64::INFINITY);
        start
    };
    for step in powers_of_two(start, finest) {
        if keeps(step)? {
            return Ok(Some(step));
        }
    }
    Ok(None)
}
