//! A light: how much it sends in each direction.

use super::error::RoleError;
use super::sample::Sample;
use super::view::{Needs, View, ViewAt};
use crate::domain::{Direction, Quantity};
use crate::evaluate::{Beyond, Material};

const NEEDS: Needs =
    Needs { quantities: &[Quantity::Edf], named: "an edf (a luminaire)", has_incoming: false, has_outgoing: true };

/// A light: intensity by direction, in the material's unit ([`Material::unit`]).
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use wavelume_core::domain::Direction;
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/led.wlm"))?;
/// let emitter = material.emitter()?;
/// let down = Direction::from_degrees(180.0, 0.0);
/// assert_eq!(emitter.eval(down).len(), emitter.lambdas());
/// let sample = emitter.sample([0.3, 0.6]).expect("it sends light somewhere");
/// assert!(sample.weight > 0.0 && emitter.pdf(sample.wo) > 0.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Emitter<'a>(View<'a>);

impl Material {
    /// This material as a light; refused for other quantities, and where there are index axes.
    pub fn emitter(&self) -> Result<Emitter<'_>, RoleError> {
        self.emitter_at(&[])
    }

    /// Views one entry of the index axes as a light: `index` has one number for each index axis, from 0.
    pub fn emitter_at(&self, index: &[usize]) -> Result<Emitter<'_>, RoleError> {
        Ok(Emitter(View::new(self, index, &NEEDS)?))
    }
}

impl<'a> Emitter<'a> {
    /// Samples in a spectrum.
    pub fn lambdas(&self) -> usize {
        self.0.lambdas()
    }

    /// The material, for questions beyond the role.
    pub fn material(&self) -> &'a Material {
        self.0.material()
    }

    /// The spectrum of the intensity towards `wo`.
    pub fn eval(&self, wo: Direction) -> Vec<f32> {
        self.0.eval(None, Some(wo))
    }

    /// As [`Emitter::eval`], into memory that is given.
    ///
    /// # Panics
    /// If `out` has not [`Emitter::lambdas`] samples.
    pub fn eval_into(&self, wo: Direction, out: &mut [f32]) {
        self.0.eval_into(None, Some(wo), out);
    }

    /// Draws a direction from a point `u` of the unit square, by the mean over wavelengths; `None` where nothing is emitted.
    pub fn sample(&self, u: [f64; 2]) -> Option<Sample<f64>> {
        self.0.sample(None, u)
    }

    /// The density with which [`Emitter::sample`] draws `wo`, sr⁻¹.
    pub fn pdf(&self, wo: Direction) -> f64 {
        self.0.pdf(None, wo)
    }

    /// The spectrum of the flux as it is stored: the intensity over all directions. Masked cells add nothing; NaN where all are
    /// masked.
    pub fn flux(&self) -> Vec<f32> {
        self.0.albedo(None)
    }

    /// This light at up to eight wavelengths in nm, linear between those measured; beyond their ends there is no light.
    /// Refused where there are no wavelengths (RGB, monochromatic).
    pub fn at<const N: usize>(self, wavelengths: [f64; N]) -> Result<EmitterAt<'a, N>, RoleError> {
        Ok(EmitterAt(self.0.at(wavelengths, Beyond::Zero)?))
    }
}

/// A light at chosen wavelengths; no query allocates but the first sample or density of a material, which builds its trees.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use wavelume_core::domain::Direction;
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/led.wlm"))?;
/// let emitter = material.emitter()?.at([450.0, 550.0, 650.0])?;
/// let sample = emitter.sample([0.3, 0.6]).expect("it sends light somewhere");
/// assert!(emitter.eval(sample.wo).iter().any(|intensity| *intensity > 0.0));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct EmitterAt<'a, const N: usize>(ViewAt<'a, N>);

impl<const N: usize> EmitterAt<'_, N> {
    /// The wavelengths in nm.
    pub fn wavelengths(&self) -> [f64; N] {
        self.0.wavelengths()
    }

    /// As [`Emitter::eval`], at the chosen wavelengths.
    #[inline]
    pub fn eval(&self, wo: Direction) -> [f32; N] {
        self.0.eval(None, Some(wo))
    }

    /// As [`Emitter::sample`], with a weight for each chosen wavelength, 0 where the value is masked.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> Option<Sample<[f32; N]>> {
        self.0.sample(None, u)
    }

    /// As [`Emitter::pdf`].
    #[inline]
    pub fn pdf(&self, wo: Direction) -> f64 {
        self.0.pdf(None, wo)
    }
}
