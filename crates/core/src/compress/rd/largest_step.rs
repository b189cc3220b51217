//! Searches for the largest step that keeps an error, by bisection or, as a last attempt, among powers of two.

use super::super::error::CompressError;
use super::super::search::{largest, powers_of_two};
use super::super::spectral_basis::SpectralBasis;
use std::cell::Cell;

/// Number of bisections of the step; the last interval is 2^(1/64), 1 % of the step.
const REFINEMENTS: u32 = 6;
/// Steps from here on may quantise everything to 0. Errors then stay equal, and fall again at finer steps.
pub(super) const COARSE: f64 = 1.0;

/// Finds the largest step that `keeps` accepts, starting at `start`. `None` if none is accepted, or if `keeps` reports
/// that errors no longer fall with the step.
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

/// Finds the largest of [`powers_of_two`] that `keeps` accepts, as the last attempt before a refusal. `closest`, the
/// error that the refusal suggests, is reset, so that these steps find it again. The Karhunen-Loève basis has too few
/// vectors, not too coarse steps, so only `finest` is tried for it.
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
