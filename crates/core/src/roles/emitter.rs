//! View of a material as a light source: intensity by direction.

use super::error::RoleError;
use super::sample::Sample;
use super::view::{Needs, View, ViewAt};
use crate::domain::{Direction, Quantity};
use crate::evaluate::{Beyond, Material};

const NEEDS: Needs =
    Needs { quantities: &[Quantity::Edf], named: "an edf (a luminaire)", has_incoming: false, has_outgoing: true };

/// View of a material as a light source: intensity by direction, in the unit of the material ([`Material::unit`]).
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
    /// Views the material as a light source. Fails for other quantities and for materials with index axes (axes of
    /// numbered entries).
    pub fn emitter(&self) -> Result<Emitter<'_>, RoleError> {
        self.emitter_at(&[])
    }

    /// Views one entry of the index axes (axes of numbered entries) as a light source. `index` has one number per index
    /// axis, from 0.
    pub fn emitter_at(&self, index: &[usize]) -> Result<Emitter<'_>, RoleError> {
        Ok(Emitter(View::new(self, index, &NEEDS)?))
    }
}

impl<'a> Emitter<'a> {
    /// Returns the number of samples of each spectrum: wavelengths, colour channels, or 1 for monochromatic data.
    pub fn lambdas(&self) -> usize {
        self.0.lambdas()
    }

    /// Returns the material that this object presents as a light source, for queries such as its axes or unit.
    pub fn material(&self) -> &'a Material {
        self.0.material()
    }

    /// Returns the spectrum of the intensity towards direction `wo`.
    pub fn eval(&self, wo: Direction) -> Vec<f32> {
        self.0.eval(None, Some(wo))
    }

    /// Writes the spectrum of the intensity to `out`, like [`Emitter::eval`].
    ///
    /// # Panics
    /// If the length of `out` is not [`Emitter::lambdas`].
    pub fn eval_into(&self, wo: Direction, out: &mut [f32]) {
        self.0.eval_into(None, Some(wo), out);
    }

    /// Samples a direction of emission by importance, according to the mean over wavelengths, from a point `u` of the
    /// unit square. `None` if no light is emitted.
    pub fn sample(&self, u: [f64; 2]) -> Option<Sample<f64>> {
        self.0.sample(None, u)
    }

    /// Returns the probability density, in sr⁻¹, with which [`Emitter::sample`] draws the direction `wo`.
    pub fn pdf(&self, wo: Direction) -> f64 {
        self.0.pdf(None, wo)
    }

    /// Returns the spectrum of the flux: the integral over all directions of the intensity, as the stored piecewise
    /// constant function. Masked cells count as 0; NaN if all are masked.
    pub fn flux(&self) -> Vec<f32> {
        self.0.albedo(None)
    }

    /// Restricts the light source to up to eight wavelengths in nm. Values are linear between measured wavelengths and
    /// 0 beyond them. Fails for materials without wavelengths (RGB, monochromatic).
    pub fn at<const N: usize>(self, wavelengths: [f64; N]) -> Result<EmitterAt<'a, N>, RoleError> {
        Ok(EmitterAt(self.0.at(wavelengths, Beyond::Zero)?))
    }
}

/// View of a material as a light source at chosen wavelengths. Queries do not allocate memory, except the first one for
/// a sampled direction or its density: it builds the trees from which directions of this material are drawn.
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
    /// Returns the chosen wavelengths in nm.
    pub fn wavelengths(&self) -> [f64; N] {
        self.0.wavelengths()
    }

    /// Returns the intensity towards `wo` at the chosen wavelengths.
    #[inline]
    pub fn eval(&self, wo: Direction) -> [f32; N] {
        self.0.eval(None, Some(wo))
    }

    /// Samples a direction of emission like [`Emitter::sample`], with one weight per chosen wavelength, which is 0 if
    /// the value is masked.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> Option<Sample<[f32; N]>> {
        self.0.sample(None, u)
    }

    /// Returns the probability density, in sr⁻¹, with which the direction `wo` is sampled, like [`Emitter::pdf`].
    #[inline]
    pub fn pdf(&self, wo: Direction) -> f64 {
        self.0.pdf(None, wo)
    }
}
