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

/// Up to [`Chosen::MOST`] wavelengths of a material; made by [`Material::choose`].
#[derive(Clone, Debug)]
pub struct Chosen<'a> {
    material: &'a Material,
    beyond: Beyond,
    count: usize,
    wavelengths: [f64; FEW],
    /// Factor on each sample: 1 inside the measured range; outside 1, 0 or NaN according to `beyond`.
    factors: [f32; FEW],
    columns: Option<Columns>,
}

/// A drawn direction with its weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChosenSample {
    /// Drawn direction.
    pub direction: Direction,
    /// Density of the direction in sr⁻¹.
    pub pdf: f64,
    /// f · |cos θo| / pdf at the chosen wavelengths, in their order; 0 where f is masked, NaN outside the measured
    /// range under [`Beyond::Masked`].
    pub weights: [f32; Chosen::MOST],
}

/// Output buffers for drawn directions, their densities and weights: one entry for each point, `weights` as
/// `[point][wavelength]`. A failed draw leaves 0 in all of them.
#[derive(Debug)]
pub struct Drawings<'a> {
    /// Components towards the reference direction (azimuth 0).
    pub x: &'a mut [f32],
    /// Components perpendicular to x and z.
    pub y: &'a mut [f32],
    /// Components along the normal.
    pub z: &'a mut [f32],
    /// Densities in sr⁻¹.
    pub pdf: &'a mut [f32],
    /// Weights f · |cos θo| / pdf.
    pub weights: &'a mut [f32],
}

impl Drawings<'_> {
    /// Coordinates and densities of the points `from..to`.
    fn part(&mut self, from: usize, to: usize) -> [&mut [f32]; 4] {
        [&mut self.x[from..to], &mut self.y[from..to], &mut self.z[from..to], &mut self.pdf[from..to]]
    }
}

impl Material {
    /// Chooses up to [`Chosen::MOST`] wavelengths in nm. Spectra are linear between samples; outside the measured range
    /// `beyond` applies. Fails for RGB and monochromatic data, which have no wavelengths.
    pub fn choose(&self, wavelengths: &[f64], beyond: Beyond) -> Result<Chosen<'_>, EvaluateError> {
        let Some(grid) = self.geometry().grid() else {
            return unfit(QueryError::NoWavelengths { quantity: self.quantity() });
        };
        if wavelengths.len() > Chosen::MOST {
            return unfit(QueryError::TooManyWavelengths { found: wavelengths.len(), most: Chosen::MOST });
        }
        Ok(self.chosen(grid, wavelengths, beyond))
    }

    /// Writes the values at `wavelengths` (nm, any number) and `pairs` into `out`, `[pair][wavelength]`, on the calling
    /// thread. Does not allocate. Stops at the first refused pair. Agrees with [`Material::at_wavelengths`] within the
    /// tolerance that the [rules](super#rules) give for batches.
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

    /// Chooses up to [`Chosen::MOST`] wavelengths of a grid.
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
    /// Maximum number of wavelengths.
    pub const MOST: usize = FEW;

    /// Chosen wavelengths in nm.
    pub fn wavelengths(&self) -> &[f64] {
        &self.wavelengths[..self.count]
    }

    /// Returns the values at a place, in the order of the wavelengths and padded with 0, like
    /// [`Material::at_wavelengths`].
    pub fn at(&self, place: Place<'_>, how: Interpolation) -> Result<[f32; Chosen::MOST], EvaluateError> {
        self.at_known(place, how, None)
    }

    /// Like [`Chosen::at`], but accepts an already located entry of the incoming axis.
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

    /// Writes the values at `pairs` into `out`, `[pair][wavelength]`, as [`Chosen::at`] gives them, on the calling
    /// thread.
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

    /// Writes the values of a block of rows of planes, each to the start of its slice in `out`.
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

    /// Draws a direction like [`Material::sample`], by the mean over all wavelengths. The weight of each chosen
    /// wavelength is f · |cos θo| / pdf, without the cosine for emission and phase functions. A uniform density goes
    /// with the piecewise constant form, a linear one with the smooth form.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<ChosenSample>, EvaluateError> {
        self.drawn(index, wi, u, options.into())
    }

    /// Not generic: compiled once in this crate rather than in every crate that draws.
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

    /// Runs [`Chosen::sample`] for each incoming direction `wi` and point u of the unit square, on the calling thread.
    /// `wi` has one direction for each point; `None` for quantities without. Does not allocate. Stops at the first
    /// refused point.
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

    /// Not generic, for the reason that [`Chosen::drawn`] has.
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

    /// Multiplies values by `share`; masked ones become 0, as the sampling density takes them.
    #[inline]
    fn weights(&self, mut values: [f32; FEW], share: f32) -> [f32; FEW] {
        for (value, factor) in values.iter_mut().zip(self.factors) {
            *value = if value.is_nan() && !factor.is_nan() { 0.0 } else { *value * share };
        }
        values
    }

    /// Applies `beyond` to values outside the measured range.
    #[inline]
    fn held(&self, mut values: [f32; FEW]) -> [f32; FEW] {
        for (value, factor) in values.iter_mut().zip(self.factors) {
            *value = if factor == 0.0 { 0.0 } else { *value * factor };
        }
        values
    }
}
