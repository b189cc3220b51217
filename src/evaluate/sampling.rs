//! Importance sampling of a material's outgoing directions: one warp for every incoming cell (\[CPB06\] section 6.1.2).
//!
//! A leaf weighs max(0, value) × the integral of |cos θ| over it (BRDF, BTDF, BSDF) or × its solid angle (emission, phase
//! functions), the value being the mean over wavelengths or that at one wavelength: linear means, never those of logarithms.
//! What [`super::warp`] does with it, and what is continuous, is told there.

use super::material::turned;
use super::warp::{Density, Measure, SampleOptions, WarpMesh, Warps};
use super::{DirectionSample, EvaluateError, Material, unfit};
use crate::domain::{Direction, Measurement, TriangleMesh};
use std::sync::Arc;

/// The warps of all incoming cells, and what the weights of samples need.
#[derive(Debug)]
pub(super) struct Trees {
    warps: Warps,
    has_cosine: bool,
    /// `[cell, vertex]`: the mean of the leaves around by solid angle, without the cosine.
    means: Vec<f32>,
}

impl Trees {
    /// By the mean over wavelengths.
    pub(super) fn new(measurement: &Measurement, mesh: TriangleMesh, lambdas: usize) -> Self {
        Self::of(measurement, mesh, lambdas, mean)
    }

    /// By what `value` makes of a spectrum; NaN = masked.
    fn of(measurement: &Measurement, mesh: TriangleMesh, lambdas: usize, value: impl Fn(&[f32]) -> f64 + Sync) -> Self {
        let has_cosine = measurement.quantity.has_cosine();
        let measure = if has_cosine { Measure::Projected } else { Measure::SolidAngle };
        let shared = Arc::new(WarpMesh::new(mesh, measure));
        let angles = mesh.solid_angles();
        let samples = measurement.tensor.samples();
        let length = mesh.len() * lambdas;
        let at_vertices = |cell: usize, leaf: &mut dyn FnMut(usize, f64)| {
            let mut sums = vec![[0.0_f64; 2]; shared.vertices().len()];
            for (i, spectrum) in samples[cell * length..][..length].chunks_exact(lambdas).enumerate() {
                let value = value(spectrum);
                if value.is_finite() {
                    let value = value.max(0.0);
                    leaf(i, value);
                    for &vertex in &shared.corners()[i] {
                        let [sum, weight] = &mut sums[vertex as usize];
                        *sum += angles[i] * value;
                        *weight += angles[i];
                    }
                }
            }
            sums.into_iter().map(|[sum, weight]| if weight > 0.0 { sum / weight } else { 0.0 }).collect::<Vec<f64>>()
        };
        let cells = samples.len() / length;
        let warps = Warps::new(Arc::clone(&shared), cells, |cell, integrals, values| {
            let means = at_vertices(cell, &mut |i, value| integrals[i] = value * shared.measures()[i]);
            for ((to, mean), point) in values.iter_mut().zip(means).zip(shared.vertices()) {
                *to = if has_cosine { mean * point.cos_theta().abs() } else { mean };
            }
        });
        let means = (0..cells).flat_map(|cell| at_vertices(cell, &mut |_, _| ())).map(|mean| mean as f32).collect();
        Self { warps, has_cosine, means }
    }

    pub(super) fn memory(&self) -> usize {
        self.warps.memory() + self.warps.mesh().memory() + size_of_val(&*self.means)
    }
}

/// Draws from a material by its values at one wavelength; as [`Material::sample`] and its kin do by the mean.
#[derive(Debug)]
pub struct WavelengthSampler<'a> {
    material: &'a Material,
    trees: Trees,
}

impl WavelengthSampler<'_> {
    /// As [`Material::sample`]; the weight is that of f at the wavelength.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        self.material.sample_by(&self.trees, index, wi, u, options.into())
    }

    /// As [`Material::pdf`].
    pub fn pdf(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: impl Into<SampleOptions>,
    ) -> Result<f64, EvaluateError> {
        self.material.pdf_by(&self.trees, index, wi, wo, options.into())
    }

    /// As [`Material::invert`].
    pub fn invert(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: impl Into<SampleOptions>,
    ) -> Result<Option<[f64; 2]>, EvaluateError> {
        self.material.invert_by(&self.trees, index, wi, wo, options.into())
    }

    /// Memory of the sampler in bytes.
    pub fn memory(&self) -> usize {
        size_of::<Self>() + self.trees.memory()
    }
}

impl Material {
    /// The density in sr⁻¹ with which [`Material::sample`] with the same options draws `wo`; 0 outside the outgoing domain and
    /// where nothing is emitted or reflected (nor drawn defensively).
    pub fn pdf(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: impl Into<SampleOptions>,
    ) -> Result<f64, EvaluateError> {
        self.pdf_by(self.mean_trees()?, index, wi, wo, options.into())
    }

    /// Draws an outgoing direction from the unit square's `u`, by the mean over wavelengths; `None` where nothing is emitted
    /// or reflected. Incoming directions take their cell as [`super::Interpolation::Constant`] does. `options` may be given
    /// as an end level alone.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        self.sample_by(self.mean_trees()?, index, wi, u, options.into())
    }

    /// The point of the unit square that [`Material::sample`] with the same options takes to `wo`; `None` where its density
    /// is 0. In a mixture it is the tree's, as [`Warps::invert`] says.
    pub fn invert(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: impl Into<SampleOptions>,
    ) -> Result<Option<[f64; 2]>, EvaluateError> {
        self.invert_by(self.mean_trees()?, index, wi, wo, options.into())
    }

    /// Builds the trees of one wavelength in nm, linear between the samples of the spectra. Refused outside the measured range.
    pub fn sampler_at(&self, wavelength: f64) -> Result<WavelengthSampler<'_>, EvaluateError> {
        let Some(lookup) = &self.outgoing else { return self.nothing_to_sample() };
        let Some(grid) = self.grid() else {
            return unfit(format!("a wavelength was given, but this {} has none", self.measurement.quantity));
        };
        let Some((below, t)) = grid.locate(wavelength) else {
            return unfit(format!("{wavelength} nm is outside the measured wavelengths"));
        };
        let value = |spectrum: &[f32]| {
            let at = |i: usize| f64::from(spectrum[i]);
            if t == 0.0 { at(below) } else { (1.0 - t) * at(below) + t * at(below + 1) }
        };
        let trees = Trees::of(&self.measurement, lookup.mesh(), self.shape[2], value);
        Ok(WavelengthSampler { material: self, trees })
    }

    fn sample_by(
        &self,
        trees: &Trees,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        let cell = self.sampled_cell(index, wi, options)?;
        if !u.iter().all(|u| (0.0..=1.0).contains(u)) {
            return unfit(format!("u = [{}, {}], expected a point of the unit square", u[0], u[1]));
        }
        let Some(drawn) = trees.warps.sample(cell, u, &options) else { return Ok(None) };
        let value = match options.density {
            Density::Uniform => trees.warps.mean(cell, drawn.leaf),
            Density::Linear => {
                let points = trees.warps.mesh().vertices().len();
                let means = &trees.means[cell * points..][..points];
                let [a, b, c] = trees.warps.mesh().corners()[drawn.leaf];
                let [x, y, z] = drawn.coordinates;
                let mean = |vertex: u32| f64::from(means[vertex as usize]);
                x * mean(a) + y * mean(b) + z * mean(c)
            }
        };
        let cosine = if trees.has_cosine { drawn.direction.cos_theta().abs() } else { 1.0 };
        let [cos, sin] = self.azimuth(wi);
        let direction = turned(drawn.direction, cos, sin);
        Ok(Some(DirectionSample { direction, pdf: drawn.pdf, weight: value * cosine / drawn.pdf }))
    }

    fn pdf_by(
        &self,
        trees: &Trees,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: SampleOptions,
    ) -> Result<f64, EvaluateError> {
        let cell = self.sampled_cell(index, wi, options)?;
        let Some((_, wo)) = self.outgoing(wi, Some(wo))? else { return Ok(0.0) };
        Ok(trees.warps.pdf(cell, wo, &options))
    }

    fn invert_by(
        &self,
        trees: &Trees,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: SampleOptions,
    ) -> Result<Option<[f64; 2]>, EvaluateError> {
        let cell = self.sampled_cell(index, wi, options)?;
        let Some((_, wo)) = self.outgoing(wi, Some(wo))? else { return Ok(None) };
        Ok(trees.warps.invert(cell, wo, &options))
    }

    /// The cell of `index` and `wi`, after a look at the options.
    fn sampled_cell(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        options: SampleOptions,
    ) -> Result<usize, EvaluateError> {
        if !(0.0..1.0).contains(&options.defensive) {
            return unfit(format!("a defensive part of {}, expected 0 or more and less than 1", options.defensive));
        }
        Ok(self.entry(index)? * self.shape[0] + self.incoming_entry(wi)?)
    }

    fn mean_trees(&self) -> Result<&Trees, EvaluateError> {
        self.trees.as_ref().map_or_else(|| self.nothing_to_sample(), Ok)
    }

    fn nothing_to_sample<T>(&self) -> Result<T, EvaluateError> {
        unfit(format!("this {} has no outgoing axis to sample", self.measurement.quantity))
    }
}

/// The mean of the samples that are not masked; NaN where all are.
fn mean(spectrum: &[f32]) -> f64 {
    let (sum, count) = spectrum
        .iter()
        .filter(|sample| !sample.is_nan())
        .fold((0.0, 0_usize), |(sum, count), &sample| (sum + f64::from(sample), count + 1));
    sum / count as f64
}
