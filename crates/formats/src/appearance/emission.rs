//! Emitted light: which quantities are lights, which units count photons, and the energy of these.

use crate::domain::{Quantity, Unit};

/// `N_A·h·c` in J·nm/µmol (SI of 2019): the energy of 1 µmol of photons is this divided by the wavelength in nm.
pub(crate) const JOULES_PER_MICROMOLE: f64 = 119.626_565_8;

/// Returns true for quantities whose spectra are those of a light, not of a surface in one.
pub(crate) fn emits(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Spectrum | Quantity::Edf)
}

/// Returns true for units that count photons instead of their energy.
pub(crate) fn counts_photons(unit: Unit) -> bool {
    unit == Unit::MicromolePerSecondSteradianNanometre
}
