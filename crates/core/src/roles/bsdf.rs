//! A surface: what it reflects and transmits.

use super::error::RoleError;
use super::sample::Sample;
use super::view::{Needs, View, ViewAt};
use crate::domain::{Direction, Quantity};
use crate::evaluate::{Beyond, Material};

const NEEDS: Needs = Needs {
    quantities: &[Quantity::Brdf, Quantity::Btdf, Quantity::Bsdf],
    named: "a brdf, btdf or bsdf",
    has_incoming: true,
    has_outgoing: true,
};

/// A surface that reflects or transmits: a BRDF, a BTDF or both, `f(wi, wo)` in sr⁻¹.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use wavelume_core::domain::Direction;
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/plastic.wlm"))?;
/// let bsdf = material.bsdf()?;
/// let (wi, wo) = (Direction::from_degrees(30.0, 0.0), Direction::from_degrees(45.0, 180.0));
/// assert_eq!(bsdf.eval(wi, wo).len(), bsdf.lambdas());
/// let sample = bsdf.sample(wi, [0.3, 0.6]).expect("light goes somewhere");
/// assert!(sample.weight > 0.0 && bsdf.pdf(wi, sample.wo) > 0.0);
/// // f is without the cosine; a reflecting surface reflects nothing downward.
/// let below = Direction::from_degrees(135.0, 0.0);
/// assert!(bsdf.eval(wi, below).iter().all(|f| *f == 0.0));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<'a>(View<'a>);

impl Material {
    /// This material as a surface; refused for other quantities, and where there are index axes.
    pub fn bsdf(&self) -> Result<Bsdf<'_>, RoleError> {
        self.bsdf_at(&[])
    }

    /// Views one entry of the index axes as a surface: `index` has one number for each index axis, from 0.
    pub fn bsdf_at(&self, index: &[usize]) -> Result<Bsdf<'_>, RoleError> {
        Ok(Bsdf(View::new(self, index, &NEEDS)?))
    }
}

impl<'a> Bsdf<'a> {
    /// Samples in a spectrum.
    pub fn lambdas(&self) -> usize {
        self.0.lambdas()
    }

    /// The material, for questions beyond the role.
    pub fn material(&self) -> &'a Material {
        self.0.material()
    }

    /// The spectrum of f at `wi` and `wo`, without a cosine.
    pub fn eval(&self, wi: Direction, wo: Direction) -> Vec<f32> {
        self.0.eval(Some(wi), Some(wo))
    }

    /// As [`Bsdf::eval`], into memory that is given.
    ///
    /// # Panics
    /// If `out` has not [`Bsdf::lambdas`] samples.
    pub fn eval_into(&self, wi: Direction, wo: Direction, out: &mut [f32]) {
        self.0.eval_into(Some(wi), Some(wo), out);
    }

    /// Draws a direction from a point `u` of the unit square, by the mean over wavelengths; `None` where nothing is reflected or transmitted.
    pub fn sample(&self, wi: Direction, u: [f64; 2]) -> Option<Sample<f64>> {
        self.0.sample(Some(wi), u)
    }

    /// The density with which [`Bsdf::sample`] draws `wo`, sr⁻¹.
    pub fn pdf(&self, wi: Direction, wo: Direction) -> f64 {
        self.0.pdf(Some(wi), wo)
    }

    /// The spectrum of the directional albedo ∫ f · |cos θo| dωo, of reflection and transmission together, as it is stored.
    /// Masked cells add nothing; NaN where all are masked. [`Material::integrated`] integrates what is evaluated.
    pub fn albedo(&self, wi: Direction) -> Vec<f32> {
        self.0.albedo(Some(wi))
    }

    /// This surface at up to eight wavelengths in nm, linear between those measured; beyond their ends the value of the end holds.
    /// Refused where there are no wavelengths (RGB, monochromatic).
    pub fn at<const N: usize>(self, wavelengths: [f64; N]) -> Result<BsdfAt<'a, N>, RoleError> {
        Ok(BsdfAt(self.0.at(wavelengths, Beyond::Nearest)?))
    }
}

/// A surface at chosen wavelengths; no query allocates but the first sample or density of a material, which builds its trees.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use wavelume_core::domain::Direction;
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/plastic.wlm"))?;
/// let bsdf = material.bsdf()?.at([450.0, 550.0, 650.0])?;
/// let wi = Direction::from_degrees(30.0, 0.0);
/// let sample = bsdf.sample(wi, [0.3, 0.6]).expect("light goes somewhere");
/// assert!(bsdf.eval(wi, sample.wo).iter().all(|f| *f > 0.0));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct BsdfAt<'a, const N: usize>(ViewAt<'a, N>);

impl<const N: usize> BsdfAt<'_, N> {
    /// The wavelengths in nm.
    pub fn wavelengths(&self) -> [f64; N] {
        self.0.wavelengths()
    }

    /// As [`Bsdf::eval`], at the chosen wavelengths.
    #[inline]
    pub fn eval(&self, wi: Direction, wo: Direction) -> [f32; N] {
        self.0.eval(Some(wi), Some(wo))
    }

    /// As [`Bsdf::sample`], with a weight for each chosen wavelength, 0 where the value is masked.
    #[inline]
    pub fn sample(&self, wi: Direction, u: [f64; 2]) -> Option<Sample<[f32; N]>> {
        self.0.sample(Some(wi), u)
    }

    /// As [`Bsdf::pdf`].
    #[inline]
    pub fn pdf(&self, wi: Direction, wo: Direction) -> f64 {
        self.0.pdf(Some(wi), wo)
    }
}
