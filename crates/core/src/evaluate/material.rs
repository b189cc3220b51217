//! An opened material: its function, its sampling trees and its report.

use super::albedo::{Albedos, Side};
use super::carrying::trees_of_mean;
use super::directions::{Directions, Pairs};
use super::error::{Argument, EvaluateError, Need, QueryError, unfit};
use super::form::{Course, Form};
use super::function::Function;
use super::geometry::Geometry;
use super::incoming::Alignment;
use super::lobed::Lobed;
use super::lookup::MeshLookup;
use super::place::{Beyond, Interpolation, Place};
use super::planes::Planes;
use super::report::OpenedReport;
use super::sampler::{DirectionSample, Sampler};
use super::smooth::Smooth;
use super::stated::{Stated, as_drawn};
use super::trees::Trees;
use super::turning::Turning;
use super::warp::SampleOptions;
use super::wavelength_sampler::WavelengthSampler;
use crate::compress::{self, Between, Decoded, LevelInfo, Summary, lobe_fits};
use crate::domain::{Axis, Direction, Layout, Lobe, Measurement, Quantity, Tensor, Unit, WavelengthGrid};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// Opened material; share it between threads by reference.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use wavelume_core::domain::Direction;
/// use wavelume_core::evaluate::{Interpolation, Place};
/// let material = wavelume_core::open_bytes(include_bytes!("../../examples/materials/plastic.wlm"))?;
/// let (wi, wo) = (Direction::from_degrees(30.0, 0.0), Direction::from_degrees(45.0, 180.0));
/// let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
/// let mut spectrum = vec![0.0; material.lambdas()];
/// material.evaluate(place, Interpolation::Smooth, &mut spectrum)?;
/// assert_eq!(spectrum, material.bsdf()?.eval(wi, wo));
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Material {
    body: Body,
    summary: Option<Summary>,
}

/// Function built from the samples.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "a query of cells goes through one pointer less, and materials are few")]
enum Body {
    /// Samples of cells of directions, or without directions.
    Cells(Cells),
    /// Samples on a grid of angles.
    Grid {
        stated: Box<Stated>,
        /// Averages over triangles, built on first use.
        cells: OnceLock<Result<Box<Material>, EvaluateError>>,
    },
}

/// Function of cells, and the data derived from it.
#[derive(Debug)]
struct Cells {
    function: Function,
    /// Sampling trees, built when a first direction is drawn.
    trees: OnceLock<Trees>,
    /// Albedos; empty without an outgoing axis.
    albedos: Albedos,
    /// Lobe that is added to the function.
    lobe: Option<Box<Lobed>>,
}

impl Material {
    /// Opens a compressed material from the bytes of its file, read or memory-mapped.
    pub fn open(bytes: &[u8]) -> Result<Self, EvaluateError> {
        Self::decoded(compress::decode(bytes)?)
    }

    /// Opens a level of a compressed material. `bytes` is the whole file, or as long a prefix as [`compress::levels`]
    /// states for the level.
    pub fn open_level(bytes: &[u8], level: u8) -> Result<Self, EvaluateError> {
        Self::decoded(compress::decode_level(bytes, level)?)
    }

    /// Levels that [`Material::open_level`] can open.
    pub fn levels(bytes: &[u8]) -> Result<Vec<LevelInfo>, EvaluateError> {
        Ok(compress::levels(bytes)?)
    }

    /// Opens a measurement and selects the best alignment between incoming directions.
    pub fn of(measurement: Measurement) -> Result<Self, EvaluateError> {
        Self::on_course(measurement, Course::default())
    }

    /// Opens a measurement with a given alignment between incoming directions.
    pub fn with_alignment(measurement: Measurement, alignment: Alignment) -> Result<Self, EvaluateError> {
        Self::on_course(measurement, Course { alignment: Some(alignment), ..Course::default() })
    }

    /// Opens a measurement with a given interpolation between incidences. If that does not fit the measurement, the
    /// result is that of [`Material::of`].
    pub fn with_between(measurement: Measurement, between: Between) -> Result<Self, EvaluateError> {
        Self::on_course(measurement, Course { between, ..Course::default() })
    }

    fn on_course(measurement: Measurement, mut course: Course) -> Result<Self, EvaluateError> {
        if !course.between.fits(measurement.quantity, measurement.tensor.axes()) {
            course.between = Between::default();
        }
        let geometry = Geometry::new(&measurement)?;
        let body = if geometry.is_grid() {
            let stated = Box::new(Stated::new(&measurement, geometry, course));
            Body::Grid { stated, cells: OnceLock::new() }
        } else {
            let albedos = Albedos::new(&measurement, &geometry);
            let function = Function::new(measurement, geometry, course);
            Body::Cells(Cells { function, trees: OnceLock::new(), albedos, lobe: None })
        };
        Ok(Self { body, summary: None })
    }

    /// Sets the fraction, 0 to 1, of linear interpolation between stated samples in the smooth form. The default is
    /// that of the file, 0 for a measurement. 1 is what most readers of luminaires and of MDL's measured materials
    /// draw. Samples of cells, which are not stated at directions, are unaffected.
    #[must_use]
    pub fn with_straight_lines(self, share: f32) -> Self {
        match self.body {
            Body::Cells(_) => self,
            Body::Grid { stated, .. } => {
                let stated = Box::new(stated.with_straight(share.clamp(0.0, 1.0)));
                Self { body: Body::Grid { stated, cells: OnceLock::new() }, summary: self.summary }
            }
        }
    }

    /// Adds a lobe to the cells: evaluation gives the sum of both. Samples on a grid of angles are unaffected. So are
    /// cells for which [`Settings::lobe`](crate::compress::Settings::lobe) fails.
    #[must_use]
    pub fn with_lobe(mut self, lobe: Lobe) -> Self {
        let is_fit = lobe_fits(&lobe, self.quantity(), self.axes());
        if let (Body::Cells(cells), true) = (&mut self.body, is_fit) {
            cells.take(Lobed::new(lobe));
        }
        self
    }

    /// Returns this material if its samples are those of cells. For samples on a grid of angles, returns their averages
    /// over triangles, the basis of sampling and integration. They are built on first use.
    #[doc(hidden)]
    pub fn over_triangles(&self) -> Result<&Self, EvaluateError> {
        match &self.body {
            Body::Cells(_) => Ok(self),
            Body::Grid { stated, cells } => {
                let made = cells.get_or_init(|| {
                    let (alignment, between) = (Some(stated.lines().alignment()), stated.lines().between());
                    Self::on_course(stated.cell_averages()?, Course { alignment, between }).map(Box::new)
                });
                made.as_deref().map_err(Clone::clone)
            }
        }
    }

    /// Function between samples on a grid of angles; `None` for samples of cells.
    pub(super) fn stated(&self) -> Option<&Stated> {
        if let Body::Grid { stated, .. } = &self.body { Some(stated) } else { None }
    }

    fn cells(&self) -> Option<&Cells> {
        if let Body::Cells(cells) = &self.body { Some(cells) } else { None }
    }

    /// Opens a decoded file, with its header.
    pub fn decoded(Decoded { measurement, summary }: Decoded) -> Result<Self, EvaluateError> {
        let mut material = Self::with_between(measurement, summary.between)?;
        if let Some(lobe) = &summary.lobe {
            material = material.with_lobe(lobe.clone());
        }
        let material = match summary.straight_lines {
            Some(share) if share > 0.0 => material.with_straight_lines(share as f32),
            _ => material,
        };
        Ok(Self { summary: Some(summary), ..material })
    }

    /// Measured quantity.
    pub fn quantity(&self) -> Quantity {
        self.geometry().quantity()
    }

    /// Unit of a value.
    pub fn unit(&self) -> Unit {
        self.geometry().unit()
    }

    /// Axes of the samples.
    pub fn axes(&self) -> &[Axis] {
        self.geometry().axes()
    }

    /// Roles of the axes.
    pub fn layout(&self) -> &Layout {
        self.geometry().layout()
    }

    /// Header of the compressed material; `None` if it was opened from a measurement.
    pub fn summary(&self) -> Option<&Summary> {
        self.summary.as_ref()
    }

    /// Number of samples in one spectrum: 1 for monochromatic data, 3 for RGB.
    #[inline]
    pub fn lambdas(&self) -> usize {
        self.geometry().lambdas()
    }

    /// Wavelengths in nm; `None` for RGB and monochromatic data.
    pub fn wavelengths(&self) -> Option<Vec<f64>> {
        self.geometry().grid().map(WavelengthGrid::values)
    }

    /// Returns true if an incoming direction lies past the last measured elevation. Values there are extrapolated from
    /// that elevation.
    pub fn is_extrapolated(&self, wi: Option<Direction>) -> bool {
        wi.is_some_and(|wi| self.geometry().is_past_last(wi))
    }

    /// Reports on the opened form.
    pub fn report(&self) -> OpenedReport {
        match &self.body {
            Body::Cells(cells) => OpenedReport::of(cells.function.form(), self.memory()),
            Body::Grid { stated, .. } => OpenedReport::of_lines(stated.lines(), self.memory()),
        }
    }

    /// Memory of the opened form in bytes: planes or samples, smooth tables, tables of the meshes, albedo and sampling
    /// trees. Trees that are not built yet count with their expected size.
    pub fn memory(&self) -> usize {
        let body = match &self.body {
            Body::Cells(cells) => cells.memory(),
            Body::Grid { stated, cells } => {
                let cells = cells.get().and_then(|cells| cells.as_ref().ok()).map_or(0, |cells| cells.memory());
                size_of::<Stated>() + stated.memory() + cells
            }
        };
        size_of::<Self>() + body
    }

    /// Row-major position of `index` among the entries of the index axes.
    pub fn entry(&self, index: &[usize]) -> Result<usize, EvaluateError> {
        self.geometry().entry(index)
    }

    /// Inverse of [`Material::entry`]: index on each index axis.
    pub fn index_of(&self, entry: usize) -> Vec<usize> {
        self.geometry().index_of(entry)
    }

    /// Writes the whole spectrum at `place` into `out` (`lambdas()` long), in the measurement's unit, without a cosine.
    /// NaN is masked; values are 0 if `wo` is outside the outgoing domain.
    #[inline]
    pub fn evaluate(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.spectrum(place, how, out),
            Body::Grid { stated, .. } => stated.spectrum(place, how, out),
        }
    }

    /// Writes the values at `wavelengths` in nm into `out`, which has the same length. Values are linear between the
    /// samples of the spectrum at `place`; outside the measured range `beyond` applies. A value is NaN (masked) if one
    /// of its two samples is. Fails for RGB and monochromatic data, which have no wavelengths.
    #[inline]
    pub fn at_wavelengths(
        &self,
        place: Place<'_>,
        how: Interpolation,
        beyond: Beyond,
        wavelengths: &[f64],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.at_wavelengths(place, how, beyond, wavelengths, out),
            Body::Grid { stated, .. } => stated.at_wavelengths(place, how, beyond, wavelengths, out),
        }
    }

    /// Inner product of the spectrum at `place` with `weights`, one for each sample: a luminance or another colour
    /// coordinate, power in a band, a mean. NaN if a sample with a nonzero weight is masked.
    pub fn weighted(&self, place: Place<'_>, how: Interpolation, weights: &[f32]) -> Result<f32, EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.weighted(place, how, weights),
            Body::Grid { stated, .. } => stated.weighted(place, how, weights),
        }
    }

    /// Piecewise constant samples `[outgoing, lambda]` of entry `slice` (row-major) of the axes before the outgoing
    /// one. A table without directions gives one spectrum. NaN is masked.
    ///
    /// # Panics
    /// If there is no such entry.
    pub fn slice(&self, slice: usize) -> Vec<f32> {
        match &self.body {
            Body::Cells(cells) => cells.slice(slice),
            Body::Grid { stated, .. } => stated.slice(slice),
        }
    }

    /// Samples as opened: the decoded ones, up to the deviation that [`Material::report`] states.
    pub fn measurement(&self) -> Result<Measurement, EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.measurement(),
            Body::Grid { stated, .. } => stated.measurement(),
        }
    }

    /// Writes the spectra at `pairs` into `out`, `[pair][lambda]`, on the calling thread. Does not allocate. Stops at
    /// the first refused pair. Agrees with [`Material::evaluate`] within the tolerance that the [rules](super#rules)
    /// give for batches.
    pub fn spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.spectra(pairs, how, out),
            Body::Grid { stated, .. } => stated.spectra(pairs, how, out),
        }
    }

    /// Runs [`Material::spectra`] on all threads.
    pub fn par_spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.par_spectra(pairs, how, out),
            Body::Grid { stated, .. } => stated.par_spectra(pairs, how, out),
        }
    }

    /// Density in sr⁻¹ with which [`Material::sample`] draws `wo` for the same options. It is 0 outside the outgoing
    /// domain, where the function is masked, and where there is no light.
    pub fn pdf(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: impl Into<SampleOptions>,
    ) -> Result<f64, EvaluateError> {
        if self.stated().is_none() {
            return self.sampler()?.pdf(index, wi, wo, options.into());
        }
        let (wi, wo) = as_drawn(self.stated(), wi, wo);
        self.sampler()?.pdf(index, wi, wo, options.into())
    }

    /// Draws an outgoing direction from the point `u` of the unit square, by the mean over wavelengths. `None` if there
    /// is no light, and for the few points whose direction is masked. `options` may be an end level alone.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        let (sampler, options) = (self.sampler()?, options.into());
        match self.stated() {
            None => sampler.sample(index, wi, u, options),
            Some(stated) => sampler.sample_of(stated, index, wi, u, options),
        }
    }

    /// Returns only the direction and density of [`Material::sample`], for callers who evaluate f themselves; `None`
    /// for a failed draw.
    #[inline]
    pub fn draw(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<(Direction, f64)>, EvaluateError> {
        let turning = self.stated().and_then(|stated| stated.turning(wi));
        let Some(turning) = turning else { return self.sampler()?.draw(index, wi, u, options.into()) };
        let drawn = self.sampler()?.draw(index, Some(Turning::up()), u, options.into())?;
        Ok(drawn.map(|(direction, pdf)| (turning.outward(direction), pdf)))
    }

    /// Writes [`Material::pdf`] at `pairs` into `out`, on the calling thread. Does not allocate. Stops at the first
    /// refused pair.
    pub fn pdfs(
        &self,
        pairs: Pairs<'_>,
        options: impl Into<SampleOptions>,
        out: &mut [f64],
    ) -> Result<(), EvaluateError> {
        let (sampler, options) = (self.sampler()?, options.into());
        if !self.stated().is_some_and(Stated::is_scattering) {
            return sampler.pdfs(pairs, options, out);
        }
        pairs.check(out.len(), 1)?;
        for (i, out) in out.iter_mut().enumerate() {
            let place = pairs.place(i)?;
            *out = match place.wo {
                Some(wo) => self.pdf(place.index, place.wi, wo, options)?,
                None => {
                    return unfit(QueryError::MissingDirection { argument: Argument::Wo, quantity: self.quantity() });
                }
            };
        }
        Ok(())
    }

    /// Writes [`Material::sample`] for each incoming direction `wi` and point `u` of the unit square into `out`, on the
    /// calling thread. `wi` has one direction for each point; `None` for quantities without. Does not allocate. Stops
    /// at the first refused point.
    pub fn samples(
        &self,
        index: &[usize],
        wi: Option<Directions<'_>>,
        u: &[[f64; 2]],
        options: impl Into<SampleOptions>,
        out: &mut [Option<DirectionSample>],
    ) -> Result<(), EvaluateError> {
        let (sampler, options, pairs) = (self.sampler()?, options.into(), Pairs { index, wi, wo: None });
        match self.stated() {
            None => sampler.samples(pairs, u, options, out),
            Some(stated) => sampler.samples_of(stated, pairs, u, options, out),
        }
    }

    /// Returns a point of the unit square from which [`Material::sample`] with the same options draws `wo`; `None` if
    /// its density is 0. Trees of several incoming nodes may draw the same direction, and the defensive part any. The
    /// point is that of the first such tree, or of the defensive part if there is none.
    pub fn invert(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: impl Into<SampleOptions>,
    ) -> Result<Option<[f64; 2]>, EvaluateError> {
        let (wi, wo) = as_drawn(self.stated(), wi, wo);
        self.sampler()?.invert(index, wi, wo, options.into())
    }

    /// Builds the sampling trees now rather than in the first query that needs them, for renderers in which no query
    /// may allocate or wait.
    pub fn prepare_sampling(&self) -> Result<(), EvaluateError> {
        self.sampler().map(|_| ())
    }

    /// Builds the trees of one wavelength in nm, linear between the samples of the spectra. Fails outside the measured
    /// range.
    pub fn sampler_at(&self, wavelength: f64) -> Result<WavelengthSampler<'_>, EvaluateError> {
        let (cells, lookup) = self.over_triangles()?.sampled()?;
        let function = (&cells.function, cells.lobe.as_deref());
        WavelengthSampler::at(function, self.stated(), lookup, cells.mean_trees(lookup), wavelength)
    }

    /// Sampler by the mean over wavelengths; its trees are built on first use.
    #[inline]
    pub(super) fn sampler(&self) -> Result<Sampler<'_>, EvaluateError> {
        let (cells, lookup) = self.over_triangles()?.sampled()?;
        let lobe = cells.lobe.as_deref().map(|lobe| (lobe, lobe.mean_colour()));
        Ok(Sampler::new(&cells.function, lobe, cells.mean_trees(lookup)))
    }

    #[inline]
    fn sampled(&self) -> Result<(&Cells, &Arc<MeshLookup>), EvaluateError> {
        match (self.cells(), self.geometry().mesh()) {
            (Some(cells), Some(lookup)) => Ok((cells, lookup)),
            _ => unfit(QueryError::NoOutgoing { need: Need::Sampling, quantity: self.quantity() }),
        }
    }

    /// Function of cells; `None` for samples on a grid of angles.
    #[inline(always)]
    pub(super) fn function(&self) -> Option<&Function> {
        self.cells().map(|cells| &cells.function)
    }

    /// Function, planes and smooth tables; `None` if every sample is kept or there is a lobe.
    #[inline(always)]
    pub(super) fn planes(&self) -> Option<(&Function, &Planes, &Smooth)> {
        if self.cells().is_some_and(|cells| cells.lobe.is_some()) { None } else { self.planes_of_cells() }
    }

    /// Function, planes and smooth tables of the cells without their lobe; `None` if every sample is kept.
    #[inline(always)]
    pub(super) fn planes_of_cells(&self) -> Option<(&Function, &Planes, &Smooth)> {
        let function = self.function()?;
        match function.form() {
            Form::Planes { planes, smooth } => Some((function, planes, smooth)),
            Form::Samples(_) => None,
        }
    }

    #[inline(always)]
    pub(super) fn geometry(&self) -> &Geometry {
        match &self.body {
            Body::Cells(cells) => cells.function.geometry(),
            Body::Grid { stated, .. } => stated.geometry(),
        }
    }

    /// Stored integrals of one side, `[cell, lambda]`, for an incoming direction above or below; `None` if no light can
    /// leave on that side.
    pub(super) fn stored_albedos(&self, side: Side, is_above: bool) -> Option<&[f32]> {
        self.cells()?.albedos.of(side, is_above)
    }
}

impl Cells {
    /// Adds a lobe to the function.
    fn take(&mut self, lobe: Lobed) {
        self.albedos.add(|table| lobe.add_light(self.function.geometry(), table));
        self.lobe = Some(Box::new(lobe));
    }

    #[inline]
    fn spectrum(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        self.function.spectrum(place, how, out)?;
        if let Some(lobe) = &self.lobe {
            lobe.add(place, out);
        }
        Ok(())
    }

    #[inline]
    fn at_wavelengths(
        &self,
        place: Place<'_>,
        how: Interpolation,
        beyond: Beyond,
        wavelengths: &[f64],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        self.function.at_wavelengths(place, how, beyond, wavelengths, out)?;
        if let (Some(lobe), Some(grid)) = (&self.lobe, self.function.geometry().grid()) {
            lobe.add_at(place, (grid, beyond), wavelengths, out);
        }
        Ok(())
    }

    fn weighted(&self, place: Place<'_>, how: Interpolation, weights: &[f32]) -> Result<f32, EvaluateError> {
        let sum = self.function.weighted(place, how, weights)?;
        Ok(self.lobe.as_ref().map_or(sum, |lobe| sum + lobe.weighted(place, weights)))
    }

    fn spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        self.function.spectra(pairs, how, out)?;
        let Some(lobe) = &self.lobe else { return Ok(()) };
        let spectra = out.chunks_exact_mut(self.function.geometry().lambdas().max(1));
        spectra.enumerate().try_for_each(|(i, spectrum)| {
            lobe.add(pairs.place(i)?, spectrum);
            Ok(())
        })
    }

    fn par_spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        self.function.par_spectra(pairs, how, out)?;
        let Some(lobe) = &self.lobe else { return Ok(()) };
        let spectra = out.par_chunks_exact_mut(self.function.geometry().lambdas().max(1));
        spectra.enumerate().try_for_each(|(i, spectrum)| {
            lobe.add(pairs.place(i)?, spectrum);
            Ok(())
        })
    }

    /// Samples of a slice, including the means of the lobe.
    fn slice(&self, slice: usize) -> Vec<f32> {
        let mut samples = self.function.slice(slice);
        if let Some(lobe) = &self.lobe {
            lobe.add_means(self.function.geometry(), slice, &mut samples);
        }
        samples
    }

    /// Samples of cells, including the means of the lobe.
    fn measurement(&self) -> Result<Measurement, EvaluateError> {
        let measurement = self.function.measurement()?;
        let Some(lobe) = &self.lobe else { return Ok(measurement) };
        let geometry = self.function.geometry();
        let [_, outgoing, lambdas] = geometry.shape();
        let axes = measurement.tensor.axes().to_vec();
        let mut samples = measurement.tensor.into_samples();
        for (slice, samples) in samples.chunks_exact_mut(outgoing * lambdas).enumerate() {
            lobe.add_means(geometry, slice, samples);
        }
        Ok(Measurement { tensor: Tensor::new(axes, samples)?, ..measurement })
    }

    #[inline]
    fn mean_trees(&self, lookup: &Arc<MeshLookup>) -> &Trees {
        self.trees.get_or_init(|| trees_of_mean(&self.function, lookup))
    }

    /// Memory in bytes, without the size of the type; unbuilt trees count with their expected size.
    fn memory(&self) -> usize {
        let mesh = self.function.geometry().mesh();
        let expected = || mesh.map_or(0, |lookup| Trees::expected_memory(&self.function, lookup));
        let trees = self.trees.get().map_or_else(expected, Trees::memory);
        let lobe = self.lobe.as_ref().map_or(0, |lobe| size_of::<Lobed>() + lobe.memory());
        self.function.memory() + trees + self.albedos.memory() + lobe
    }
}
