//! A spectrum: a function of wavelength alone.

use super::error::RoleError;
use super::view::{Needs, View};
use crate::domain::Quantity;
use crate::evaluate::{Beyond, Interpolation, Material, Place};

const NEEDS: Needs = Needs {
    quantities: &[Quantity::Spectrum, Quantity::Reflectance],
    named: "a spectrum or reflectance",
    has_incoming: false,
    has_outgoing: false,
};

/// A function of wavelength alone: an illuminant, a reflectance, a transmittance.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/d65.wlm"))?;
/// let daylight = material.spectrum()?;
/// let [blue, red] = daylight.at([450.0, 700.0])?;
/// assert!(blue > red);
/// // Nothing was measured out there.
/// assert!(daylight.at([5000.0])?[0].is_nan());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Spectrum<'a> {
    view: View<'a>,
    index: &'a [usize],
}

impl Material {
    /// This material as a spectrum; refused for other quantities, and where there are directions or index axes.
    pub fn spectrum(&self) -> Result<Spectrum<'_>, RoleError> {
        self.spectrum_at(&[])
    }

    /// As [`Material::spectrum`], at an entry of the index axes.
    pub fn spectrum_at<'a>(&'a self, index: &'a [usize]) -> Result<Spectrum<'a>, RoleError> {
        Ok(Spectrum { view: View::new(self, index, &NEEDS)?, index })
    }
}

impl<'a> Spectrum<'a> {
    /// The material, for questions beyond the role.
    pub fn material(&self) -> &'a Material {
        self.view.material()
    }

    /// The wavelengths of the samples; `None` for RGB and monochromatic data.
    pub fn wavelengths(&self) -> Option<Vec<f64>> {
        self.view.material().wavelengths()
    }

    /// The samples in the material's unit; NaN = masked.
    pub fn samples(&self) -> Vec<f32> {
        self.view.eval(None, None)
    }

    /// The values at wavelengths in nm, linear between samples; NaN where a sample is masked and outside those measured.
    /// Refused where there are no wavelengths.
    pub fn at<const N: usize>(&self, wavelengths: [f64; N]) -> Result<[f32; N], RoleError> {
        let mut out = [0.0; N];
        let place = Place { index: self.index, wi: None, wo: None };
        self.material().at_wavelengths(place, Interpolation::Smooth, Beyond::Masked, &wavelengths, &mut out)?;
        Ok(out)
    }
}
