//! Normalisations of phase functions: integral of the values of a table over the sphere.

use crate::domain::named;

/// Integral of the values of a phase table over the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Normalization {
    /// Values of the phase table integrate to 1 over the sphere.
    One,
    /// Values of the phase table integrate to 4π over the sphere.
    FourPi,
    /// Values of the table integrate to the scattering coefficient over the sphere: they are a volume scattering
    /// function.
    Vsf,
    /// Values of the phase table have an arbitrary integral over the sphere: only their ratios are meaningful.
    Relative,
}
named!(Normalization, "normalization", { One = "1", FourPi = "4pi", Vsf = "vsf", Relative = "relative" });
