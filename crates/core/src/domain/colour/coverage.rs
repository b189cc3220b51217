//! Wavelengths required to compute a colour, and the error for spectra without them.

use crate::domain::readable;

/// Range of wavelengths over which the colour integrals are taken, in nm.
pub const RANGE: (f64, f64) = (380.0, 780.0);
/// Range of wavelengths, in nm, that a spectrum must cover for its colour to be computed.
pub const NEEDED: (f64, f64) = (400.0, 700.0);
/// Widest gap between neighbouring wavelengths, in nm, at which a colour is computed. It is that of the coarsest
/// weighting tables of ASTM E308.
pub const MOST_GAP: f64 = 20.0;

/// Reasons why no colour can be computed from spectra.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ColourError {
    /// The wavelengths of the spectra do not cover the range that colours need.
    #[error(
        "wavelengths from {} to {} nm, expected at least {} to {} nm in steps of at most {MOST_GAP} nm (pictures and \
         exports to RGB estimate colours from fewer)",
        readable(*first), readable(*last), NEEDED.0, NEEDED.1
    )]
    Uncovered {
        /// Shortest wavelength of the spectra, in nm.
        first: f64,
        /// Longest wavelength of the spectra, in nm.
        last: f64,
    },
    /// Two neighbouring wavelengths are too far apart for a colour to be computed.
    #[error(
        "no wavelength between {} and {} nm, expected steps of at most {MOST_GAP} nm",
        readable(*below), readable(*above)
    )]
    Gap {
        /// Lower of the two neighbouring wavelengths of the spectra that are too far apart, in nm.
        below: f64,
        /// Upper of the two neighbouring wavelengths of the spectra that are too far apart, in nm.
        above: f64,
    },
    /// The last axis of the measurement is not wavelength.
    #[error("no wavelength axis, expected one as the last axis of the measurement")]
    NoWavelengths,
    /// Too many samples of every spectrum are masked for a colour.
    #[error("no spectrum has enough measured wavelengths for a colour")]
    Masked,
    /// No spectrum has a positive luminance, so there is no white to relate colours to.
    #[error("no spectrum has a luminance above 0, expected one to serve as white")]
    Dark,
}

/// Checks that `lambdas` (nm, strictly increasing) are dense and wide enough to compute colours.
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
