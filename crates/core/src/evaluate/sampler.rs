//! Importance sampling of a function's outgoing directions, one at a time (\[CPB06\] section 6.1.2, with a mixture of
//! trees instead of one).
//!
//! [`super::mixture`] defines the distribution, [`super::warp`] sampling from one tree and its continuity. A linear
//! density goes with the smooth form, a uniform one with the piecewise constant form. With a defensive part, the
//! default, the density is positive wherever the function is. Without it, light that no tree expects may be missed. No
//! direction is drawn where the function is masked.

use super::directions::Pairs;
use super::error::{Argument, Buffer, EvaluateError, QueryError, unfit};
use super::function::Function;
use super::lobed::{LobePart, Lobed};
use super::mixture::Mixture;
use super::place::{Interpolation, Place};
use super::stated::Stated;
use super::trees::Trees;
use super::turning::Turning;
use super::warp::{Density, SampleOptions};
use crate::domain::{Direction, Quantity};
use crate::numeric::wide;

/// Outgoing direction drawn by importance sampling, with density and weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionSample {
    /// Drawn outgoing direction `wo`.
    pub direction: Direction,
    /// Probability density of the drawn direction in sr⁻¹.
    pub pdf: f64,
    /// Weight f · |cos θo| / pdf for a BRDF, BTDF or BSDF, f / pdf otherwise. f is the material's function, averaged
    /// over the wavelengths that are not masked, or 0 if that mean is negative. f is piecewise constant in the
    /// directions for [`Density::Uniform`](super::Density::Uniform), otherwise smoothly interpolated.
    pub weight: f64,
}

impl DirectionSample {
    /// Returns a drawn direction with its weight f · |cos θo| / pdf, or f / pdf for a quantity without a cosine factor.
    /// `value` is f, averaged over wavelengths; if it is negative or NaN (masked), the weight is 0.
    #[inline]
    pub(super) fn weighted(quantity: Quantity, direction: Direction, pdf: f64, value: f32) -> Self {
        let cosine = if quantity.has_cosine() { direction.cos_theta().abs() } else { 1.0 };
        Self { direction, pdf, weight: f64::from(value).max(0.0) * cosine / pdf }
    }
}

/// Function of a material and the sampling trees from which outgoing directions are drawn.
#[derive(Clone, Copy)]
pub(super) struct Sampler<'a> {
    function: &'a Function,
    /// Analytic lobe that evaluation adds to the function of the samples, and the lobe's colour (factor on its shape)
    /// under the spectral weights that drive sampling.
    lobe: Option<(&'a Lobed, f32)>,
    trees: &'a Trees,
}

impl<'a> Sampler<'a> {
    #[inline]
    pub(super) fn new(function: &'a Function, lobe: Option<(&'a Lobed, f32)>, trees: &'a Trees) -> Self {
        Self { function, lobe, trees }
    }

    #[inline]
    pub(super) fn function(&self) -> &'a Function {
        self.function
    }

    #[inline]
    pub(super) fn trees(&self) -> &'a Trees {
        self.trees
    }

    #[inline(always)]
    fn mixture(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        options: SampleOptions,
    ) -> Result<Mixture<'a>, EvaluateError> {
        Mixture::new(self.function, self.trees, index, wi, options, self.trees.carry(options.density))
    }

    /// Returns true if directions are also drawn from an analytic lobe.
    #[inline]
    pub(super) fn has_lobe(&self) -> bool {
        self.lobe.is_some()
    }

    /// Analytic lobe for the incoming direction `wi`, from which outgoing directions are drawn in addition to the
    /// sampled data.
    #[inline]
    fn lobe_beside(&self, mixture: &Mixture<'_>, wi: Option<Direction>) -> Option<LobePart> {
        let (lobe, colour) = self.lobe?;
        lobe.part(wi, colour, mixture.light())
    }

    /// Returns true if the function is masked for a pair of directions, so that the outgoing direction must not be
    /// drawn.
    #[inline]
    fn is_masked(&self, place: Place<'_>, options: SampleOptions) -> Result<bool, EvaluateError> {
        Ok(self.trees.has_masked() && !self.function.is_known(place, form_of(options))?)
    }

    /// Draws an outgoing direction with its density and weight; `None` for a failed draw.
    pub(super) fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        let Some(Draw { direction, pdf, .. }) = self.drawn(index, wi, u, options)? else { return Ok(None) };
        let place = Place { index, wi, wo: Some(direction) };
        let (form, weights) = (form_of(options), self.trees.weights());
        let value = match self.lobe {
            None => self.function.weighted_known(place, form, weights)?,
            Some((lobe, _)) => self.function.weighted_known_beside(place, form, weights, lobe.at(place))?,
        };
        Ok(Some(DirectionSample::weighted(self.function.geometry().quantity(), direction, pdf, value)))
    }

    /// Like [`Sampler::sample`], for samples on a grid of angles. Directions are drawn by averages over triangles; the
    /// weight uses the function interpolated on the grid, with the spectral weights beside it or the mean over
    /// wavelengths.
    pub(super) fn sample_of(
        &self,
        (stated, weights): (&Stated, Option<&[f32]>),
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        let turning = stated.turning(wi);
        let wi = if turning.is_some() { Some(Turning::up()) } else { wi };
        let value =
            |place: Place<'_>, how, _: Option<usize>, _: Option<usize>| stated.weighted_known(place, how, weights);
        let drawn = self.drawn_with(index, wi, u, options, value)?;
        let quantity = self.function.geometry().quantity();
        Ok(drawn.map(|(direction, pdf, value)| {
            let direction = turning.map_or(direction, |turning| turning.outward(direction));
            DirectionSample::weighted(quantity, direction, pdf, value)
        }))
    }

    /// Runs [`Sampler::sample_of`] for each incoming direction of `pairs` and point of the unit square; stops at the
    /// first invalid one.
    pub(super) fn samples_of(
        &self,
        stated: &Stated,
        pairs: Pairs<'_>,
        u: &[[f64; 2]],
        options: SampleOptions,
        out: &mut [Option<DirectionSample>],
    ) -> Result<(), EvaluateError> {
        let count = u.len();
        pairs.wi.map_or(Ok(()), |wi| wi.check(Argument::Wi, count))?;
        Buffer::Samples.check(out.len(), count)?;
        for (i, (out, &u)) in out.iter_mut().zip(u).enumerate() {
            *out = self.sample_of((stated, None), pairs.index, pairs.wi_at(i)?, u, options)?;
        }
        Ok(())
    }

    /// Draws an outgoing direction. Returns it with its probability density in sr⁻¹ and a result that the caller's
    /// function `value` computes, such as the function value there. `value` receives the pair of directions, the
    /// interpolation and, if known, the indices of the tabulated incoming direction and of the spectrum.
    #[inline(always)]
    pub(super) fn drawn_with<T>(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
        value: impl FnOnce(Place<'_>, Interpolation, Option<usize>, Option<usize>) -> Result<T, EvaluateError>,
    ) -> Result<Option<(Direction, f64, T)>, EvaluateError> {
        let Some(drawn) = self.drawn(index, wi, u, options)? else { return Ok(None) };
        let place = Place { index, wi, wo: Some(drawn.direction) };
        let value = value(place, form_of(options), drawn.incoming, drawn.cell)?;
        Ok(Some((drawn.direction, drawn.pdf, value)))
    }

    #[inline(always)]
    fn drawn(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<Draw>, EvaluateError> {
        let mixture = self.mixture(index, wi, options)?;
        check_point(u)?;
        if let Some(lobe) = self.lobe_beside(&mixture, wi) {
            return self.drawn_beside(&mixture, &lobe, (index, wi), u, options);
        }
        let Some((wo, leaf)) = mixture.draw(u) else { return Ok(None) };
        let pdf = mixture.density(wo);
        // The last corner of a triangle, a null set, may have density 0.
        if pdf <= 0.0 {
            return Ok(None);
        }
        let direction = self.function.geometry().turned_with(wi, wo);
        if self.is_masked(Place { index, wi, wo: Some(direction) }, options)? {
            return Ok(None);
        }
        let cell = leaf.filter(|_| options.density == Density::Uniform).map(|leaf| mixture.cell(leaf));
        Ok(Some(Draw { direction, pdf, incoming: mixture.incoming(), cell }))
    }

    /// Draws a direction from a mixture of the analytic lobe and the sampling trees.
    fn drawn_beside(
        &self,
        mixture: &Mixture<'_>,
        lobe: &LobePart,
        (index, wi): (&[usize], Option<Direction>),
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<Draw>, EvaluateError> {
        let geometry = self.function.geometry();
        let direction = match lobe.drawn(u) {
            Ok(direction) => direction,
            Err(u) => match mixture.draw(u) {
                Some((wo, _)) => geometry.turned_with(wi, wo),
                None => return Ok(None),
            },
        };
        let Some((_, wo)) = geometry.outgoing(wi, Some(direction))? else { return Ok(None) };
        let pdf = lobe.density(direction, mixture.density(wo));
        if pdf <= 0.0 || self.is_masked(Place { index, wi, wo: Some(direction) }, options)? {
            return Ok(None);
        }
        Ok(Some(Draw { direction, pdf, incoming: None, cell: None }))
    }

    /// Density in sr⁻¹ with which the outgoing direction `wo` is drawn; 0 if it is never drawn.
    pub(super) fn pdf(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: SampleOptions,
    ) -> Result<f64, EvaluateError> {
        let pdf = wide(
            #[inline(always)]
            || -> Result<f64, EvaluateError> {
                let mixture = self.mixture(index, wi, options)?;
                let asked = wo;
                let Some((lookup, wo)) = self.function.geometry().outgoing(wi, Some(wo))? else { return Ok(0.0) };
                if !lookup.holds(wo.xyz()) {
                    return Ok(0.0);
                }
                let cells = mixture.density(wo);
                Ok(self.lobe_beside(&mixture, wi).map_or(cells, |lobe| lobe.density(asked, cells)))
            },
        )?;
        let is_drawn = pdf > 0.0 && !self.is_masked(Place { index, wi, wo: Some(wo) }, options)?;
        Ok(if is_drawn { pdf } else { 0.0 })
    }

    /// Point of the unit square that draws `wo`; `None` if its density is 0.
    pub(super) fn invert(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        options: SampleOptions,
    ) -> Result<Option<[f64; 2]>, EvaluateError> {
        if self.pdf(index, wi, wo, options)? <= 0.0 {
            return Ok(None);
        }
        let mixture = self.mixture(index, wi, options)?;
        let asked = wo;
        let Some((_, wo)) = self.function.geometry().outgoing(wi, Some(wo))? else { return Ok(None) };
        let Some(lobe) = self.lobe_beside(&mixture, wi) else { return Ok(mixture.invert(wo)) };
        Ok(lobe.point_of(asked).or_else(|| mixture.invert(wo).map(|point| lobe.of_cells(point))))
    }

    /// Draws a random outgoing direction by importance sampling. Returns it with its probability density in sr⁻¹,
    /// without the weight f · |cos θo| / pdf.
    pub(super) fn draw(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<(Direction, f64)>, EvaluateError> {
        let drawn = self.drawn(index, wi, u, options)?;
        Ok(drawn.map(|drawn| (drawn.direction, drawn.pdf)))
    }
}

/// Drawn direction and its density, with the numbers of the incoming sample and of the spectrum if known.
struct Draw {
    direction: Direction,
    pdf: f64,
    incoming: Option<usize>,
    cell: Option<usize>,
}

/// Interpolation that belongs to a sampling density: piecewise constant for a uniform density, smooth for a linear one.
pub(super) fn form_of(options: SampleOptions) -> Interpolation {
    match options.density {
        Density::Uniform => Interpolation::Constant,
        Density::Linear => Interpolation::Smooth,
    }
}

/// Fails if `u` is not a point of the unit square.
pub(super) fn check_point(u: [f64; 2]) -> Result<(), EvaluateError> {
    if u.iter().all(|u| (0.0..=1.0).contains(u)) {
        return Ok(());
    }
    unfit(QueryError::Point { u })
}
