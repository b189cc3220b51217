//! Importance sampling of a function's outgoing directions, one at a time (\[CPB06\] section 6.1.2, with a mixture of trees
//! for one).
//!
//! [`super::mixture`] has what is drawn from, [`super::warp`] how a tree draws and what is continuous. A linear density goes
//! with the smooth form, a uniform one with the piecewise constant form. With a defensive part, which is the default, the
//! density is positive wherever the function is: without one by choice, light may be left out that no tree expects. Nothing is
//! drawn where the function is masked.

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

/// One importance sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionSample {
    /// The direction drawn: `wo`.
    pub direction: Direction,
    /// Its probability density, sr⁻¹.
    pub pdf: f64,
    /// f · |cos θo| / pdf for a BRDF, BTDF or BSDF, f / pdf otherwise; f is the mean over wavelengths (of the samples that
    /// are not masked; 0 where that mean is negative): piecewise constant where the density is, otherwise smooth.
    pub weight: f64,
}

impl DirectionSample {
    /// A sample where the mean over wavelengths is `value`, NaN where all are masked.
    #[inline]
    pub(super) fn weighted(quantity: Quantity, direction: Direction, pdf: f64, value: f32) -> Self {
        let cosine = if quantity.has_cosine() { direction.cos_theta().abs() } else { 1.0 };
        Self { direction, pdf, weight: f64::from(value).max(0.0) * cosine / pdf }
    }
}

/// A function and the trees that its directions are drawn from.
#[derive(Clone, Copy)]
pub(super) struct Sampler<'a> {
    function: &'a Function,
    /// The lobe beside the function, and its colour by the weights of the trees.
    lobe: Option<(&'a Lobed, f32)>,
    trees: &'a Trees,
}

impl<'a> Sampler<'a> {
    #[inline]
    pub(super) fn new(function: &'a Function, lobe: Option<&'a Lobed>, trees: &'a Trees) -> Self {
        Self { function, lobe: lobe.map(|lobe| (lobe, lobe.colour(trees.weights()))), trees }
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

    /// Returns true where directions are drawn from a lobe, too.
    #[inline]
    pub(super) fn has_lobe(&self) -> bool {
        self.lobe.is_some()
    }

    /// The lobe under `wi`, beside the trees of a mixture.
    #[inline]
    fn lobe_beside(&self, mixture: &Mixture<'_>, wi: Option<Direction>) -> Option<LobePart> {
        let (lobe, colour) = self.lobe?;
        lobe.part(wi, colour, mixture.light())
    }

    /// Returns true where the function is masked, so that nothing is drawn.
    #[inline]
    fn is_masked(&self, place: Place<'_>, options: SampleOptions) -> Result<bool, EvaluateError> {
        Ok(self.trees.has_masked() && !self.function.is_known(place, form_of(options))?)
    }

    /// A direction, its density and weight; `None` where nothing is drawn.
    pub(super) fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        let Some(Draw { direction, pdf, .. }) = self.drawn(index, wi, u, options)? else { return Ok(None) };
        let place = Place { index, wi, wo: Some(direction) };
        let mut value = self.function.weighted_known(place, form_of(options), self.trees.weights())?;
        if let Some((lobe, _)) = self.lobe {
            value += lobe.weighted(place, self.trees.weights());
        }
        Ok(Some(DirectionSample::weighted(self.function.geometry().quantity(), direction, pdf, value)))
    }

    /// The same for the function of samples on a grid of angles, whose averages over triangles the directions are drawn from.
    pub(super) fn sample_of(
        &self,
        stated: &Stated,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        options: SampleOptions,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        let turning = stated.turning(wi);
        let wi = if turning.is_some() { Some(Turning::up()) } else { wi };
        let drawn = self.drawn_with(index, wi, u, options, |place, how, _, _| {
            stated.weighted_known(place, how, self.trees.weights())
        })?;
        let quantity = self.function.geometry().quantity();
        Ok(drawn.map(|(direction, pdf, value)| {
            let direction = turning.map_or(direction, |turning| turning.outward(direction));
            DirectionSample::weighted(quantity, direction, pdf, value)
        }))
    }

    /// [`Sampler::sample_of`] for each incoming direction of `pairs` and point; what is refused ends it.
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
            *out = self.sample_of(stated, pairs.index, pairs.wi_at(i)?, u, options)?;
        }
        Ok(())
    }

    /// A direction, its density, and what `value` makes of where the function is taken: the
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
        // The last corner of a triangle, of no measure, may have no density.
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

    /// A direction of the lobe or of the trees beside it.
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

    /// The density with which directions are drawn; 0 where nothing is.
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

    /// A point of the unit square that leads to a direction.
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

    /// A direction and its density alone.
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

/// A direction that was drawn, its density, and what is known of where the function is taken: the entry of the incoming axis
/// and the cell.
struct Draw {
    direction: Direction,
    pdf: f64,
    incoming: Option<usize>,
    cell: Option<usize>,
}

/// The form of the function that goes with a density.
pub(super) fn form_of(options: SampleOptions) -> Interpolation {
    match options.density {
        Density::Uniform => Interpolation::Constant,
        Density::Linear => Interpolation::Smooth,
    }
}

/// Refuses what is no point of the unit square.
pub(super) fn check_point(u: [f64; 2]) -> Result<(), EvaluateError> {
    if u.iter().all(|u| (0.0..=1.0).contains(u)) {
        return Ok(());
    }
    unfit(QueryError::Point { u })
}
