//! A few wavelengths chosen once, as a renderer does for a path, and used for many places.

use super::batch::BLOCK;
use super::material::Form;
use super::planes::{Columns, FEW};
use super::{Beyond, EvaluateError, Interpolation, Material, Pairs, Place, SampleOptions, unfit};
use crate::domain::Direction;

/// Up to [`Chosen::MOST`] wavelengths of a material; made by [`Material::choose`].
#[derive(Clone, Debug)]
pub struct Chosen<'a> {
    pub(super) material: &'a Material,
    beyond: Beyond,
    count: usize,
    wavelengths: [f64; FEW],
    /// What samples are multiplied with: 1, and outside the measured range what `beyond` makes of it.
    factors: [f32; FEW],
    columns: Option<Box<Columns>>,
}

/// A direction that was drawn, with its weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChosenSample {
    /// The direction.
    pub direction: Direction,
    /// Its density in sr⁻¹.
    pub pdf: f64,
    /// f · |cos θo| / pdf at the chosen wavelengths, in their order.
    pub weights: [f32; Chosen::MOST],
}

impl Material {
    /// Chooses up to [`Chosen::MOST`] wavelengths in nm, linear between the samples of spectra, outside the measured range as
    /// `beyond` says. RGB and monochromatic data are refused: they have no wavelengths. This allocates; what is chosen does not.
    pub fn choose(&self, wavelengths: &[f64], beyond: Beyond) -> Result<Chosen<'_>, EvaluateError> {
        let Some(grid) = self.grid() else {
            return unfit(format!("wavelengths were asked for, but this {} has none", self.quantity()));
        };
        if wavelengths.len() > Chosen::MOST {
            return unfit(format!("{} wavelengths, expected at most {}", wavelengths.len(), Chosen::MOST));
        }
        let (first, last) = grid.range();
        let mut chosen = Chosen {
            material: self,
            beyond,
            count: wavelengths.len(),
            wavelengths: [first; FEW],
            factors: [1.0; FEW],
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
        if let Form::Planes { planes, .. } = &self.form {
            chosen.columns = Some(Box::new(planes.columns(&chosen.wavelengths.map(|lambda| grid.position(lambda)))));
        }
        Ok(chosen)
    }
}

impl Chosen<'_> {
    /// The most wavelengths.
    pub const MOST: usize = FEW;

    /// Those that were chosen, in nm.
    pub fn wavelengths(&self) -> &[f64] {
        &self.wavelengths[..self.count]
    }

    /// The values at a place, in the order of the wavelengths; 0 beyond them. As [`Material::at_wavelengths`].
    #[inline]
    pub fn at(&self, place: Place<'_>, how: Interpolation) -> Result<[f32; Chosen::MOST], EvaluateError> {
        let (Form::Planes { planes, smooth }, Some(columns)) = (&self.material.form, &self.columns) else {
            let mut out = [0.0; FEW];
            self.material.at_wavelengths(place, how, self.beyond, self.wavelengths(), &mut out[..self.count])?;
            return Ok(out);
        };
        self.material.with_row(planes, smooth, place, how, |row, presence| {
            let mut values = [presence; FEW];
            if presence > 0.0 {
                values = planes.picked(row, presence, columns);
            }
            self.held(values)
        })
    }

    /// The values at `pairs` into `out`, `[pair][wavelength]`, as [`Chosen::at`] gives them, on the calling thread.
    pub fn values(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        let count = pairs.check(out.len(), self.count)?;
        let (Form::Planes { planes, smooth }, Some(columns)) = (&self.material.form, &self.columns) else {
            let mut rows = out.chunks_exact_mut(self.count).enumerate();
            return rows.try_for_each(|(i, out)| {
                out.copy_from_slice(&self.at(pairs.place(i)?, how)?[..self.count]);
                Ok(())
            });
        };
        let mut values = [[0.0; FEW]; BLOCK];
        self.material.rows(planes, smooth, pairs, how, count, |start, rows| {
            planes.picked_all(rows, columns, &mut values);
            let out = out[start * self.count..].chunks_exact_mut(self.count);
            for (out, values) in out.zip(&values[..rows.len()]) {
                for (out, value) in out.iter_mut().zip(self.held(*values)) {
                    *out = value;
                }
            }
        })
    }

    /// Draws a direction as [`Material::sample`] does, by the mean over all wavelengths, with the weight of each chosen one:
    /// f · |cos θo| / pdf (without the cosine for emission and phase functions). A uniform density goes with the piecewise
    /// constant form, a linear one with the smooth form.
    #[inline]
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: impl Into<SampleOptions>,
    ) -> Result<Option<ChosenSample>, EvaluateError> {
        let Some((drawn, values)) =
            self.material.drawn_with(index, wi, u, options.into(), |place, how, cell| {
                match (&self.material.form, &self.columns, cell) {
                    (Form::Planes { planes, .. }, Some(columns), Some(cell)) if planes.presence(cell) > 0.0 => {
                        Ok(self.held(planes.picked(planes.row(cell), 1.0, columns)))
                    }
                    _ => self.at(place, how),
                }
            })?
        else {
            return Ok(None);
        };
        let (direction, pdf) = drawn;
        let cosine = if self.material.quantity().has_cosine() { direction.cos_theta().abs() } else { 1.0 };
        let share = (cosine / pdf) as f32;
        Ok(Some(ChosenSample { direction, pdf, weights: values.map(|value| value * share) }))
    }

    /// Values with what is outside the measured range as it was asked for.
    #[inline]
    fn held(&self, mut values: [f32; FEW]) -> [f32; FEW] {
        for (value, factor) in values.iter_mut().zip(self.factors) {
            *value = if factor == 0.0 { 0.0 } else { *value * factor };
        }
        values
    }
}
