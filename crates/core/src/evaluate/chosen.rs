//! A few wavelengths chosen once, as a renderer does for a path, and used for many places.

use super::directions::{Directions, Pairs};
use super::error::{Argument, EvaluateError, QueryError, unfit};
use super::kernel::BLOCK;
use super::material::Material;
use super::mixed::Mixed;
use super::place::{Beyond, Interpolation, Place};
use super::planes::{Columns, FEW};
use super::warp::SampleOptions;
use crate::domain::{Direction, WavelengthGrid};
use crate::numeric::wide;

/// Up to [`Chosen::MOST`] wavelengths of a material, prepared for evaluation at many directions; made by
/// [`Material::choose`].
#[derive(Clone, Debug)]
pub struct Chosen<'a> {
    material: &'a Material,
    beyond: Beyond,
    count: usize,
    wavelengths: [f64; FEW],
    /// Factor on the value at each chosen wavelength: 1 inside the measured range. Outside it the factor is 1 if the
    /// nearest measured value holds there, 0 if there is no light, or NaN if values are masked.
    factors: [f32; FEW],
    columns: Option<Columns>,
}

/// Drawn outgoing direction with its weights at the chosen wavelengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChosenSample {
    /// Drawn outgoing direction.
    pub direction: Direction,
    /// Probability density of the direction in sr⁻¹.
    pub pdf: f64,
    /// Weight f · |cos θo| / pdf at each chosen wavelength, in their order. It is 0 where f is masked, and NaN outside
    /// the measured range under [`Beyond::Masked`].
    pub weights: [f32; Chosen::MOST],
}

/// Output buffers for a batch of drawn directions, their densities and their weights `[point][wavelength]`. Each point
/// of the unit square gives one direction. A failed draw leaves 0 in all buffers.
#[derive(Debug)]
pub struct Drawings<'a> {
    /// Coordinates x of the drawn unit vectors, along the reference direction (azimuth 0).
    pub x: &'a mut [f32],
    /// Coordinates y of the drawn unit vectors. The y axis lies in the surface, at azimuth 90°.
    pub y: &'a mut [f32],
    /// Coordinates z of the drawn unit vectors, along the surface normal.
    pub z: &'a mut [f32],
    /// Probability densities of the drawn directions in sr⁻¹.
    pub pdf: &'a mut [f32],
    /// Weights f · |cos θo| / pdf, `[point][wavelength]`.
    pub weights: &'a mut [f32],
}

impl Drawings<'_> {
    /// Parts of the buffers for coordinates x, y and z and for densities that hold the drawn directions `from..to` of
    /// the batch.
    fn part(&mut self, from: usize, to: usize) -> [&mut [f32]; 4] {
        [&mut self.x[from..to], &mut self.y[from..to], &mut self.z[from..to], &mut self.pdf[from..to]]
    }
}

impl Material {
    /// Prepares evaluation at up to [`Chosen::MOST`] wavelengths in nm. Spectra are linear between samples; `beyond`
    /// decides outside the measured range. Fails for RGB and monochromatic data, which have no wavelengths.
    pub fn choose(&self, wavelengths: &[f64], beyond: Beyond) -> Result<Chosen<'_>, EvaluateError> {
        let Some(grid) = self.geometry().grid() else {
            return unfit(QueryError::NoWavelengths { quantity: self.quantity() });
        };
        if wavelengths.len() > Chosen::MOST {
            return unfit(QueryError::TooManyWavelengths { found: wavelengths.len(), most: Chosen::MOST });
        }
        Ok(self.chosen(grid, wavelengths, beyond))
    }

    /// Writes the values at any number of `wavelengths` in nm for the direction pairs `pairs` into `out`,
    /// `[pair][wavelength]`, on the calling thread. Does not allocate. Stops at the first invalid pair. Agrees with
    /// [`Material::at_wavelengths`] within the tolerance that the [rules](super#rules) give for batches.
    pub fn spectra_at(
        &self,
        pairs: Pairs<'_>,
        how: Interpolation,
        beyond: Beyond,
        wavelengths: &[f64],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let Some(grid) = self.geometry().grid() else {
            return unfit(QueryError::NoWavelengths { quantity: self.quantity() });
        };
        let width = wavelengths.len();
        let count = pairs.check(out.len(), width)?;
        let Some((function, planes, smooth)) = self.planes() else {
            let mut rows = out.chunks_exact_mut(width.max(1)).enumerate();
            return rows.try_for_each(|(i, out)| self.at_wavelengths(pairs.place(i)?, how, beyond, wavelengths, out));
        };
        function.rows(planes, smooth, pairs, how, count, |start, rows| {
            for (few, from) in wavelengths.chunks(FEW).zip((0..).step_by(FEW)) {
                let out = out[start * width..].chunks_exact_mut(width);
                self.chosen(grid, few, beyond).write(rows, out.map(|out| &mut out[from..]));
            }
        })
    }

    /// Prepares evaluation at up to [`Chosen::MOST`] wavelengths in nm of data sampled on a wavelength grid.
    fn chosen(&self, grid: &WavelengthGrid, wavelengths: &[f64], beyond: Beyond) -> Chosen<'_> {
        let (first, last) = grid.range();
        let mut chosen = Chosen {
            material: self,
            beyond,
            count: wavelengths.len(),
            wavelengths: [first; FEW],
            factors: [0.0; FEW],
            columns: None,
        };
        chosen.wavelengths[..wavelengths.len()].copy_from_slice(wavelengths);
        for (factor, &lambda) in chosen.factors.iter_mut().zip(wavelengths) {
            *factor = match beyond {
                _ if lambda >= first && lambda <= last => 1.0,
                Beyond::Nearest if !lambda.is_nan() => 1.0,
                Beyond::Zero => 0.0,
                _ => f32::NAN,
            };
        }
        if let Some((_, planes, _)) = self.planes() {
            chosen.columns = Some(planes.columns(&chosen.wavelengths.map(|lambda| grid.position(lambda))));
        }
        chosen
    }
}

impl Chosen<'_> {
    /// Maximum number of wavelengths that one call of [`Material::choose`] can prepare for joint evaluation.
    pub const MOST: usize = FEW;

    /// Returns the chosen wavelengths in nm.
    pub fn wavelengths(&self) -> &[f64] {
        &self.wavelengths[..self.count]
    }

    /// Returns the values for a pair of directions at the chosen wavelengths, in their order and padded with 0. They
    /// are those of [`Material::at_wavelengths`].
    pub fn at(&self, place: Place<'_>, how: Interpolation) -> Result<[f32; Chosen::MOST], EvaluateError> {
        self.at_known(place, how, None)
    }

    /// Returns the values for a pair of directions at the chosen wavelengths, as [`Chosen::at`] does. The number of the
    /// incoming sample, if already known, saves the search on the incoming axis.
    #[inline]
    fn at_known(
        &self,
        place: Place<'_>,
        how: Interpolation,
        incoming: Option<usize>,
    ) -> Result<[f32; Chosen::MOST], EvaluateError> {
        let (Some((function, planes, smooth)), Some(columns)) = (self.material.planes(), &self.columns) else {
            let mut out = [0.0; FEW];
            self.material.at_wavelengths(place, how, self.beyond, self.wavelengths(), &mut out[..self.count])?;
            return Ok(out);
        };
        function.with_row(
            planes,
            smooth,
            place,
            how,
            incoming,
            #[inline(always)]
            |row, presence| {
                let mut values = [presence; FEW];
                if presence > 0.0 {
                    values = planes.picked(row, presence, columns);
                }
                self.held(values)
            },
        )
    }

    /// Writes the values for the direction pairs `pairs` into `out`, `[pair][wavelength]`, as [`Chosen::at`] gives
    /// them, on the calling thread.
    pub fn values(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        let count = pairs.check(out.len(), self.count)?;
        let Some((function, planes, smooth)) = self.material.planes() else {
            let mut rows = out.chunks_exact_mut(self.count.max(1)).enumerate();
            return rows.try_for_each(|(i, out)| {
                out.copy_from_slice(&self.at(pairs.place(i)?, how)?[..self.count]);
                Ok(())
            });
        };
        function.rows(planes, smooth, pairs, how, count, |start, rows| {
            self.write(rows, out[start * self.count..].chunks_exact_mut(self.count.max(1)));
        })
    }

    /// Expands the spectral coefficients of a block of queries at the chosen wavelengths. Writes the values of each
    /// query to the start of its slice in `out`.
    fn write<'b>(&self, rows: &[Mixed], out: impl Iterator<Item = &'b mut [f32]>) {
        let (Some((_, planes, _)), Some(columns)) = (self.material.planes(), &self.columns) else {
            return;
        };
        let mut values = [[0.0; FEW]; BLOCK];
        planes.picked_all(rows, columns, &mut values);
        for (out, values) in out.zip(&values[..rows.len()]) {
            for (out, value) in out.iter_mut().zip(&self.held(*values)[..self.count]) {
                *out = *value;
            }
        }
    }

    /// Draws a direction like [`Material::sample`], in proportion to the mean over all wavelengths. The weight at each
    /// chosen wavelength is f · |cos θo| / pdf, without the cosine for emission and phase functions. With
    /// [`Density::Uniform`](super::Density::Uniform) f is piecewise constant, else smooth.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<ChosenSample>, EvaluateError> {
        self.drawn(index, wi, u, options.into())
    }

    /// Draws a direction for [`Chosen::sample`]. It is not generic, so that it is compiled once in this crate rather
    /// than in every calling crate.
    fn drawn(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<ChosenSample>, EvaluateError> {
        let sampler = self.material.sampler()?;
        let drawn = wide(
            #[inline(always)]
            || {
                sampler.drawn_with(index, wi, u, options, |place, how, incoming, cell| {
                    match (self.material.planes(), &self.columns, cell) {
                        (Some((_, planes, _)), Some(columns), Some(cell)) if planes.presence(cell) > 0.0 => {
                            Ok(self.held(planes.picked(planes.row(cell), 1.0, columns)))
                        }
                        _ => self.at_known(place, how, incoming),
                    }
                })
            },
        )?;
        let Some((direction, pdf, values)) = drawn else { return Ok(None) };
        let cosine = if self.material.quantity().has_cosine() { direction.cos_theta().abs() } else { 1.0 };
        let share = (cosine / pdf) as f32;
        Ok(Some(ChosenSample { direction, pdf, weights: self.weights(values, share) }))
    }

    /// Draws an outgoing direction for each incoming direction `wi` and point `u` of the unit square, as
    /// [`Chosen::sample`] does. Writes directions, densities and weights to `out`, on the calling thread. `wi` has one
    /// direction for each point; `None` for quantities without an incoming direction. Does not allocate. Stops at the
    /// first invalid point.
    pub fn samples(
        &self,
        index: &[usize],
        wi: Option<Directions<'_>>,
        u: [&[f32]; 2],
        options: impl Into<SampleOptions>,
        out: Drawings<'_>,
    ) -> Result<(), EvaluateError> {
        self.drawn_all(index, wi, u, options.into(), out)
    }

    /// Draws the directions for [`Chosen::samples`]. It is not generic, so that it is compiled once in this crate
    /// rather than in every calling crate.
    fn drawn_all(
        &self,
        index: &[usize],
        wi: Option<Directions<'_>>,
        u: [&[f32]; 2],
        options: SampleOptions,
        mut out: Drawings<'_>,
    ) -> Result<(), EvaluateError> {
        let count = u[0].len();
        let lengths = [u[1].len(), out.x.len(), out.y.len(), out.z.len(), out.pdf.len()];
        if lengths != [count; 5] || out.weights.len() != count * self.count {
            return unfit(QueryError::Drawings {
                points: [count, u[1].len()],
                directions: lengths.into_iter().find(|&length| length != count).unwrap_or(count),
                weights: out.weights.len(),
                expected: count * self.count,
            });
        }
        let pairs = Pairs { index, wi, wo: None };
        wi.map_or(Ok(()), |wi| wi.check(Argument::Wi, count))?;
        let (Some((_, planes, _)), Some(columns)) = (self.material.planes(), &self.columns) else {
            return self.sample_each(pairs, u, options, &mut out);
        };
        let sampler = self.material.sampler()?;
        if !sampler.is_staged(options) {
            return self.sample_each(pairs, u, options, &mut out);
        }
        let has_cosine = self.material.quantity().has_cosine();
        let mut values = [[0.0; FEW]; BLOCK];
        let point = |i: usize| u.map(|u| f64::from(u[i]));
        sampler.draw_all(pairs, count, point, options, |start, draws, rows| {
            let end = start + rows.len();
            planes.picked_all(rows, columns, &mut values);
            let shares = draws.write(has_cosine, out.part(start, end));
            let weights = out.weights[start * self.count..end * self.count].chunks_exact_mut(self.count.max(1));
            for ((to, values), share) in weights.zip(values).zip(shares) {
                let weights = if share > 0.0 { self.weights(self.held(values), share) } else { [0.0; FEW] };
                to.iter_mut().zip(weights).for_each(|(to, weight)| *to = weight);
            }
        })
    }

    fn sample_each(
        &self,
        pairs: Pairs<'_>,
        u: [&[f32]; 2],
        options: SampleOptions,
        out: &mut Drawings<'_>,
    ) -> Result<(), EvaluateError> {
        for i in 0..u[0].len() {
            let u = u.map(|u| f64::from(u[i]));
            let drawn = self.drawn(pairs.index, pairs.wi_at(i)?, u, options)?;
            let ([x, y, z], pdf) = drawn.map_or(([0.0; 3], 0.0), |drawn| (drawn.direction.xyz(), drawn.pdf));
            (out.x[i], out.y[i], out.z[i], out.pdf[i]) = (x as f32, y as f32, z as f32, pdf as f32);
            let weights = drawn.map_or([0.0; FEW], |drawn| drawn.weights);
            out.weights[i * self.count..][..self.count].copy_from_slice(&weights[..self.count]);
        }
        Ok(())
    }

    /// Returns the weights of a drawn direction: `values` of the material's function times `share`, the ratio |cos θo|
    /// / pdf. Masked values become 0, because the sampling density treats them as dark.
    #[inline]
    fn weights(&self, mut values: [f32; FEW], share: f32) -> [f32; FEW] {
        for (value, factor) in values.iter_mut().zip(self.factors) {
            *value = if value.is_nan() && !factor.is_nan() { 0.0 } else { *value * share };
        }
        values
    }

    /// Sets values at chosen wavelengths outside the measured range to 0 (no light) or NaN (masked); leaves them if the
    /// nearest measured value holds there.
    #[inline]
    fn held(&self, mut values: [f32; FEW]) -> [f32; FEW] {
        for (value, factor) in values.iter_mut().zip(self.factors) {
            *value = if factor == 0.0 { 0.0 } else { *value * factor };
        }
        values
    }
}
