//! Emitted light: which quantities are lights, which units count photons, and the energy of these.

use crate::domain::{Quantity, Unit};

/// Returns true for quantities whose spectra describe emitted light, not the reflection or scattering of it.
pub(crate) fn emits(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Spectrum | Quantity::Edf)
}

/// Returns true for units of light that count photons (µmol/s) instead of measuring their energy.
pub(crate) fn counts_photons(unit: Unit) -> bool {
    unit == Unit::MicromolePerSecondSteradianNanometre
}
