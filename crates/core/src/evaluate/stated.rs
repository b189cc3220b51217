//! Function of samples on a grid of angles at one place: whole spectra, some wavelengths, weighted sums.

use super::directions::Pairs;
use super::error::{Buffer, EvaluateError, QueryError, unfit};
use super::form::Course;
use super::geometry::{Geometry, in_plane};
use super::kernel::{BLOCK, Vectors, set_vector, vector_of};
use super::lines::{Borders, Found, Incoming, Lines};
use super::measured_share::{has_no_azimuths, has_planes, is_on_mirror_side};
use super::place::{Beyond, Interpolation, Place};
use super::samples::{known_mean, known_sum};
use super::spectrum::between;
use super::turning::Turning;
use crate::domain::vector::{Vector, cross, dot, norm, turned};
use crate::domain::{Axis, AzimuthExtent, Direction, DirectionGrid, Domain, Frame, Measurement, Quantity, Tensor};
use crate::numeric::wide;
use rayon::prelude::*;

/// Number of queries (pairs of directions) that a thread takes at a time.
const SHARE: usize = 1024;

/// Function of samples on a grid of angles: the axes, and the interpolation between the grid's directions.
#[derive(Debug)]
pub(super) struct Stated {
    geometry: Geometry,
    /// True if the samples are a list over the scattering angle between the incoming and the outgoing direction.
    is_scattering: bool,
    /// True if a surface was measured on the mirror's side of the plane of incidence alone.
    is_half_plane: bool,
    lines: Lines,
}

impl Stated {
    /// Builds the function of a measurement on a grid of angles, whose axes are described by `geometry`.
    pub(super) fn new(measurement: &Measurement, geometry: Geometry, course: Course) -> Self {
        let candidates = course.candidates(measurement.quantity);
        let has_cosine = measurement.quantity.has_cosine();
        let borders = Borders { gaps: false, horizon: has_cosine };
        let incoming = match geometry.layout().incoming.map(|axis| &geometry.axes()[axis]) {
            Some(Axis::Elevation(values)) => Incoming::elevations(values),
            Some(Axis::Grid(grid)) => Incoming::grid(grid, borders),
            _ => Incoming::NONE,
        };
        let domain = domain_of(measurement.quantity);
        let first = candidates.first().copied().unwrap_or_default();
        let (samples, lambdas) = (measurement.tensor.samples(), geometry.lambdas());
        let outgoing = geometry
            .outgoing_grid()
            .map(|grid| (grid, Borders { gaps: has_planes(measurement.quantity, grid), ..borders }));
        let mut lines = Lines::new(samples, lambdas, incoming, outgoing, (domain, first));
        if geometry.shape()[0] > 1 && candidates.len() > 1 {
            lines.align(geometry.entries(), &candidates, |d| if has_cosine { d[2].abs() } else { 1.0 });
        }
        lines.go(geometry.entries(), &course.between);
        let is_scattering = measurement.quantity == Quantity::Phase && is_list(&geometry);
        Self { geometry, is_scattering, is_half_plane: has_no_azimuths(measurement), lines }
    }

    /// Sets the fraction, 0..=1, of linear interpolation of samples; cubic interpolation has the rest.
    pub(super) fn with_straight(self, share: f32) -> Self {
        Self { lines: self.lines.with_straight(share), ..self }
    }

    /// Returns true for a phase function given by the scattering angle alone, which has values under any incoming
    /// direction.
    pub(super) fn is_scattering(&self) -> bool {
        self.is_scattering
    }

    /// Frame whose z axis is `wi`, for samples over the scattering angle, whose light comes in along `+z`. `None` for
    /// other samples, whose directions need no frame.
    pub(super) fn turning(&self, wi: Option<Direction>) -> Option<Turning> {
        wi.filter(|_| self.is_scattering).map(Turning::about)
    }

    pub(super) fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Returns true if the quantity has an albedo, and the grid of outgoing directions covers an area to integrate
    /// over.
    pub(super) fn has_albedo(&self) -> bool {
        let has_area = |grid: &DirectionGrid| {
            let (low, high) = grid.covers();
            let is_line = grid.azimuths().is_some_and(|azimuths| {
                azimuths.extent == AzimuthExtent::Sector && azimuths.angles.first() == azimuths.angles.last()
            });
            high > low && !is_line
        };
        self.geometry.quantity().has_cosine() && self.geometry.outgoing_grid().is_some_and(has_area)
    }

    pub(super) fn lines(&self) -> &Lines {
        &self.lines
    }

    /// Heap memory in bytes of a function on a grid of angles.
    pub(super) fn memory(&self) -> usize {
        self.geometry.memory() + self.lines.memory()
    }

    /// Row-major number of the query's indices (positions on the axes before the directions), and the query's incoming
    /// and outgoing direction as the grid of angles counts them: with `wi` at azimuth 0 if the data are isotropic.
    #[inline]
    fn asked(&self, place: Place<'_>) -> Result<(usize, [Vector; 2]), EvaluateError> {
        let entry = self.geometry.entry_of(place)?;
        let [wi, wo] = self.geometry.in_lines(place)?;
        if self.is_below(wi) {
            return self.geometry.refuse_incoming(place.wi);
        }
        Ok((entry, if self.is_scattering { about(wi, wo) } else { [wi, wo] }))
    }

    /// Returns true for an incoming direction below the horizon, which is outside an axis of elevations. Samples over
    /// the scattering angle accept any direction.
    #[inline]
    fn is_below(&self, wi: Vector) -> bool {
        wi[2] < 0.0 && self.geometry.is_isotropic() && !self.is_scattering
    }

    /// Returns true if nothing is known for a pair of directions, because only one side of the plane of incidence was
    /// measured. The incoming direction is at azimuth 0.
    #[inline]
    fn is_beside_plane(&self, wi: Vector, wo: Vector) -> bool {
        self.is_half_plane && !is_on_mirror_side(wi, wo)
    }

    /// Finds the samples that determine the value for a pair of directions; `None` outside the outgoing domain of the
    /// quantity.
    fn found(&self, place: Place<'_>, how: Interpolation) -> Result<Option<Found>, EvaluateError> {
        let (entry, [wi, wo]) = self.asked(place)?;
        let found = match how {
            Interpolation::Smooth => self.lines.smooth(entry, wi, wo),
            Interpolation::Constant => self.lines.nearest(entry, wi, wo),
        };
        match found {
            None => self.geometry.refuse_incoming(place.wi),
            Some(_) if self.is_outside(wo) => Ok(None),
            Some(found) if self.is_beside_plane(wi, wo) => Ok(Some(found.without_samples())),
            found => Ok(found),
        }
    }

    /// Returns true for an outgoing direction outside the outgoing domain of the quantity.
    #[inline]
    fn is_outside(&self, wo: Vector) -> bool {
        match domain_of(self.geometry.quantity()) {
            _ if self.geometry.outgoing_grid().is_none() => false,
            Domain::Hemisphere => wo[2] < 0.0,
            Domain::Lower => wo[2] > 0.0,
            Domain::Sphere => false,
        }
    }

    /// Writes the whole spectrum for a pair of directions into `out`, from samples on a grid of angles; see
    /// [`super::material::Material::evaluate`].
    #[inline]
    pub(super) fn spectrum(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        Buffer::Spectrum.check(out.len(), self.geometry.lambdas())?;
        if how == Interpolation::Smooth {
            let (entry, [wi, wo]) = self.asked(place)?;
            if self.lines.smooth_spectrum(entry, wi, wo, out).is_none() {
                return self.geometry.refuse_incoming(place.wi);
            }
            self.hide(wi, wo, out);
            return Ok(());
        }
        match self.found(place, how)? {
            Some(found) => self.lines.spectrum(&found, out),
            None => out.fill(0.0),
        }
        Ok(())
    }

    /// Writes the values at `wavelengths` in nm for a pair of directions into `out`, from samples on a grid of angles;
    /// see [`super::material::Material::at_wavelengths`].
    pub(super) fn at_wavelengths(
        &self,
        place: Place<'_>,
        how: Interpolation,
        beyond: Beyond,
        wavelengths: &[f64],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let Some(grid) = self.geometry.grid() else {
            return unfit(QueryError::NoWavelengths { quantity: self.geometry.quantity() });
        };
        Buffer::Wavelengths.check(out.len(), wavelengths.len())?;
        match self.found(place, how)? {
            Some(found) => between(grid, beyond, wavelengths, out, |lambda| self.lines.sample(&found, lambda)),
            None => between(grid, beyond, wavelengths, out, |_| 0.0),
        }
        Ok(())
    }

    /// Inner product with `weights`, one for each sample of a spectrum, of the spectrum for a pair of directions, from
    /// samples on a grid of angles; see [`super::material::Material::weighted`].
    pub(super) fn weighted(&self, place: Place<'_>, how: Interpolation, weights: &[f32]) -> Result<f32, EvaluateError> {
        Buffer::Weights.check(weights.len(), self.geometry.lambdas())?;
        let Some(found) = self.found(place, how)? else { return Ok(0.0) };
        let lit = weights.iter().enumerate().filter(|(_, w)| **w != 0.0);
        Ok(lit.map(|(lambda, w)| w * self.lines.sample(&found, lambda)).sum())
    }

    /// Inner product with `weights`, one for each sample of a spectrum, of the spectrum for a pair of directions; its
    /// mean without weights. Masked samples are skipped and the remaining weights renormalised; 0 if all are masked.
    pub(super) fn weighted_known(
        &self,
        place: Place<'_>,
        how: Interpolation,
        weights: Option<&[f32]>,
    ) -> Result<f32, EvaluateError> {
        let Some(found) = self.found(place, how)? else { return Ok(0.0) };
        let sample = |lambda| self.lines.sample(&found, lambda);
        if let Some(weights) = weights {
            return Ok(known_sum(weights, &sample));
        }
        let mean = known_mean((0..self.geometry.lambdas()).map(sample));
        Ok(if mean.is_nan() { 0.0 } else { mean })
    }

    /// Function of the mean over the wavelengths, of the samples that are not masked.
    pub(super) fn mean(&self) -> Result<Self, EvaluateError> {
        let [n_in, ..] = self.geometry.shape();
        let slices = (0..self.geometry.entries() * n_in).map(|slice| self.slice(slice));
        let mean = |spectrum: &[f32]| known_mean(spectrum.iter().copied());
        let samples =
            slices.flat_map(|slice| slice.chunks_exact(self.geometry.lambdas()).map(mean).collect::<Vec<_>>());
        let is_kept = |axis: &&Axis| !matches!(axis, Axis::Wavelength(_) | Axis::Rgb);
        let axes = self.geometry.axes().iter().filter(is_kept).cloned().collect();
        let tensor = Tensor::new(axes, samples.collect())?;
        let measurement = Measurement {
            quantity: self.geometry.quantity(),
            unit: self.geometry.unit(),
            sampling: self.geometry.sampling(),
            tensor,
        };
        let geometry = Geometry::new(&measurement)?;
        Ok(Self::new(&measurement, geometry, self.course()).with_straight(self.lines.straight()))
    }

    /// Returns the interpolation between incoming directions of the function.
    pub(super) fn course(&self) -> Course {
        Course { alignment: Some(self.lines.alignment()), between: self.lines.between() }
    }

    /// Writes the spectra for many pairs of directions into `out`, one after the other, from samples on a grid of
    /// angles; see [`super::material::Material::spectra`].
    pub(super) fn spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        let (count, lambdas) = (pairs.check(out.len(), self.geometry.lambdas())?, self.geometry.lambdas());
        for (start, out) in (0..count).step_by(BLOCK).zip(out.chunks_mut(BLOCK * lambdas)) {
            let part = pairs.part(start, (start + BLOCK).min(count));
            if how == Interpolation::Smooth && self.spectra_of_block(part, out) {
                continue;
            }
            // Evaluates one by one, so that the error names the direction.
            let mut rows = out.chunks_exact_mut(lambdas).enumerate();
            rows.try_for_each(|(i, out)| self.spectrum(part.place(i)?, how, out))?;
        }
        Ok(())
    }

    /// Writes the spectra of up to [`BLOCK`] direction pairs; returns false if a pair is invalid, or if there is no
    /// outgoing direction.
    fn spectra_of_block(&self, pairs: Pairs<'_>, out: &mut [f32]) -> bool {
        let (Some(asked), true) = (pairs.wo, self.geometry.outgoing_grid().is_some()) else { return false };
        if pairs.wi.is_some() != self.geometry.has_incoming() {
            return false;
        }
        let Ok(entry) = self.geometry.entry(pairs.index) else { return false };
        let (mut wi, mut wo): (Vectors, Vectors) = ([[0.0; BLOCK], [0.0; BLOCK], [1.0; BLOCK]], [[0.0; BLOCK]; 3]);
        let is_written = asked.write_block(&mut wo).is_ok();
        if !is_written || pairs.wi.is_some_and(|asked| asked.write_block(&mut wi).is_err()) {
            return false;
        }
        if self.geometry.is_isotropic() {
            if (0..BLOCK).any(|i| self.is_below(vector_of(&wi, i))) {
                return false;
            }
            turn_to_plane(&mut wi, &mut wo);
        }
        if self.is_scattering {
            for i in 0..BLOCK {
                let [in_frame, out_frame] = about(vector_of(&wi, i), vector_of(&wo, i));
                set_vector(&mut wi, i, in_frame);
                set_vector(&mut wo, i, out_frame);
            }
        }
        if !self.lines.spectra(entry, &wi, &wo, out) {
            return false;
        }
        for (i, out) in out.chunks_exact_mut(self.geometry.lambdas()).enumerate() {
            self.hide(vector_of(&wi, i), vector_of(&wo, i), out);
        }
        true
    }

    /// Writes 0 where the quantity sends no light, and NaN beside the measured half of the plane of incidence.
    #[inline]
    fn hide(&self, wi: Vector, wo: Vector, out: &mut [f32]) {
        if self.is_outside(wo) {
            out.fill(0.0);
        } else if self.is_beside_plane(wi, wo) {
            out.fill(f32::NAN);
        }
    }

    /// Implements [`super::material::Material::par_spectra`] for samples on a grid of angles.
    pub(super) fn par_spectra(
        &self,
        pairs: Pairs<'_>,
        how: Interpolation,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let (count, lambdas) = (pairs.check(out.len(), self.geometry.lambdas())?, self.geometry.lambdas());
        out.par_chunks_mut(SHARE * lambdas).enumerate().try_for_each(|(share, out)| {
            let from = share * SHARE;
            self.spectra(pairs.part(from, (from + SHARE).min(count)), how, out)
        })
    }

    /// Integral over all outgoing directions, one number for each wavelength, for one combination of indices (positions
    /// on the axes before the directions). Only for quantities without an incoming direction.
    pub(super) fn integral(&self, entry: usize) -> Vec<f32> {
        let mut sums = vec![0.0; self.geometry.lambdas()];
        self.lines.integrate(entry, self.lines.straight(), &mut sums);
        sums.into_iter().map(|sum| sum as f32).collect()
    }

    /// Integrals of the sampled function over all outgoing directions, summed over wavelengths, for one combination of
    /// indices (positions on the axes before the directions). Between the samples, the first integral follows cubics of
    /// logarithms, the second straight lines.
    pub(super) fn fluxes(&self, entry: usize) -> [f64; 2] {
        [0.0, 1.0].map(|straight| {
            let mut sums = vec![0.0; self.geometry.lambdas()];
            self.lines.integrate(entry, straight, &mut sums);
            sums.into_iter().sum()
        })
    }

    /// Samples `[outgoing, wavelength]` on the grid of angles for one combination of the axes before the outgoing one,
    /// whose row-major position is `slice`.
    pub(super) fn slice(&self, slice: usize) -> Vec<f32> {
        self.lines.slice(self.geometry.shape(), slice)
    }

    /// Samples of the opened material on its grid of angles: the decoded ones, up to rounding.
    pub(super) fn measurement(&self) -> Result<Measurement, EvaluateError> {
        let [n_in, ..] = self.geometry.shape();
        let samples = (0..self.geometry.entries() * n_in).flat_map(|slice| self.slice(slice)).collect();
        let tensor = Tensor::new(self.geometry.axes().to_vec(), samples)?;
        let (quantity, unit, sampling) = (self.geometry.quantity(), self.geometry.unit(), self.geometry.sampling());
        Ok(Measurement { quantity, unit, sampling, tensor })
    }
}

/// Rotates each pair of directions of a block about the normal so that the incoming direction has azimuth 0.
fn turn_to_plane(wi: &mut Vectors, wo: &mut Vectors) {
    let from = [*wi, *wo];
    wide(
        #[inline(always)]
        || {
            for i in 0..BLOCK {
                let (turned_in, [cos, sin]) = in_plane(vector_of(&from[0], i));
                set_vector(wi, i, turned_in);
                set_vector(wo, i, turned(vector_of(&from[1], i), [cos, -sin]));
            }
        },
    );
}

/// Incoming and outgoing direction rotated so that light comes in along `+z` and leaves at the scattering angle.
fn about(wi: Vector, wo: Vector) -> [Vector; 2] {
    [[0.0, 0.0, 1.0], [norm(cross(wi, wo)), 0.0, dot(wi, wo)]]
}

/// Incoming and outgoing direction in the frame whose z axis is `wi` if samples are a list over the scattering angle;
/// otherwise unchanged.
pub(super) fn as_drawn(
    stated: Option<&Stated>,
    wi: Option<Direction>,
    wo: Direction,
) -> (Option<Direction>, Direction) {
    match stated.and_then(|stated| stated.turning(wi)) {
        Some(turning) => (Some(Turning::up()), turning.inward(wo)),
        None => (wi, wo),
    }
}

/// Returns true if the only incoming direction is the normal and outgoing directions are polar angles without azimuths.
fn is_list(geometry: &Geometry) -> bool {
    let incoming = geometry.layout().incoming.map(|axis| &geometry.axes()[axis]);
    let is_normal = matches!(incoming, Some(Axis::Elevation(elevations)) if elevations[..] == [0.0]);
    let outgoing = geometry.outgoing_grid();
    is_normal && outgoing.is_some_and(|grid| grid.frame() == Frame::Surface && grid.azimuths().is_none())
}

/// Domain of the outgoing directions into which a quantity sends light.
pub(super) fn domain_of(quantity: Quantity) -> Domain {
    match quantity {
        Quantity::Brdf => Domain::Hemisphere,
        Quantity::Btdf => Domain::Lower,
        _ => Domain::Sphere,
    }
}
