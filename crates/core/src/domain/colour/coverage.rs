//! The wavelengths that a colour is computed from, and the refusal of spectra that have no colour.

/// The wavelengths that are summed over, nm.
pub const RANGE: (f64, f64) = (380.0, 780.0);
/// The wavelengths that must have been measured, nm.
pub const NEEDED: (f64, f64) = (400.0, 700.0);
/// The widest gap between neighbouring wavelengths, nm: the coarsest weighting tables of ASTM E308.
pub const MOST_GAP: f64 = 20.0;

/// Why spectra have no colours.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ColourError {
    /// The ends are too near.
    #[error("wavelengths from {first} to {last} nm, expected at least {} to {} nm", NEEDED.0, NEEDED.1)]
    Uncovered {
        /// The shortest, nm.
        first: f64,
        /// The longest, nm.
        last: f64,
    },
    /// Neighbours are too far from each other.
    #[error("no wavelength between {below} and {above} nm, expected steps of at most {MOST_GAP} nm")]
    Gap {
        /// The last wavelength before the gap, nm.
        below: f64,
        /// The first one after it, nm.
        above: f64,
    },
    /// The last axis is not wavelength.
    #[error("no wavelength axis, expected one as the last axis")]
    NoWavelengths,
    /// Nothing is measured.
    #[error("no spectrum has enough measured wavelengths")]
    Masked,
    /// Nothing to be relative to.
    #[error("no spectrum has a luminance above 0")]
    Dark,
}

/// Whether `lambdas`, strictly increasing, are enough for colours.
pub(super) fn check(lambdas: &[f64]) -> Result<(), ColourError> {
    let (first, last) = match lambdas {
        [] => (f64::NAN, f64::NAN),
        [first, .., last] => (*first, *last),
        [only] => (*only, *only),
    };
    if !(first <= NEEDED.0 && last >= NEEDED.1) {
        return Err(ColourError::Uncovered { first, last });
    }
    let wide = |[a, b]: &&[f64; 2]| b - a > MOST_GAP * (1.0 + 1e-9) && *b > RANGE.0 && *a < RANGE.1;
    match lambdas.array_windows().find(wide) {
        Some(&[below, above]) => Err(ColourError::Gap { below, above }),
        None => Ok(()),
    }
}
