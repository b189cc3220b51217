//! An opened material: its function, its sampling trees and its report.

use super::albedo::{Albedos, Side};
use super::carrying::trees_of_mean;
use super::directions::{Directions, Pairs};
use super::error::{Argument, EvaluateError, Need, QueryError, unfit};
use super::form::{Course, Form};
use super::function::Function;
use super::geometry::Geometry;
use super::incoming::Alignment;
use super::known_directions::FilledCells;
use super::lobed::Lobed;
use super::lookup::MeshLookup;
use super::measured_share::MeasuredShare;
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

/// Opened material, ready for evaluation and sampling; share it between threads by reference.
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
    /// Measured share of the outgoing directions; `None` for data without outgoing directions.
    measured: Option<MeasuredShare>,
}

/// Radiometric function of direction and wavelength, built from the samples of a material.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "a query of cells goes through one pointer less, and materials are few")]
enum Body {
    /// Samples over triangles of directions, or samples that do not depend on an outgoing direction.
    Cells(Cells),
    /// Samples at the directions of a grid of polar angles and azimuths.
    Grid {
        stated: Box<Stated>,
        /// Averages of the function over triangles of directions, built on first use.
        cells: OnceLock<Result<Box<Material>, EvaluateError>>,
        /// Averages of the mean over wavelengths, from which directions are drawn. A table for each wavelength
        /// would take a second and many megabytes for a lamp of some thousand wavelengths.
        means: OnceLock<Result<Box<Material>, EvaluateError>>,
        /// Directional albedos under the grid's own incoming directions, computed on first use.
        albedos: OnceLock<Albedos>,
    },
}

impl Body {
    fn on_grid(stated: Box<Stated>) -> Self {
        Self::Grid { stated, cells: OnceLock::new(), means: OnceLock::new(), albedos: OnceLock::new() }
    }
}

/// Function of direction and wavelength given by samples that belong to triangles of directions, with its sampling
/// trees, its albedos and an analytic lobe that evaluation adds to it.
#[derive(Debug)]
struct Cells {
    function: Function,
    /// Importance sampling trees, built when the first direction is drawn.
    trees: OnceLock<Trees>,
    /// Directional albedos computed when the material is opened; empty without an outgoing axis.
    albedos: Albedos,
    /// Analytic lobe that is added to the function of the samples.
    lobe: Option<Box<Lobed>>,
}

impl Material {
    /// Opens a compressed material from the bytes of its file, read or memory-mapped.
    pub fn open(bytes: &[u8]) -> Result<Self, EvaluateError> {
        Self::decoded(compress::decode(bytes)?)
    }

    /// Opens a resolution level of a compressed material. `bytes` is the whole file, or as long a prefix as
    /// [`compress::levels`] reports for the level.
    pub fn open_level(bytes: &[u8], level: u8) -> Result<Self, EvaluateError> {
        Self::decoded(compress::decode_level(bytes, level)?)
    }

    /// Returns the resolution levels that [`Material::open_level`] can open.
    pub fn levels(bytes: &[u8]) -> Result<Vec<LevelInfo>, EvaluateError> {
        Ok(compress::levels(bytes)?)
    }

    /// Opens a measurement. Selects the rule, the best one for the data, by which lobes move with the incoming
    /// direction in interpolation.
    pub fn of(measurement: Measurement) -> Result<Self, EvaluateError> {
        Self::on_course(measurement, Course::default(), &FilledCells::default())
    }

    /// Opens a measurement with a given rule by which lobes move with the incoming direction in interpolation.
    pub fn with_alignment(measurement: Measurement, alignment: Alignment) -> Result<Self, EvaluateError> {
        Self::on_course(
            measurement,
            Course { alignment: Some(alignment), ..Course::default() },
            &FilledCells::default(),
        )
    }

    /// Opens a measurement with a given interpolation between incoming directions. If the quantity or the axes do not
    /// allow that interpolation, the default is used: linear, without a divisor.
    pub fn with_between(measurement: Measurement, between: Between) -> Result<Self, EvaluateError> {
        Self::on_course(measurement, Course { between, ..Course::default() }, &FilledCells::default())
    }

    /// Opens a measurement. `filled` are the cells whose values a rule filled in.
    fn on_course(measurement: Measurement, mut course: Course, filled: &FilledCells) -> Result<Self, EvaluateError> {
        if !course.between.fits(measurement.quantity, measurement.tensor.axes()) {
            course.between = Between::default();
        }
        let geometry = Geometry::new(&measurement)?;
        let measured = MeasuredShare::of(&measurement, filled);
        let body = if geometry.is_grid() {
            let stated = Box::new(Stated::new(&measurement, geometry, course));
            Body::on_grid(stated)
        } else {
            let albedos = Albedos::new(&measurement, &geometry);
            let function = Function::new(measurement, geometry, course);
            Body::Cells(Cells { function, trees: OnceLock::new(), albedos, lobe: None })
        };
        Ok(Self { body, summary: None, measured })
    }

    /// Sets the weight, 0 to 1, of linear interpolation between samples on a grid of angles; cubic interpolation has
    /// the rest of the weight. The default is the weight in the file, or 0 for a measurement. Most readers of
    /// luminaires and of MDL's measured materials use 1. Samples over triangles are unaffected.
    #[must_use]
    pub fn with_straight_lines(self, share: f32) -> Self {
        let Self { body, summary, measured } = self;
        let body = match body {
            Body::Cells(_) => body,
            Body::Grid { stated, .. } => {
                let stated = Box::new(stated.with_straight(share.clamp(0.0, 1.0)));
                Body::on_grid(stated)
            }
        };
        Self { body, summary, measured }
    }

    /// Adds an analytic lobe to a BRDF sampled over triangles: evaluation gives the sum of both. The material stays as
    /// it is if it is of another kind, or if compression would refuse this lobe for it
    /// ([`Settings::lobe`](crate::compress::Settings::lobe)).
    #[must_use]
    pub fn with_lobe(mut self, lobe: Lobe) -> Self {
        let is_fit = lobe_fits(&lobe, self.quantity(), self.axes());
        if let (Body::Cells(cells), true) = (&mut self.body, is_fit) {
            cells.take(Lobed::new(lobe));
        }
        self
    }

    /// Returns this material if its samples belong to triangles. For samples on a grid of angles, returns their
    /// averages over triangles, the basis of integration and of sampling by one wavelength, which are built on first
    /// use.
    #[doc(hidden)]
    pub fn over_triangles(&self) -> Result<&Self, EvaluateError> {
        match &self.body {
            Body::Cells(_) => Ok(self),
            Body::Grid { stated, cells, .. } => {
                cells.get_or_init(|| Self::averaged(stated)).as_deref().map_err(Clone::clone)
            }
        }
    }

    /// Returns the material over triangles from which directions are drawn by the mean over wavelengths.
    #[inline]
    fn mean_over_triangles(&self) -> Result<&Self, EvaluateError> {
        match &self.body {
            Body::Grid { stated, means, .. } if stated.geometry().lambdas() > 1 => {
                means.get_or_init(|| Self::averaged(&stated.mean()?)).as_deref().map_err(Clone::clone)
            }
            _ => self.over_triangles(),
        }
    }

    fn averaged(stated: &Stated) -> Result<Box<Self>, EvaluateError> {
        Self::on_course(stated.cell_averages()?, stated.course(), &FilledCells::default()).map(Box::new)
    }

    /// Function interpolated between samples on a grid of angles; `None` if samples belong to triangles.
    pub(super) fn stated(&self) -> Option<&Stated> {
        if let Body::Grid { stated, .. } = &self.body { Some(stated) } else { None }
    }

    fn cells(&self) -> Option<&Cells> {
        if let Body::Cells(cells) = &self.body { Some(cells) } else { None }
    }

    /// Builds a material from the decoded contents of a compressed file. [`Material::summary`] then returns the file's
    /// header.
    pub fn decoded(Decoded { measurement, summary }: Decoded) -> Result<Self, EvaluateError> {
        let course = Course { between: summary.between, ..Course::default() };
        let filled = summary.metadata.as_deref().map_or_else(FilledCells::default, FilledCells::stated);
        let mut material = Self::on_course(measurement, course, &filled)?;
        if let Some(lobe) = &summary.lobe {
            material = material.with_lobe(lobe.clone());
        }
        let material = match summary.straight_lines {
            Some(share) if share > 0.0 => material.with_straight_lines(share as f32),
            _ => material,
        };
        Ok(Self { summary: Some(summary), ..material })
    }

    /// Radiometric quantity that was measured.
    pub fn quantity(&self) -> Quantity {
        self.geometry().quantity()
    }

    /// Unit of the values that evaluation returns.
    pub fn unit(&self) -> Unit {
        self.geometry().unit()
    }

    /// Axes of the material's array of samples, outermost first.
    pub fn axes(&self) -> &[Axis] {
        self.geometry().axes()
    }

    /// Roles of the axes: indices, incoming and outgoing directions, wavelength.
    pub fn layout(&self) -> &Layout {
        self.geometry().layout()
    }

    /// Header of the compressed material; `None` if it was opened from a measurement.
    pub fn summary(&self) -> Option<&Summary> {
        self.summary.as_ref()
    }

    /// Root mean square relative error er(L2) that the compressed material promises; `None` if it was opened from a
    /// measurement.
    pub fn promised_er_l2(&self) -> Option<f64> {
        self.summary.as_ref().map(Summary::promised_er_l2)
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

    /// Returns true if values at a pair of directions are extrapolated: `wi` is further from the normal than the last
    /// measured polar angle of incidence, or `wo` beyond the first or last measured polar angle of a grid that
    /// continues there. Directions without a value, and those that a format defines as dark, are not extrapolated.
    pub fn is_extrapolated(&self, wi: Option<Direction>, wo: Option<Direction>) -> bool {
        // A list over the scattering angle has no angles of its own directions.
        let is_list = self.stated().is_some_and(Stated::is_scattering);
        wi.is_some_and(|wi| self.geometry().is_past_last(wi))
            || wo.is_some_and(|wo| !is_list && self.geometry().is_beyond_measured(wo))
    }

    /// Returns true if a pair of directions lies within the measured polar angles, so that its value is no continuation
    /// of others. It may still be masked.
    pub fn is_measured(&self, wi: Option<Direction>, wo: Option<Direction>) -> bool {
        !self.is_extrapolated(wi, wo) && wi.is_none_or(|wi| !self.geometry().is_before_first(wi))
    }

    /// Measured share of the outgoing directions; `None` for data without outgoing directions.
    pub fn measured_share(&self) -> Option<MeasuredShare> {
        self.measured
    }

    /// Fails if less than 80 % of the outgoing directions were measured. `asked` says in words what was asked for, such
    /// as `albedo`; the error names it.
    #[inline]
    pub fn needs_whole(&self, asked: &'static str) -> Result<(), EvaluateError> {
        self.measured.map_or(Ok(()), |measured| measured.needs_whole(asked))
    }

    /// Fails if too few outgoing directions were measured for an albedo, a flux or another integral over them.
    pub(super) fn needs_light(&self) -> Result<(), EvaluateError> {
        self.measured.map_or(Ok(()), |measured| measured.needs_whole(measured.light()))
    }

    /// Reports memory and accuracy of the opened material.
    pub fn report(&self) -> OpenedReport {
        match &self.body {
            Body::Cells(cells) => OpenedReport::of(cells.function.form(), self.memory()),
            Body::Grid { stated, .. } => OpenedReport::of_lines(stated.lines(), self.memory()),
        }
    }

    /// Memory of the opened material in bytes: samples or spectral coefficients, interpolation tables, tables of the
    /// meshes, albedos and sampling trees. Trees that are not built yet count with their expected size.
    pub fn memory(&self) -> usize {
        let body = match &self.body {
            Body::Cells(cells) => cells.memory(),
            Body::Grid { stated, cells, means, albedos } => {
                let albedos = albedos.get().map_or(0, Albedos::memory);
                let built = [cells, means].into_iter().filter_map(|made| made.get()?.as_ref().ok());
                size_of::<Stated>() + stated.memory() + built.map(|made| made.memory()).sum::<usize>() + albedos
            }
        };
        size_of::<Self>() + body
    }

    /// Row-major position of `index` (one index for each leading index axis) among all combinations of indices
    /// (positions on the axes before the directions).
    pub fn entry(&self, index: &[usize]) -> Result<usize, EvaluateError> {
        self.geometry().entry(index)
    }

    /// Index on each index axis of the combination at row-major position `entry`; inverse of [`Material::entry`].
    pub fn index_of(&self, entry: usize) -> Vec<usize> {
        self.geometry().index_of(entry)
    }

    /// Writes the whole spectrum at `place` (indices and directions) into `out` (`lambdas()` long), in the
    /// measurement's unit, without a cosine factor. NaN means masked; values are 0 if `wo` is outside the outgoing
    /// domain.
    #[inline]
    pub fn evaluate(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.spectrum(place, how, out),
            Body::Grid { stated, .. } => stated.spectrum(place, how, out),
        }
    }

    /// Writes the values at the indices and directions of `place`, at `wavelengths` in nm, into `out`, which has the
    /// same length. Values are interpolated linearly between the measured wavelengths; `beyond` decides outside their
    /// range. A value is NaN (masked) if one of the two samples around it is masked. Fails for RGB and monochromatic
    /// data.
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

    /// Inner product of the spectrum at the indices and directions of `place` with `weights`, one for each sample: for
    /// example a luminance, the power in a band, or a mean. NaN if a sample with a nonzero weight is masked.
    pub fn weighted(&self, place: Place<'_>, how: Interpolation, weights: &[f32]) -> Result<f32, EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.weighted(place, how, weights),
            Body::Grid { stated, .. } => stated.weighted(place, how, weights),
        }
    }

    /// Samples `[outgoing, wavelength]` for one combination of the axes before the outgoing one, whose row-major
    /// position is `slice`. Data without directions give one spectrum. NaN means masked.
    ///
    /// # Panics
    /// If there is no such entry.
    pub fn slice(&self, slice: usize) -> Vec<f32> {
        match &self.body {
            Body::Cells(cells) => cells.slice(slice),
            Body::Grid { stated, .. } => stated.slice(slice),
        }
    }

    /// Samples of the opened material: the decoded ones, up to the deviation that [`Material::report`] gives.
    pub fn measurement(&self) -> Result<Measurement, EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.measurement(),
            Body::Grid { stated, .. } => stated.measurement(),
        }
    }

    /// Writes the spectra for the direction pairs `pairs` into `out`, `[pair][wavelength]`, on the calling thread. Does
    /// not allocate. Stops at the first invalid pair. Agrees with [`Material::evaluate`] within the tolerance that the
    /// [rules](super#rules) give for batches.
    pub fn spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.spectra(pairs, how, out),
            Body::Grid { stated, .. } => stated.spectra(pairs, how, out),
        }
    }

    /// Evaluates a batch of spectra like [`Material::spectra`], on all threads.
    pub fn par_spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        match &self.body {
            Body::Cells(cells) => cells.par_spectra(pairs, how, out),
            Body::Grid { stated, .. } => stated.par_spectra(pairs, how, out),
        }
    }

    /// Density in sr⁻¹ with which [`Material::sample`] draws `wo` if it is called with the same `index`, `wi` and
    /// `options`. It is 0 outside the outgoing domain, where the function is masked, and where there is no light.
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

    /// Draws an outgoing direction from the point `u` of the unit square, in proportion to the material's function
    /// (times |cos θo| for a BRDF, BTDF or BSDF), averaged over wavelengths. `None` if there is no light, and for the
    /// few points whose direction is masked. `options` may be a [`SampleOptions`] or the level of the triangles inside
    /// which directions no longer follow the function.
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
            Some(stated) => sampler.sample_of((stated, None), index, wi, u, options),
        }
    }

    /// Draws the direction and density of [`Material::sample`] alone, without a weight, for callers who evaluate f
    /// themselves; `None` for a failed draw.
    #[inline]
    pub fn draw(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<(Direction, f64)>, EvaluateError> {
        match self.stated() {
            None => self.sampler()?.draw(index, wi, u, options.into()),
            Some(stated) => self.draw_on(stated, index, wi, u, options.into()),
        }
    }

    /// Draws a direction with its density, as [`Material::draw`] does, if samples lie on a grid of angles.
    fn draw_on(
        &self,
        stated: &Stated,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<(Direction, f64)>, EvaluateError> {
        let Some(turning) = stated.turning(wi) else { return self.sampler()?.draw(index, wi, u, options) };
        let drawn = self.sampler()?.draw(index, Some(Turning::up()), u, options)?;
        Ok(drawn.map(|(direction, pdf)| (turning.outward(direction), pdf)))
    }

    /// Writes the sampling densities of [`Material::pdf`] for the direction pairs `pairs` into `out`, on the calling
    /// thread. Does not allocate. Stops at the first invalid pair.
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

    /// Runs [`Material::sample`] for each incoming direction `wi` and point `u` of the unit square, on the calling
    /// thread, and writes the results into `out`. `wi` has one direction for each point; `None` for quantities without
    /// an incoming direction. Does not allocate. Stops at the first invalid point.
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
    /// the density of `wo` is 0. Several components of the sampling mixture may draw `wo`. The point is that of the
    /// first tree that draws it, else of the defensive component.
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

    /// Builds a sampler whose density follows the values at one wavelength in nm, linear between the samples of the
    /// spectra. Fails outside the measured range.
    pub fn sampler_at(&self, wavelength: f64) -> Result<WavelengthSampler<'_>, EvaluateError> {
        let (cells, lookup) = self.sampled(Self::over_triangles)?;
        let function = (&cells.function, cells.lobe.as_deref());
        WavelengthSampler::at(function, self.stated(), lookup, cells.mean_trees(lookup), wavelength)
    }

    /// Sampler whose density follows the mean over wavelengths; its trees are built on first use.
    #[inline]
    pub(super) fn sampler(&self) -> Result<Sampler<'_>, EvaluateError> {
        let (cells, lookup) = self.sampled(Self::mean_over_triangles)?;
        let lobe = cells.lobe.as_deref().map(|lobe| (lobe, lobe.mean_colour()));
        Ok(Sampler::new(&cells.function, lobe, cells.mean_trees(lookup)))
    }

    /// Samples over triangles from which directions are drawn, and the lookup of their outgoing mesh. `averaged`
    /// returns the material over triangles that stands for samples on a grid of angles.
    #[inline]
    fn sampled<'a>(
        &'a self,
        averaged: fn(&'a Self) -> Result<&'a Self, EvaluateError>,
    ) -> Result<(&'a Cells, &'a Arc<MeshLookup>), EvaluateError> {
        self.needs_whole("sample and no density (pdf)")?;
        match averaged(self)?.cells().and_then(|cells| Some((cells, cells.function.geometry().mesh()?))) {
            Some(found) => Ok(found),
            None => unfit(QueryError::NoOutgoing { need: Need::Sampling, quantity: self.quantity() }),
        }
    }

    /// Function of direction and wavelength given by samples that belong to triangles of directions; `None` if the
    /// samples lie on a grid of angles.
    #[inline(always)]
    pub(super) fn function(&self) -> Option<&Function> {
        self.cells().map(|cells| &cells.function)
    }

    /// Three parts of a material with samples over triangles: the function of direction and wavelength, its spectral
    /// coefficients, and its tables for smooth interpolation. `None` if the material stores all samples rather than
    /// coefficients, has its samples on a grid of angles, or adds an analytic lobe.
    #[inline(always)]
    pub(super) fn planes(&self) -> Option<(&Function, &Planes, &Smooth)> {
        if self.cells().is_some_and(|cells| cells.lobe.is_some()) { None } else { self.planes_of_cells() }
    }

    /// Three parts of a material with samples over triangles: the function of direction and wavelength without the
    /// analytic lobe that evaluation may add, its spectral coefficients, and its tables for smooth interpolation.
    /// `None` if the material stores all samples rather than coefficients, or has its samples on a grid of angles.
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

    /// Precomputed albedos of reflected, transmitted or all light, `[incoming direction, wavelength]`. `is_above` is
    /// true for incoming directions above the horizon; `None` if no light can leave on the requested side.
    pub(super) fn stored_albedos(&self, side: Side, is_above: bool) -> Option<&[f32]> {
        match &self.body {
            Body::Cells(cells) => cells.albedos.of(side, is_above),
            Body::Grid { stated, albedos, .. } => albedos.get_or_init(|| Albedos::of_angles(stated)).of(side, is_above),
        }
    }
}

impl Cells {
    /// Adds an analytic lobe to the function of the samples, and its albedo to the albedos of the samples.
    fn take(&mut self, lobe: Lobed) {
        self.albedos.add(|table| lobe.add_light(self.function.geometry(), table));
        self.lobe = Some(Box::new(lobe));
    }

    #[inline]
    fn spectrum(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        match &self.lobe {
            None => self.function.spectrum(place, how, out),
            Some(lobe) => self.spectrum_beside(lobe, place, how, out),
        }
    }

    /// Writes the whole spectrum at `place`, with the lobe. Not inlined, because queries without a lobe would otherwise
    /// copy their directions for it all the same.
    #[inline(never)]
    fn spectrum_beside(
        &self,
        lobe: &Lobed,
        place: Place<'_>,
        how: Interpolation,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        self.function.spectrum(place, how, out)?;
        lobe.add(place, out);
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
        match &self.lobe {
            None => self.function.at_wavelengths(place, how, beyond, wavelengths, out),
            Some(lobe) => self.at_wavelengths_beside(lobe, place, how, beyond, wavelengths, out),
        }
    }

    /// Writes the values at some wavelengths, with the lobe. Not inlined, for the reason of [`Cells::spectrum_beside`].
    #[inline(never)]
    fn at_wavelengths_beside(
        &self,
        lobe: &Lobed,
        place: Place<'_>,
        how: Interpolation,
        beyond: Beyond,
        wavelengths: &[f64],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        self.function.at_wavelengths(place, how, beyond, wavelengths, out)?;
        if let Some(grid) = self.function.geometry().grid() {
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

    /// Samples `[outgoing, wavelength]` for one combination of the axes before the outgoing one. If evaluation adds an
    /// analytic lobe, its mean over each triangle is added to the sample.
    fn slice(&self, slice: usize) -> Vec<f32> {
        let mut samples = self.function.slice(slice);
        if let Some(lobe) = &self.lobe {
            lobe.add_means(self.function.geometry(), slice, &mut samples);
        }
        samples
    }

    /// Measurement with the samples of all triangles. If evaluation adds an analytic lobe, its mean over each triangle
    /// is added to the sample.
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

    /// Heap memory in bytes of function, sampling trees, albedos and lobe; trees not built yet count with their
    /// expected size.
    fn memory(&self) -> usize {
        let mesh = self.function.geometry().mesh();
        let expected = || mesh.map_or(0, |lookup| Trees::expected_memory(&self.function, lookup));
        let trees = self.trees.get().map_or_else(expected, Trees::memory);
        let lobe = self.lobe.as_ref().map_or(0, |lobe| size_of::<Lobed>() + lobe.memory());
        self.function.memory() + trees + self.albedos.memory() + lobe
    }
}
