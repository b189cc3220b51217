//! A medium: where it scatters light.

use super::error::RoleError;
use super::sample::Sample;
use super::view::{Needs, View, ViewAt};
use crate::domain::{Direction, Quantity};
use crate::evaluate::{Beyond, Material};

const NEEDS: Needs =
    Needs { quantities: &[Quantity::Phase], named: "a phase function", has_incoming: true, has_outgoing: true };

/// A phase function: `p(wi, wo)` in sr⁻¹, about 1 over the sphere of `wo`. Forward is `wo` opposite to `wi`.
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
    /// This material as a phase function; refused for other quantities, and where there are index axes.
    pub fn phase(&self) -> Result<Phase<'_>, RoleError> {
        self.phase_at(&[])
    }

    /// Views one entry of the index axes as a phase function: `index` has one number for each index axis, from 0.
    pub fn phase_at(&self, index: &[usize]) -> Result<Phase<'_>, RoleError> {
        Ok(Phase(View::new(self, index, &NEEDS)?))
    }
}

impl<'a> Phase<'a> {
    /// Samples in a spectrum.
    pub fn lambdas(&self) -> usize {
        self.0.lambdas()
    }

    /// The material, for questions beyond the role.
    pub fn material(&self) -> &'a Material {
        self.0.material()
    }

    /// The spectrum of p at `wi` and `wo`.
    pub fn eval(&self, wi: Direction, wo: Direction) -> Vec<f32> {
        self.0.eval(Some(wi), Some(wo))
    }

    /// As [`Phase::eval`], into memory that is given.
    ///
    /// # Panics
    /// If `out` has not [`Phase::lambdas`] samples.
    pub fn eval_into(&self, wi: Direction, wo: Direction, out: &mut [f32]) {
        self.0.eval_into(Some(wi), Some(wo), out);
    }

    /// Draws a direction from a point `u` of the unit square, by the mean over wavelengths; `None` where nothing is scattered.
    pub fn sample(&self, wi: Direction, u: [f64; 2]) -> Option<Sample<f64>> {
        self.0.sample(Some(wi), u)
    }

    /// The density with which [`Phase::sample`] draws `wo`, sr⁻¹.
    pub fn pdf(&self, wi: Direction, wo: Direction) -> f64 {
        self.0.pdf(Some(wi), wo)
    }

    /// The spectrum of ∫ p dωo as it is stored: 1 for a phase function that is normalised. Masked cells add nothing; NaN where all
    /// are masked.
    pub fn integral(&self, wi: Direction) -> Vec<f32> {
        self.0.albedo(Some(wi))
    }

    /// This phase function at up to eight wavelengths in nm, linear between those measured; beyond their ends the value of the end holds.
    /// Refused where there are no wavelengths (RGB, monochromatic).
    pub fn at<const N: usize>(self, wavelengths: [f64; N]) -> Result<PhaseAt<'a, N>, RoleError> {
        Ok(PhaseAt(self.0.at(wavelengths, Beyond::Nearest)?))
    }
}

/// A phase function at chosen wavelengths; no query allocates but the first sample or density of a material, which builds its trees.
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
    /// The wavelengths in nm.
    pub fn wavelengths(&self) -> [f64; N] {
        self.0.wavelengths()
    }

    /// As [`Phase::eval`], at the chosen wavelengths.
    #[inline]
    pub fn eval(&self, wi: Direction, wo: Direction) -> [f32; N] {
        self.0.eval(Some(wi), Some(wo))
    }

    /// As [`Phase::sample`], with a weight for each chosen wavelength, 0 where the value is masked.
    #[inline]
    pub fn sample(&self, wi: Direction, u: [f64; 2]) -> Option<Sample<[f32; N]>> {
        self.0.sample(Some(wi), u)
    }

    /// As [`Phase::pdf`].
    #[inline]
    pub fn pdf(&self, wi: Direction, wo: Direction) -> f64 {
        self.0.pdf(Some(wi), wo)
    }
}
