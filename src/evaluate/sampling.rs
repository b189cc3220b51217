//! Importance sampling of a material's outgoing directions: one warp for every incoming cell (\[CPB06\] section 6.1.2).
//!
//! A leaf weighs max(0, value) × the integral of |cos θ| over it (BRDF, BTDF, BSDF) or × its solid angle (emission, phase
//! functions), the value being the mean over wavelengths or that at one wavelength: linear means, never those of logarithms.
//! What [`super::warp`] does with it, and what is continuous, is told there.
//!
//! An incoming direction takes the warp of its cell. Where lobes move ([`super::Alignment`]), directions drawn with a linear
//! density, which goes with the smooth form, are carried along, and their density with them; a uniform one goes with the
//! piecewise constant form, which does not move within a cell.

use super::batch::Pairs;
use super::carried::{Carried, Way};
use super::incoming::Alignment;
use super::kernel::BLOCK;
use super::located::OUTSIDE;
use super::lookup::MeshLookup;
use super::material::{Form, turned};
use super::staged::Room;
use super::warp::{BELOW_ONE, Density, Measure, SampleOptions, WarpMesh, Warps};
use super::{DirectionSample, EvaluateError, Interpolation, Material, Place, unfit};
use crate::domain::vector::unit;
use crate::domain::{Direction, Domain, wide};
use std::sync::Arc;

/// The warps of all incoming cells.
#[derive(Debug)]
pub(super) struct Trees {
    pub(super) warps: Warps,
    has_cosine: bool,
    /// What the value is made of: a weight for each sample of a spectrum.
    weights: Vec<f32>,
}

impl Trees {
    /// By the inner product of spectra with `weights`: of cells for the leaves, of the smooth function at vertices.
    pub(super) fn new(material: &Material, lookup: &Arc<MeshLookup>, weights: &[f32]) -> Self {
        let measure = if material.quantity().has_cosine() { Measure::Projected } else { Measure::SolidAngle };
        Self::on(&Arc::new(WarpMesh::over(Arc::clone(lookup), measure)), material, weights)
    }

    fn on(shared: &Arc<WarpMesh>, material: &Material, weights: &[f32]) -> Self {
        let (mesh, has_cosine) = (shared.mesh(), material.quantity().has_cosine());
        let cells = material.cells() / mesh.len();
        let warps = Warps::new(Arc::clone(shared), cells, |cell, integrals, values| {
            for (leaf, integral) in integrals.iter_mut().enumerate() {
                let value = f64::from(material.cell_value(cell * mesh.len() + leaf, weights));
                *integral = value.max(0.0) * shared.measures()[leaf];
            }
            for ((vertex, to), point) in values.iter_mut().enumerate().zip(shared.vertices()) {
                let value = f64::from(material.vertex_value(cell, vertex as u32, point.xyz(), weights)).max(0.0);
                *to = if has_cosine { value * point.cos_theta().abs() } else { value };
            }
        });
        Self { warps, has_cosine, weights: weights.to_vec() }
    }

    /// The part of a cell's directions that its tree draws, and the options without the other part.
    fn without_defence(&self, cell: usize, options: SampleOptions) -> (f64, SampleOptions) {
        let by_tree = if self.warps.total(cell) > 0.0 { 1.0 - options.defensive } else { 0.0 };
        (by_tree, SampleOptions { defensive: 0.0, ..options })
    }

    pub(super) fn memory(&self) -> usize {
        self.warps.memory() + self.warps.mesh().memory() + size_of_val(&*self.weights)
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
        self.draw_by(self.mean_trees()?, index, wi, u, options.into())
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
        if !self.is_staged(options) {
            return out.iter_mut().enumerate().try_for_each(|(i, out)| {
                let Place { index, wi, wo } = pairs.place(i)?;
                let Some(wo) = wo else { return self.outgoing(wi, wo).map(|_| ()) };
                *out = self.pdf_by(trees, index, wi, wo, options)? as f32;
                Ok(())
            });
        }
        if let (Density::Linear, Some(wo)) = (options.density, pairs.wo) {
            let mut room = Room::NEW;
            return (0..count).step_by(BLOCK).zip(out.chunks_mut(BLOCK)).try_for_each(|(start, out)| {
                let end = start + out.len();
                self.arrive(entry, pairs.wi.map(|wi| wi.part(start, end)), out.len(), &mut room.arrived)?;
                self.linear_densities(&trees.warps, wo.part(start, end), &mut room, out)
            });
        }
        let (mut incoming, mut outgoing) = ([0; BLOCK], [0; BLOCK]);
        for (start, out) in (0..count).step_by(BLOCK).zip(out.chunks_mut(BLOCK)) {
            let part = pairs.part(start, start + out.len());
            let (incoming, outgoing) = (&mut incoming[..out.len()], &mut outgoing[..out.len()]);
            self.incoming_entries(part, incoming)?;
            self.outgoing_entries(part, outgoing)?;
            for (i, ((out, &wi), &wo)) in out.iter_mut().zip(&*incoming).zip(&*outgoing).enumerate() {
                let cell = entry * self.shape[0] + wi as usize;
                *out = match part.wo {
                    Some(directions) if wo != OUTSIDE => {
                        trees.warps.uniform_density(cell, wo as usize, directions.at(i)?.xyz()) as f32
                    }
                    _ => 0.0,
                };
            }
        }
        Ok(())
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
        let shared = self.mean_trees()?.warps.mesh();
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
        let trees = Trees::on(shared, self, &weights);
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
        let Some((direction, pdf)) = self.draw_by(trees, index, wi, u, options)? else { return Ok(None) };
        let how = match options.density {
            Density::Uniform => Interpolation::Constant,
            Density::Linear => Interpolation::Smooth,
        };
        let value =
            f64::from(self.weighted_known(Place { index, wi, wo: Some(direction) }, how, &trees.weights)?).max(0.0);
        let cosine = if trees.has_cosine { direction.cos_theta().abs() } else { 1.0 };
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
        value: impl FnOnce(Place<'_>, Interpolation, usize, Option<usize>) -> Result<T, EvaluateError>,
    ) -> Result<Option<(Direction, f64, T)>, EvaluateError> {
        let trees = self.mean_trees()?;
        let cell = self.sampled_cell(index, wi, options)?;
        check_point(u)?;
        let incoming = cell % self.shape[0];
        if options.density == Density::Linear {
            let Some((wo, pdf)) = self.draw_from(trees, cell, wi, u, options) else { return Ok(None) };
            let value = value(Place { index, wi, wo: Some(wo) }, Interpolation::Smooth, incoming, None)?;
            return Ok(Some((wo, pdf, value)));
        }
        let Some(drawn) = trees.warps.sample(cell, u, &options).filter(|drawn| drawn.pdf > 0.0) else {
            return Ok(None);
        };
        let mut wo = drawn.direction;
        if self.is_isotropic() {
            let [cos, sin] = self.azimuth(wi);
            wo = turned(wo, cos, sin);
        }
        let cell = cell * self.shape[1] + drawn.leaf;
        let value = value(Place { index, wi, wo: Some(wo) }, Interpolation::Constant, incoming, Some(cell))?;
        Ok(Some((wo, drawn.pdf, value)))
    }

    /// A direction and its density.
    #[inline]
    fn draw_by(
        &self,
        trees: &Trees,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<(Direction, f64)>, EvaluateError> {
        let cell = self.sampled_cell(index, wi, options)?;
        check_point(u)?;
        Ok(self.draw_from(trees, cell, wi, u, options))
    }

    /// The same from a known cell.
    #[inline]
    fn draw_from(
        &self,
        trees: &Trees,
        cell: usize,
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Option<(Direction, f64)> {
        let [cos, sin] = self.azimuth(wi);
        let Some(carried) = self.carried_to(cell, wi, options.density) else {
            let drawn = trees.warps.sample(cell, u, &options);
            return drawn.map(|drawn| (turned(drawn.direction, cos, sin), drawn.pdf)).filter(is_drawn);
        };
        let (by_tree, own) = trees.without_defence(cell, options);
        if options.defensive > 0.0 && u[0] >= by_tree {
            let u = [((u[0] - by_tree) / (1.0 - by_tree)).min(BELOW_ONE), u[1]];
            let direction = trees.warps.draw_background(u);
            let pdf = Self::carried_pdf(trees, cell, &carried, direction, options);
            return (pdf > 0.0).then(|| (turned(direction, cos, sin), pdf));
        }
        let drawn = trees.warps.sample(cell, [(u[0] / by_tree).min(1.0), u[1]], &own);
        drawn
            .map(|drawn| {
                let (wo, density, way) = carried.out(drawn.direction.xyz(), drawn.pdf);
                let tree = density + carried.density(wo, Some(way), |there| trees.warps.pdf(cell, there, &own));
                let direction = Direction::from_unit(unit(wo));
                let background = if by_tree < 1.0 { trees.warps.background(direction) } else { 0.0 };
                (turned(direction, cos, sin), by_tree * tree + (1.0 - by_tree) * background)
            })
            .filter(is_drawn)
    }

    /// The density at `wo` where directions are carried.
    fn carried_pdf(trees: &Trees, cell: usize, carried: &Carried, wo: Direction, options: SampleOptions) -> f64 {
        let (by_tree, own) = trees.without_defence(cell, options);
        let tree = carried.density(wo.xyz(), None, |there| trees.warps.pdf(cell, there, &own));
        let background = if by_tree < 1.0 && options.defensive > 0.0 { trees.warps.background(wo) } else { 0.0 };
        by_tree * tree + (1.0 - by_tree) * background
    }

    /// How the directions of `cell` are carried to `wi`; `None` where they stay.
    #[inline]
    fn carried_to(&self, cell: usize, wi: Option<Direction>, density: Density) -> Option<Carried> {
        // The piecewise constant function is the same for the whole incoming cell.
        if density == Density::Uniform {
            return None;
        }
        let (alignment, side) = self.carries()?;
        let from = self.incoming_directions[cell % self.shape[0]];
        let to = self.wi_in_plane(wi);
        Some(Carried::new(alignment, side, from, to))
    }

    /// How directions drawn with a linear density are carried, and the sign of z on the outgoing hemisphere, 0 on the sphere;
    /// `None` where they stay.
    pub(super) fn carries(&self) -> Option<(Alignment, f64)> {
        let Form::Planes { smooth, .. } = &self.form else { return None };
        let domain = self.outgoing.as_ref()?.mesh().domain();
        let both = domain == Domain::Sphere && smooth.alignment != Alignment::Rotation;
        let side = match domain {
            Domain::Hemisphere => 1.0,
            Domain::Lower => -1.0,
            Domain::Sphere => 0.0,
        };
        (smooth.alignment != Alignment::None && !both).then_some((smooth.alignment, side))
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
        wide(
            #[inline(always)]
            || {
                let cell = self.sampled_cell(index, wi, options)?;
                let Some((lookup, wo)) = self.outgoing(wi, Some(wo))? else { return Ok(0.0) };
                Ok(match self.carried_to(cell, wi, options.density) {
                    Some(carried) if lookup.holds(wo.xyz()) => Self::carried_pdf(trees, cell, &carried, wo, options),
                    Some(_) => 0.0,
                    None => trees.warps.pdf(cell, wo, &options),
                })
            },
        )
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
        let Some((_, wo)) = self.outgoing(wi, Some(wo))?.filter(|(lookup, wo)| lookup.holds(wo.xyz())) else {
            return Ok(None);
        };
        let Some(carried) = self.carried_to(cell, wi, options.density) else {
            return Ok(trees.warps.invert(cell, wo, &options));
        };
        let (by_tree, own) = trees.without_defence(cell, options);
        // The first of the directions that are carried here and drawn at all.
        let origins = Way::ALL.into_iter().filter_map(|way| carried.origin(way, wo.xyz()));
        let mut drawn =
            origins.filter_map(|(there, _)| trees.warps.invert(cell, Direction::from_unit(unit(there)), &own));
        if let Some([u, v]) = drawn.next() {
            return Ok(Some([u * by_tree, v]));
        }
        let [u, v] = trees.warps.place_background(wo);
        Ok((options.defensive > 0.0).then_some([by_tree + u * (1.0 - by_tree), v]))
    }

    /// The cell of `index` and `wi`, after a look at the options.
    #[inline(always)]
    fn sampled_cell(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        options: SampleOptions,
    ) -> Result<usize, EvaluateError> {
        Ok(self.sampled_entry(index, options)? * self.shape[0] + self.incoming_entry(wi)?)
    }

    /// The entry of the opaque axes, after a look at the options.
    pub(super) fn sampled_entry(&self, index: &[usize], options: SampleOptions) -> Result<usize, EvaluateError> {
        if !(0.0..1.0).contains(&options.defensive) {
            return unfit(format!("a defensive part of {}, expected 0 or more and less than 1", options.defensive));
        }
        self.entry(index)
    }

    pub(super) fn mean_trees(&self) -> Result<&Trees, EvaluateError> {
        self.trees.as_ref().map_or_else(|| self.nothing_to_sample(), Ok)
    }

    fn nothing_to_sample<T>(&self) -> Result<T, EvaluateError> {
        unfit(format!("this {} has no outgoing axis to sample", self.quantity()))
    }
}

/// Whether a direction has a density: the last corner of a triangle, of no measure, may have none.
fn is_drawn((_, pdf): &(Direction, f64)) -> bool {
    *pdf > 0.0
}

pub(super) fn check_point(u: [f64; 2]) -> Result<(), EvaluateError> {
    if u.iter().all(|u| (0.0..=1.0).contains(u)) {
        return Ok(());
    }
    unfit(format!("u = [{}, {}], expected a point of the unit square", u[0], u[1]))
}
