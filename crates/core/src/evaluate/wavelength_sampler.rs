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

/// Draws directions by the values at one wavelength, where [`super::Material::sample`] and its relatives use the mean.
#[derive(Debug)]
pub struct WavelengthSampler<'a> {
    function: &'a Function,
    /// Lobe beside the function, and its colour at the wavelength.
    lobe: Option<(&'a Lobed, f32)>,
    stated: Option<&'a Stated>,
    trees: Trees,
}

impl<'a> WavelengthSampler<'a> {
    /// Sampler at `wavelength` in nm, linear between the samples of the spectra, of a function and the lobe added to
    /// it. It shares the tables of `mean`, the trees of the mean. Weights are those of `stated` if given. Fails outside
    /// the measured range.
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

    /// Like [`super::Material::sample`]; the weight is that of f at the wavelength.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        match self.stated {
            None => self.sampler().sample(index, wi, u, options.into()),
            Some(stated) => self.sampler().sample_of(stated, index, wi, u, options.into()),
        }
    }

    /// Like [`super::Material::pdf`].
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

    /// Like [`super::Material::invert`].
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
