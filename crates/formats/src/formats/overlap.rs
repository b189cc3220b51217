//! Rules for the wavelengths at which two detectors of one instrument measured.

use crate::domain::named;

/// Rule for wavelengths that two detectors of one instrument measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Overlap {
    /// Values of the detector for shorter wavelengths, as far as it reaches.
    #[default]
    Shorter,
    /// Values of the detector for longer wavelengths, from where it begins.
    Longer,
    /// Mean of both detectors, each interpolated linearly between its own wavelengths.
    Mean,
}
named!(Overlap, "overlap", { Shorter = "shorter", Longer = "longer", Mean = "mean" });
