//! View of a material as a scattering medium.

use super::error::RoleError;
use super::sample::Sample;
use super::view::{Needs, View, ViewAt};
use crate::domain::{Direction, Quantity};
use crate::evaluate::{Beyond, Material};

const NEEDS: Needs =
    Needs { quantities: &[Quantity::Phase], named: "a phase function", has_incoming: true, has_outgoing: true };

/// View of a material as a phase function `p(wi, wo)` in sr⁻¹, whose integral over all `wo` is about 1. Forward
/// scattering has `wo` opposite to `wi`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use wavelume_core::domain::Direction;
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/hazy.wlm"))?;
/// let phase = material.phase()?;
/// let (wi, wo) = (Direction::from_degrees(30.0, 0.0), Direction::from_degrees(45.0, 180.0));
/// assert_eq!(phase.eval(wi, wo).len(), phase.lambdas());
/// let sample = phase.sample(wi, [0.3, 0.6]).expect("light goes somewhere");
/// assert!(sample.weight > 0.0 && phase.pdf(wi, sample.wo) > 0.0);
/// let opposite = Direction::from_degrees(150.0, 180.0);
/// assert!(phase.eval(wi, opposite)[0] > phase.eval(wi, wi)[0]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Phase<'a>(View<'a>);

impl Material {
    /// Views the material as a phase function. Fails for other quantities and for materials with index axes (axes of
    /// numbered entries).
    pub fn phase(&self) -> Result<Phase<'_>, RoleError> {
        self.phase_at(&[])
    }

    /// Views one entry of the index axes (axes of numbered entries) as a phase function. `index` has one number per
    /// index axis, from 0.
    pub fn phase_at(&self, index: &[usize]) -> Result<Phase<'_>, RoleError> {
        Ok(Phase(View::new(self, index, &NEEDS)?))
    }
}

impl<'a> Phase<'a> {
    /// Returns the number of samples of each spectrum: wavelengths, colour channels, or 1 for monochromatic data.
    pub fn lambdas(&self) -> usize {
        self.0.lambdas()
    }

    /// Returns the material that this object presents as a phase function, for queries such as its axes or unit.
    pub fn material(&self) -> &'a Material {
        self.0.material()
    }

    /// Returns the spectrum of the phase function for incoming `wi` and outgoing `wo`, in sr⁻¹.
    pub fn eval(&self, wi: Direction, wo: Direction) -> Vec<f32> {
        self.0.eval(Some(wi), Some(wo))
    }

    /// Writes the spectrum of the phase function to `out`, like [`Phase::eval`].
    ///
    /// # Panics
    /// If the length of `out` is not [`Phase::lambdas`].
    pub fn eval_into(&self, wi: Direction, wo: Direction, out: &mut [f32]) {
        self.0.eval_into(Some(wi), Some(wo), out);
    }

    /// Samples an outgoing direction by importance, according to the mean over wavelengths, from a point `u` of the
    /// unit square. `None` if no light is scattered.
    pub fn sample(&self, wi: Direction, u: [f64; 2]) -> Option<Sample<f64>> {
        self.0.sample(Some(wi), u)
    }

    /// Returns the probability density, in sr⁻¹, with which [`Phase::sample`] draws the outgoing direction `wo`.
    pub fn pdf(&self, wi: Direction, wo: Direction) -> f64 {
        self.0.pdf(Some(wi), wo)
    }

    /// Returns the spectrum of the integral ∫ p dωo of the stored piecewise constant phase function, which is 1 if it
    /// is normalised. Masked cells count as 0; NaN if all are masked.
    pub fn integral(&self, wi: Direction) -> Vec<f32> {
        self.0.albedo(Some(wi))
    }

    /// Restricts the phase function to up to eight wavelengths in nm. Values are linear between measured wavelengths
    /// and constant beyond them. Fails for materials without wavelengths (RGB, monochromatic).
    pub fn at<const N: usize>(self, wavelengths: [f64; N]) -> Result<PhaseAt<'a, N>, RoleError> {
        Ok(PhaseAt(self.0.at(wavelengths, Beyond::Nearest)?))
    }
}

/// View of a material as a phase function at chosen wavelengths. Queries do not allocate memory, except the first one
/// for a sampled direction or its density: it builds the trees from which directions of this material are drawn.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use wavelume_core::domain::Direction;
/// use wavelume_core::roles::PhaseAt;
/// fn scatter(phase: &PhaseAt<'_, 4>, wi: Direction, u: [f64; 2]) -> Option<(Direction, [f32; 4])> {
///     phase.sample(wi, u).map(|sample| (sample.wo, sample.weight))
/// }
/// // This haze is monochromatic: it has no wavelengths to choose.
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/hazy.wlm"))?;
/// assert!(material.phase()?.at([450.0, 500.0, 550.0, 600.0]).is_err());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct PhaseAt<'a, const N: usize>(ViewAt<'a, N>);

impl<const N: usize> PhaseAt<'_, N> {
    /// Returns the chosen wavelengths in nm.
    pub fn wavelengths(&self) -> [f64; N] {
        self.0.wavelengths()
    }

    /// Returns the phase function for incoming `wi` and outgoing `wo`, in sr⁻¹, at the chosen wavelengths.
    #[inline]
    pub fn eval(&self, wi: Direction, wo: Direction) -> [f32; N] {
        self.0.eval(Some(wi), Some(wo))
    }

    /// Samples an outgoing direction like [`Phase::sample`], with one weight per chosen wavelength, which is 0 if the
    /// value is masked.
    #[inline]
    pub fn sample(&self, wi: Direction, u: [f64; 2]) -> Option<Sample<[f32; N]>> {
        self.0.sample(Some(wi), u)
    }

    /// Returns the probability density, in sr⁻¹, with which the outgoing direction `wo` is sampled, like
    /// [`Phase::pdf`].
    #[inline]
    pub fn pdf(&self, wi: Direction, wo: Direction) -> f64 {
        self.0.pdf(Some(wi), wo)
    }
}
