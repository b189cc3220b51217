//! Importance sampling of a material's outgoing directions (\[CPB06\] section 6.1.2, with a mixture of trees for one).
//!
//! What is drawn from is told in [`super::mixture`], how a tree draws and what is continuous in [`super::warp`]. A linear
//! density goes with the smooth form, a uniform one with the piecewise constant form. With a defensive part, which is the
//! default, the density is positive wherever the function is: without one by choice, light may be left out that no tree
//! expects. Nothing is drawn where the function is masked.

use super::batch::Pairs;
use super::incoming::{Around, Nodes};
use super::kernel::BLOCK;
use super::lookup::MeshLookup;
use super::material::{Form, turned};
use super::mixture::Mixture;
use super::smooth::Smooth;
use super::staged::Room;
use super::trees::Trees;
use super::warp::{Density, SampleOptions};
use super::{DirectionSample, EvaluateError, Interpolation, Material, Place, unfit};
use crate::domain::{Direction, wide};
use std::sync::Arc;

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
    /// The density in sr⁻¹ with which [`Material::sample`] with the same options draws `wo`; 0 outside the outgoing domain,
    /// where the function is masked, and where nothing is emitted or reflected.
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
    /// or reflected, and for the few points whose direction is masked. `options` may be given as an end level alone.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        self.sample_by(self.mean_trees()?, index, wi, u, options.into())
    }

    /// The direction and density of [`Material::sample`] alone, for callers who evaluate f themselves; `None` where nothing
    /// is drawn.
    #[inline]
    pub fn draw(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<(Direction, f64)>, EvaluateError> {
        let drawn = self.draw_by(self.mean_trees()?, index, wi, u, options.into())?;
        Ok(drawn.map(|drawn| (drawn.direction, drawn.pdf)))
    }

    /// [`Material::pdf`] at `pairs` into `out`, on the calling thread; no allocation. The first pair that is refused ends it.
    pub fn pdfs(
        &self,
        pairs: Pairs<'_>,
        options: impl Into<SampleOptions>,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let options = options.into();
        let count = pairs.check(out.len(), 1)?;
        let trees = self.mean_trees()?;
        let entry = self.sampled_entry(pairs.index, options)?;
        let (Some(wo), true) = (pairs.wo, self.is_staged(trees, options)) else {
            return out.iter_mut().enumerate().try_for_each(|(i, out)| {
                let Place { index, wi, wo } = pairs.place(i)?;
                let Some(wo) = wo else { return self.outgoing(wi, wo).map(|_| ()) };
                *out = self.pdf_by(trees, index, wi, wo, options)? as f32;
                Ok(())
            });
        };
        let mut room = Room::NEW;
        for (start, out) in (0..count).step_by(BLOCK).zip(out.chunks_mut(BLOCK)) {
            let part = pairs.part(start, start + out.len());
            self.arrive_for(trees, entry, part.wi, options, out.len(), &mut room)?;
            self.densities_at(trees, wo.part(start, start + out.len()), options, &mut room, out)?;
            if trees.has_masked() {
                for (i, out) in out.iter_mut().enumerate().filter(|(_, pdf)| **pdf > 0.0) {
                    if !self.is_known(part.place(i)?, form_of(options))? {
                        *out = 0.0;
                    }
                }
            }
        }
        Ok(())
    }

    /// A point of the unit square that [`Material::sample`] with the same options takes to `wo`; `None` where its density is 0.
    /// Trees of several incoming nodes may draw one direction, and the defensive part any: the point is the first tree's that
    /// does, and the defensive part's where none does.
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
        let lookup = self.sampled_lookup()?;
        let Some(grid) = self.grid() else {
            return unfit(format!("a wavelength was given, but this {} has none", self.quantity()));
        };
        let Some((below, t)) = grid.locate(wavelength) else {
            return unfit(format!("{wavelength} nm is outside the measured wavelengths"));
        };
        let mut weights = vec![0.0; self.lambdas()];
        weights[below] = (1.0 - t) as f32;
        if t > 0.0 {
            weights[below + 1] = t as f32;
        }
        let trees = self.mean_trees()?.by(self, lookup, &weights);
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
        let Some(Draw { direction, pdf, .. }) = self.draw_by(trees, index, wi, u, options)? else { return Ok(None) };
        let place = Place { index, wi, wo: Some(direction) };
        let value = f64::from(self.weighted_known(place, form_of(options), trees.weights())?).max(0.0);
        let cosine = if self.quantity().has_cosine() { direction.cos_theta().abs() } else { 1.0 };
        Ok(Some(DirectionSample { direction, pdf, weight: value * cosine / pdf }))
    }

    /// A direction drawn by the mean over wavelengths, its density, and what `value` makes of where the function is taken: the
    /// place, the form, the entry of the incoming axis, and the cell where that is known.
    #[inline(always)]
    pub(super) fn drawn_with<T>(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
        value: impl FnOnce(Place<'_>, Interpolation, Option<usize>, Option<usize>) -> Result<T, EvaluateError>,
    ) -> Result<Option<(Direction, f64, T)>, EvaluateError> {
        let Some(drawn) = self.draw_by(self.mean_trees()?, index, wi, u, options)? else { return Ok(None) };
        let place = Place { index, wi, wo: Some(drawn.direction) };
        let value = value(place, form_of(options), drawn.incoming, drawn.cell)?;
        Ok(Some((drawn.direction, drawn.pdf, value)))
    }

    #[inline(always)]
    fn draw_by(
        &self,
        trees: &Trees,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<Draw>, EvaluateError> {
        let mixture = Mixture::new(self, trees, index, wi, options, trees.carry(options.density))?;
        check_point(u)?;
        let Some((wo, leaf)) = mixture.draw(u) else { return Ok(None) };
        let pdf = mixture.density(wo);
        // The last corner of a triangle, of no measure, may have no density.
        if pdf <= 0.0 {
            return Ok(None);
        }
        let direction = self.turned_with(wi, wo);
        if trees.has_masked() && !self.is_known(Place { index, wi, wo: Some(direction) }, form_of(options))? {
            return Ok(None);
        }
        let cell = leaf.filter(|_| options.density == Density::Uniform).map(|leaf| mixture.cell(leaf));
        Ok(Some(Draw { direction, pdf, incoming: mixture.incoming(), cell }))
    }

    #[inline]
    fn pdf_by(
        &self,
        trees: &Trees,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: SampleOptions,
    ) -> Result<f64, EvaluateError> {
        let pdf = wide(
            #[inline(always)]
            || -> Result<f64, EvaluateError> {
                let mixture = Mixture::new(self, trees, index, wi, options, trees.carry(options.density))?;
                let Some((lookup, wo)) = self.outgoing(wi, Some(wo))? else { return Ok(0.0) };
                Ok(if lookup.holds(wo.xyz()) { mixture.density(wo) } else { 0.0 })
            },
        )?;
        let is_drawn =
            pdf > 0.0 && (!trees.has_masked() || self.is_known(Place { index, wi, wo: Some(wo) }, form_of(options))?);
        Ok(if is_drawn { pdf } else { 0.0 })
    }

    fn invert_by(
        &self,
        trees: &Trees,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: SampleOptions,
    ) -> Result<Option<[f64; 2]>, EvaluateError> {
        if self.pdf_by(trees, index, wi, wo, options)? <= 0.0 {
            return Ok(None);
        }
        let mixture = Mixture::new(self, trees, index, wi, options, trees.carry(options.density))?;
        let Some((_, wo)) = self.outgoing(wi, Some(wo))? else { return Ok(None) };
        Ok(mixture.invert(wo))
    }

    /// The entry of the opaque axes, after a look at the options.
    #[inline]
    pub(super) fn sampled_entry(&self, index: &[usize], options: SampleOptions) -> Result<usize, EvaluateError> {
        if !(0.0..1.0).contains(&options.defensive) {
            return unfit(format!("a defensive part of {}, expected 0 or more and less than 1", options.defensive));
        }
        self.entry(index)
    }

    /// The trees by the mean over wavelengths, built when they are first asked for.
    #[inline]
    pub(super) fn mean_trees(&self) -> Result<&Trees, EvaluateError> {
        let lookup = self.sampled_lookup()?;
        Ok(self.trees.get_or_init(|| Trees::of_mean(self, lookup)))
    }

    fn sampled_lookup(&self) -> Result<&Arc<MeshLookup>, EvaluateError> {
        match &self.outgoing {
            Some(lookup) => Ok(lookup),
            None => unfit(format!("this {} has no outgoing axis to sample", self.quantity())),
        }
    }

    /// `wo` turned to the azimuth of `wi` where data are isotropic.
    #[inline]
    pub(super) fn turned_with(&self, wi: Option<Direction>, wo: Direction) -> Direction {
        if !self.is_isotropic() {
            return wo;
        }
        turned(wo, self.azimuth(wi))
    }

    /// The nodes around an incoming direction, and the direction as they know it; the entry that holds it may be known.
    #[inline(always)]
    pub(super) fn around(
        &self,
        smooth: &Smooth,
        incoming: Option<usize>,
        wi: Option<Direction>,
    ) -> Result<(Around, [f64; 3]), EvaluateError> {
        if wi.is_some() != self.has_incoming() {
            return self.refuse_incoming(wi);
        }
        let plane = self.wi_in_plane(wi);
        let around =
            incoming.map_or_else(|| smooth.nodes.around(plane), |incoming| smooth.nodes.around_in(incoming, plane));
        match around.filter(|_| !(self.is_isotropic() && plane[2] < 0.0)) {
            Some(around) => Ok((around, plane)),
            None => self.refuse_incoming(wi),
        }
    }

    /// The incoming direction whose function a node holds.
    #[inline(always)]
    pub(super) fn node_direction(&self, node: usize) -> [f64; 3] {
        match &self.form {
            Form::Planes { smooth, .. } => smooth.nodes.direction(node),
            Form::Samples { .. } => self.incoming_directions[node],
        }
    }

    /// Whether the first of the nodes around an incoming direction is the entry that holds it.
    #[inline]
    pub(super) fn knows_entry(smooth: &Smooth) -> bool {
        matches!(smooth.nodes, Nodes::Triangles(_))
    }
}

/// A direction that was drawn, its density, and what is known of where the function is taken: the entry of the incoming axis
/// and the cell.
struct Draw {
    direction: Direction,
    pdf: f64,
    incoming: Option<usize>,
    cell: Option<usize>,
}

/// The form of the function that goes with a density.
fn form_of(options: SampleOptions) -> Interpolation {
    match options.density {
        Density::Uniform => Interpolation::Constant,
        Density::Linear => Interpolation::Smooth,
    }
}

pub(super) fn check_point(u: [f64; 2]) -> Result<(), EvaluateError> {
    if u.iter().all(|u| (0.0..=1.0).contains(u)) {
        return Ok(());
    }
    unfit(format!("u = [{}, {}], expected a point of the unit square", u[0], u[1]))
}
