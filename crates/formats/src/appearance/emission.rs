//! Emitted light: which quantities are lights, which units count photons, and the energy of these.

use crate::domain::{Quantity, Unit};

/// `N_A·h·c` in J·nm/µmol (SI of 2019). Divided by a wavelength in nm, it is the energy of 1 µmol of photons.
pub(crate) const JOULES_PER_MICROMOLE: f64 = 119.626_565_8;

/// Returns true for quantities whose spectra describe emitted light, not the reflection or scattering of it.
pub(crate) fn emits(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Spectrum | Quantity::Edf)
}

/// Returns true for units of light that count photons (µmol/s) instead of measuring their energy.
pub(crate) fn counts_photons(unit: Unit) -> bool {
    unit == Unit::MicromolePerSecondSteradianNanometre
}
