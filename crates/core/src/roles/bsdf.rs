//! View of a material as a surface that reflects or transmits light.

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

/// View of a material as a surface that reflects or transmits: a BRDF, a BTDF or both, `f(wi, wo)` in sr⁻¹.
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
    /// Views the material as a surface that reflects or transmits. Fails for other quantities and for materials with
    /// index axes (axes of numbered entries).
    pub fn bsdf(&self) -> Result<Bsdf<'_>, RoleError> {
        self.bsdf_at(&[])
    }

    /// Views one entry of the index axes (axes of numbered entries) as a surface. `index` has one number per index
    /// axis, from 0.
    pub fn bsdf_at(&self, index: &[usize]) -> Result<Bsdf<'_>, RoleError> {
        Ok(Bsdf(View::new(self, index, &NEEDS)?))
    }
}

impl<'a> Bsdf<'a> {
    /// Returns the number of samples of each spectrum: wavelengths, colour channels, or 1 for monochromatic data.
    pub fn lambdas(&self) -> usize {
        self.0.lambdas()
    }

    /// Returns the material that this object presents as a surface, for queries such as its axes or unit.
    pub fn material(&self) -> &'a Material {
        self.0.material()
    }

    /// Returns the spectrum of the BSDF for incoming `wi` and outgoing `wo`, in sr⁻¹, without a cosine.
    pub fn eval(&self, wi: Direction, wo: Direction) -> Vec<f32> {
        self.0.eval(Some(wi), Some(wo))
    }

    /// Writes the spectrum of the BSDF for incoming `wi` and outgoing `wo` to `out`, in sr⁻¹, without a cosine.
    ///
    /// # Panics
    /// If the length of `out` is not [`Bsdf::lambdas`].
    pub fn eval_into(&self, wi: Direction, wo: Direction, out: &mut [f32]) {
        self.0.eval_into(Some(wi), Some(wo), out);
    }

    /// Samples an outgoing direction by importance, according to the mean over wavelengths, from a point `u` of the
    /// unit square. `None` if no light is reflected or transmitted.
    pub fn sample(&self, wi: Direction, u: [f64; 2]) -> Option<Sample<f64>> {
        self.0.sample(Some(wi), u)
    }

    /// Returns the probability density, in sr⁻¹, with which [`Bsdf::sample`] draws the outgoing direction `wo`.
    pub fn pdf(&self, wi: Direction, wo: Direction) -> f64 {
        self.0.pdf(Some(wi), wo)
    }

    /// Returns the spectrum of the directional albedo ∫ f · |cos θo| dωo, of reflection and transmission together. It
    /// integrates the stored piecewise constant function; [`Material::integrated`] integrates the interpolated one.
    /// Masked cells count as 0; NaN if all are masked.
    pub fn albedo(&self, wi: Direction) -> Vec<f32> {
        self.0.albedo(Some(wi))
    }

    /// Restricts the surface to up to eight wavelengths in nm. Values are linear between measured wavelengths and
    /// constant beyond them. Fails for materials without wavelengths (RGB, monochromatic).
    pub fn at<const N: usize>(self, wavelengths: [f64; N]) -> Result<BsdfAt<'a, N>, RoleError> {
        Ok(BsdfAt(self.0.at(wavelengths, Beyond::Nearest)?))
    }
}

/// View of a material as a surface at chosen wavelengths. Queries do not allocate memory, except the first one for a
/// sampled direction or its density: it builds the trees from which directions of this material are drawn.
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
    /// Returns the chosen wavelengths in nm.
    pub fn wavelengths(&self) -> [f64; N] {
        self.0.wavelengths()
    }

    /// Returns the BSDF for incoming `wi` and outgoing `wo`, in sr⁻¹, at the chosen wavelengths.
    #[inline]
    pub fn eval(&self, wi: Direction, wo: Direction) -> [f32; N] {
        self.0.eval(Some(wi), Some(wo))
    }

    /// Samples an outgoing direction like [`Bsdf::sample`], with one weight per chosen wavelength, which is 0 if the
    /// value is masked.
    #[inline]
    pub fn sample(&self, wi: Direction, u: [f64; 2]) -> Option<Sample<[f32; N]>> {
        self.0.sample(Some(wi), u)
    }

    /// Returns the probability density, in sr⁻¹, with which the outgoing direction `wo` is sampled, like [`Bsdf::pdf`].
    #[inline]
    pub fn pdf(&self, wi: Direction, wo: Direction) -> f64 {
        self.0.pdf(Some(wi), wo)
    }
}
