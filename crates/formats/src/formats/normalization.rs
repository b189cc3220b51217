//! Normalisations of phase functions: integral of the values of a table over the sphere.

use crate::domain::named;

/// Integral of the values of a phase table over the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Normalization {
    /// Integral 1.
    One,
    /// Integral 4π.
    FourPi,
    /// Integral equal to the scattering coefficient: a volume scattering function.
    Vsf,
    /// Arbitrary integral: only ratios of the values are meaningful.
    Relative,
}
named!(Normalization, "normalization", { One = "1", FourPi = "4pi", Vsf = "vsf", Relative = "relative" });
