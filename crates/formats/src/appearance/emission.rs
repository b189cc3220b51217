//! Quantities that describe emitted light.

use crate::domain::Quantity;

/// Returns true for quantities whose spectra describe emitted light, not the reflection or scattering of it.
pub(crate) fn emits(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Spectrum | Quantity::Edf)
}
