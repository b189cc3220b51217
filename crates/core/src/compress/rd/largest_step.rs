//! The largest step that keeps an error, found by halves or, as a last attempt, among powers of two.

use super::super::error::CompressError;
use super::super::search::{largest, powers_of_two};
use super::super::spectral_basis::SpectralBasis;
use std::cell::Cell;

/// Bisections of the step: 2^(1/64) at the end, 1 % of the step.
const REFINEMENTS: u32 = 6;
/// Steps from here on may quantise everything to 0, where errors stand still and fall again below.
pub(super) const COARSE: f64 = 1.0;

/// The largest step that `keeps` says yes to, from `start`; `None` where none does, or where it says that errors no longer
/// fall with the step.
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

/// The last attempt before a refusal: the largest of [`powers_of_two`] that `keeps` says yes to. `closest`, which the refusal names,
/// starts anew, so that the error it advises is one that these steps find again. The Karhunen-Loève basis has too few vectors,
/// not too coarse steps: of it only `finest` is tried.
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
