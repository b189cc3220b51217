//! Wavelengths required to compute a colour, and the error for spectra without them.

/// Range of wavelengths of the colour integrals, in nm.
pub const RANGE: (f64, f64) = (380.0, 780.0);
/// Range of wavelengths, in nm, that must have been measured.
pub const NEEDED: (f64, f64) = (400.0, 700.0);
/// Widest gap between neighbouring wavelengths, in nm: that of the coarsest weighting tables of ASTM E308.
pub const MOST_GAP: f64 = 20.0;

/// Reasons why spectra have no colour.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ColourError {
    /// The wavelengths do not cover the required range.
    #[error("wavelengths from {first} to {last} nm, expected at least {} to {} nm", NEEDED.0, NEEDED.1)]
    Uncovered {
        /// Shortest wavelength, in nm.
        first: f64,
        /// Longest wavelength, in nm.
        last: f64,
    },
    /// Two neighbouring wavelengths are too far apart.
    #[error("no wavelength between {below} and {above} nm, expected steps of at most {MOST_GAP} nm")]
    Gap {
        /// Last wavelength before the gap, in nm.
        below: f64,
        /// First wavelength after the gap, in nm.
        above: f64,
    },
    /// The last axis is not wavelength.
    #[error("no wavelength axis, expected one as the last axis")]
    NoWavelengths,
    /// Too many samples of every spectrum are masked.
    #[error("no spectrum has enough measured wavelengths")]
    Masked,
    /// No spectrum has a positive luminance, so there is no white to relate colours to.
    #[error("no spectrum has a luminance above 0")]
    Dark,
}

/// Checks that `lambdas`, strictly increasing, suffice to compute colours.
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
