//! Sampling by the values at one wavelength.

use super::error::{EvaluateError, QueryError, unfit};
use super::function::Function;
use super::lobed::Lobed;
use super::lookup::MeshLookup;
use super::sampler::{DirectionSample, Sampler};
use super::stated::{Stated, as_drawn};
use super::trees::Trees;
use super::warp::SampleOptions;
use crate::domain::Direction;

/// Draws outgoing directions in proportion to the values at one wavelength, whereas [`super::Material::sample`] uses
/// the mean over wavelengths.
#[derive(Debug)]
pub struct WavelengthSampler<'a> {
    function: &'a Function,
    /// Analytic lobe that evaluation adds to the function of the samples, and the lobe's colour (factor on its shape)
    /// at the wavelength by which directions are drawn.
    lobe: Option<(&'a Lobed, f32)>,
    stated: Option<&'a Stated>,
    trees: Trees,
}

impl<'a> WavelengthSampler<'a> {
    /// Builds a sampler of outgoing directions in proportion to the values at `wavelength` in nm, linear between the
    /// samples of the spectra. An analytic lobe that evaluation adds counts too. Fails outside the measured range.
    ///
    /// The sampler shares the geometry tables of `mean`, the sampling trees of the mean over wavelengths. If `stated`
    /// (samples on a grid of angles) is given, the weights f · |cos θo| / pdf use its values of f.
    pub(super) fn at(
        (function, lobe): (&'a Function, Option<&'a Lobed>),
        stated: Option<&'a Stated>,
        lookup: &MeshLookup,
        mean: &Trees,
        wavelength: f64,
    ) -> Result<Self, EvaluateError> {
        let geometry = function.geometry();
        let Some(grid) = geometry.grid() else {
            return unfit(QueryError::NoWavelengths { quantity: geometry.quantity() });
        };
        let Some((below, t)) = grid.locate(wavelength) else {
            return unfit(QueryError::Wavelength { found: wavelength });
        };
        let mut weights = vec![0.0; geometry.lambdas()];
        weights[below] = (1.0 - t) as f32;
        if t > 0.0 {
            weights[below + 1] = t as f32;
        }
        let lobe = lobe.map(|lobe| (lobe, lobe.colour(&weights)));
        Ok(Self { function, lobe, stated, trees: mean.by(function, lookup, &weights) })
    }

    fn sampler(&self) -> Sampler<'_> {
        Sampler::new(self.function, self.lobe, &self.trees)
    }

    /// Draws an outgoing direction like [`super::Material::sample`], with density and weight by the values at the
    /// sampler's wavelength.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        match self.stated {
            None => self.sampler().sample(index, wi, u, options.into()),
            Some(stated) => {
                self.sampler().sample_of((stated, Some(self.trees.weights())), index, wi, u, options.into())
            }
        }
    }

    /// Returns the probability density, in sr⁻¹, with which [`Self::sample`] draws the outgoing direction `wo` by the
    /// values at the sampler's wavelength.
    pub fn pdf(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: impl Into<SampleOptions>,
    ) -> Result<f64, EvaluateError> {
        let (wi, wo) = as_drawn(self.stated, wi, wo);
        self.sampler().pdf(index, wi, wo, options.into())
    }

    /// Point of the unit square that draws a direction, like [`super::Material::invert`], by the values at the
    /// sampler's wavelength.
    pub fn invert(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: impl Into<SampleOptions>,
    ) -> Result<Option<[f64; 2]>, EvaluateError> {
        let (wi, wo) = as_drawn(self.stated, wi, wo);
        self.sampler().invert(index, wi, wo, options.into())
    }

    /// Memory of the sampler in bytes.
    pub fn memory(&self) -> usize {
        size_of::<Self>() + self.trees.memory()
    }
}
