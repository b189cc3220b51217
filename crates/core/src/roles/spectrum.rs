//! View of a material as a function of wavelength alone.

use super::error::RoleError;
use super::view::{Needs, View};
use crate::domain::Quantity;
use crate::evaluate::Material;

const NEEDS: Needs =
    Needs { quantities: Quantity::ALL, named: "any quantity", has_incoming: false, has_outgoing: false };

/// View of a material as a function of wavelength alone: an illuminant, a reflectance, a transmittance, or any other
/// quantity without directions.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/d65.wlm"))?;
/// let daylight = material.spectrum()?;
/// let [blue, red] = daylight.values_at([450.0, 700.0])?;
/// assert!(blue > red);
/// // Nothing was measured out there.
/// assert!(daylight.values_at([5000.0])?[0].is_nan());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Spectrum<'a>(View<'a>);

impl Material {
    /// Views the material as a spectrum. Fails for materials with directions or with index axes (axes of numbered
    /// entries).
    pub fn spectrum(&self) -> Result<Spectrum<'_>, RoleError> {
        self.spectrum_at(&[])
    }

    /// Views one entry of the index axes (axes of numbered entries) as a spectrum. `index` has one number per index
    /// axis, from 0.
    pub fn spectrum_at(&self, index: &[usize]) -> Result<Spectrum<'_>, RoleError> {
        Ok(Spectrum(View::new(self, index, &NEEDS)?))
    }
}

impl<'a> Spectrum<'a> {
    /// Returns the material that this object presents as a spectrum, for queries such as its axes or unit.
    pub fn material(&self) -> &'a Material {
        self.0.material()
    }

    /// Returns the wavelengths of the samples in nm; `None` for RGB and monochromatic data.
    pub fn wavelengths(&self) -> Option<Vec<f64>> {
        self.0.material().wavelengths()
    }

    /// Returns the number of samples of the spectrum: wavelengths, colour channels, or 1 for monochromatic data.
    pub fn lambdas(&self) -> usize {
        self.0.lambdas()
    }

    /// Returns the samples of the spectrum in the unit of the material; NaN marks masked samples.
    pub fn samples(&self) -> Vec<f32> {
        self.0.eval(None, None)
    }

    /// Returns the values of the spectrum at wavelengths in nm, linear between samples; NaN at masked samples and
    /// outside the measured range. Fails for materials without wavelengths.
    pub fn values_at<const N: usize>(&self, wavelengths: [f64; N]) -> Result<[f32; N], RoleError> {
        let mut out = [0.0; N];
        self.0.at_wavelengths(&wavelengths, &mut out)?;
        Ok(out)
    }
}
