//! Sampling distribution under one incoming direction: a mixture of the trees around it and of a defensive part.
//!
//! The smooth function under an incoming direction wi lies between those of the nodes around it, with nonnegative
//! weights that sum to 1. The first coordinate of the unit square chooses a node, in proportion to its weight times the
//! light under it. That node's tree draws a direction. If lobes move with wi, the direction follows the alignment
//! ([`super::Alignment`]). The density is that of all the nodes together,
//!
//! pdf(wo) = (1 − δ) Σₖ shareₖ · pₖ(wo mapped back to node k) · dω′/dω + δ · b(wo),
//!
//! where b is proportional to the cosine over the whole domain, or uniform over a luminaire's light. An average of
//! logarithms is at most the average of values. Hence no weight f·cos/pdf exceeds the average albedo of the nodes,
//! except for light that the alignment moves towards the horizon or away from it. If every sample is kept, the nodes
//! are the cells whose mean the function is. The piecewise constant form, with its uniform density, has one node: the
//! cell of wi.

use super::background::Background;
use super::carried::{Carried, Carry, STAYING};
use super::error::{EvaluateError, QueryError, unfit};
use super::form::Form;
use super::function::Function;
use super::incoming::Around;
use super::lookup::Stencil;
use super::trees::Trees;
use super::warp::{BELOW_ONE, Density, SampleOptions};
use crate::domain::Direction;
use crate::domain::vector::Vector;

/// Maximum number of interpolation nodes around an incoming direction for materials stored as spectral coefficients.
pub(super) const FEW: usize = 3;

/// Sampling distribution under one incoming direction: a mixture of the sampling trees of the nodes around it and of a
/// defensive component.
pub(super) struct Mixture<'a> {
    trees: &'a Trees,
    function: &'a Function,
    entry: usize,
    options: SampleOptions,
    parts: Parts,
    /// Rule that moves drawn directions with their lobes, domain of outgoing directions, and queried incoming
    /// direction. `None` if drawn directions are not moved.
    carry: Option<(Carry, Vector)>,
    defensive: f64,
}

/// Sampling trees that a mixture draws from, with the probability of choosing each.
enum Parts {
    Few(Shares),
    /// Sampled incoming directions with interpolation weights, the number of the sampling tree of the axis's first
    /// incoming direction, and the sum over directions of weight times the integral of the tree's function over
    /// outgoing directions.
    Many(Stencil, usize, f64),
}

/// Incoming directions between which the function is interpolated, and the probabilities, which sum to 1, of drawing
/// from their sampling trees; 0 for unused slots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    pub(super) nodes: [u32; FEW],
    pub(super) parts: [f64; FEW],
}

/// Random choice of one of several alternatives by a number from 0 to 1. The alternatives, whose probabilities sum to
/// 1, are offered in turn.
struct Choice<T> {
    left: f64,
    /// Alternative that the random number has selected so far, among those that were offered one after the other, with
    /// the random number rescaled to 0..1 within the interval of that alternative.
    chosen: Option<(T, f64)>,
}

impl<'a> Mixture<'a> {
    #[inline(always)]
    pub(super) fn new(
        function: &'a Function,
        trees: &'a Trees,
        index: &[usize],
        wi: Option<Direction>,
        options: SampleOptions,
        carry: Option<Carry>,
    ) -> Result<Self, EvaluateError> {
        let entry = sampled_entry(function, index, options)?;
        let mut to = None;
        let parts = match (options.density, function.form()) {
            (Density::Uniform, _) => {
                Parts::Few(Shares::one(trees, entry, function.geometry().incoming_entry(wi)? as u32))
            }
            (Density::Linear, Form::Planes { smooth, .. }) => {
                let (around, wi) = function.around(smooth, None, wi)?;
                to = carry.map(|carry| (carry, wi));
                Parts::Few(Shares::around(trees, entry, &around))
            }
            (Density::Linear, Form::Samples(_)) => {
                let stencil = function.geometry().incoming_stencil(wi)?;
                let first = trees.tree(entry, 0);
                let light = |(cell, weight): (usize, f32)| f64::from(weight) * trees.warps().total(first + cell);
                let sum = stencil.entries().map(light).sum();
                Parts::Many(stencil, first, sum)
            }
        };
        let has_light = match &parts {
            Parts::Few(shares) => shares.has_light(),
            Parts::Many(.., sum) => *sum > 0.0,
        };
        let defensive = trees.defensive(entry, options, has_light);
        Ok(Self { trees, function, entry, options, parts, carry: to, defensive })
    }

    /// Number of the incoming sample (triangle or elevation) to which the incoming direction belongs, if already known.
    #[inline(always)]
    pub(super) fn incoming(&self) -> Option<usize> {
        let Parts::Few(shares) = &self.parts else { return None };
        match (self.options.density, self.function.form()) {
            (Density::Linear, Form::Planes { smooth, .. }) if !Function::knows_entry(smooth) => None,
            _ => Some(shares.nodes[0] as usize),
        }
    }

    /// Index, among all stored spectra, of that of outgoing triangle `leaf` under the incoming direction of the
    /// mixture's first sampling tree. In piecewise constant evaluation that is the sampled direction to which the
    /// queried one belongs.
    #[inline(always)]
    pub(super) fn cell(&self, leaf: usize) -> usize {
        let incoming = if let Parts::Few(shares) = &self.parts { shares.nodes[0] as usize } else { 0 };
        let [n_in, n_out, _] = self.function.geometry().shape();
        (self.entry * n_in + incoming) * n_out + leaf
    }

    /// Integral over outgoing directions of the functions that the sampling trees follow, weighted by the probabilities
    /// of drawing from each tree; 0 if all functions are 0.
    pub(super) fn light(&self) -> f64 {
        let mut sum = 0.0;
        self.each(|tree, _, share| {
            sum += share * self.trees.warps().total(tree);
            false
        });
        sum
    }

    /// Calls `work` for the sampling trees from which outgoing directions are drawn, one after the other, and stops
    /// when `work` returns true. Passes the tree's number, the number of the incoming direction for which the tree is
    /// built, and the probability of drawing from the tree.
    #[inline(always)]
    fn each(&self, mut work: impl FnMut(usize, usize, f64) -> bool) {
        match &self.parts {
            Parts::Few(shares) => {
                for (node, share) in shares.each() {
                    if work(self.trees.tree(self.entry, node as usize), node as usize, share) {
                        return;
                    }
                }
            }
            Parts::Many(stencil, first, sum) => {
                for (cell, weight) in stencil.entries() {
                    let light = f64::from(weight) * self.trees.warps().total(first + cell);
                    if light > 0.0 && work(first + cell, cell, light / sum) {
                        return;
                    }
                }
            }
        }
    }

    /// Mapping that moves outgoing directions with their lobes from incoming direction number `node` to the queried
    /// one; `None` if lobes stay in place. It holds on the side of the horizon on which an outgoing direction with z
    /// coordinate `z` lies.
    #[inline(always)]
    fn carried(&self, node: usize, z: f64) -> Option<Carried> {
        let ((alignment, domain), to) = self.carry?;
        Some(Carried::over(alignment, domain, z, self.function.node_direction(node), to))
    }

    /// Options for drawing from one of several sampling trees: those of the caller, but with no directions drawn
    /// independently of the function's values.
    #[inline(always)]
    fn own(&self) -> SampleOptions {
        SampleOptions { defensive: 0.0, ..self.options }
    }

    /// Probability density in sr⁻¹ with which the mixture, sampling trees and defensive component together, draws the
    /// direction `wo` inside the outgoing domain. For isotropic data `wo` is given with `wi` rotated to azimuth 0.
    #[inline(always)]
    pub(super) fn density(&self, wo: Direction) -> f64 {
        let (own, warps) = (self.own(), self.trees.warps());
        let mut sum = 0.0;
        self.each(|tree, node, share| {
            sum += share
                * match self.carried(node, wo.cos_theta()) {
                    Some(carried) => carried.density(wo.xyz(), |there| warps.pdf(tree, there, &own)),
                    None => warps.pdf(tree, wo, &own),
                };
            false
        });
        self.with_defence(sum, wo)
    }

    /// Density in sr⁻¹ with which `wo` is drawn, from sampling trees or by the defensive component (independently of
    /// the function's values). `trees` is the density of the sampling trees alone.
    #[inline(always)]
    fn with_defence(&self, trees: f64, wo: Direction) -> f64 {
        if self.defensive == 0.0 {
            return trees;
        }
        mixed(self.defensive, trees, self.background().pdf(self.trees.warps(), self.at(), wo))
    }

    fn background(&self) -> &'a Background {
        self.trees.background()
    }

    fn at(&self) -> (usize, Density) {
        (self.entry, self.options.density)
    }

    /// Draws a direction; also returns its leaf triangle unless the alignment of lobes between incoming directions
    /// moved the direction. `None` for a failed draw.
    #[inline(always)]
    pub(super) fn draw(&self, u: [f64; 2]) -> Option<(Direction, Option<usize>)> {
        let warps = self.trees.warps();
        let (left, is_defensive) = split(u[0], self.defensive);
        if is_defensive {
            return Some((self.background().draw(warps, self.at(), [left, u[1].min(BELOW_ONE)])?, None));
        }
        let mut choice = Choice::by(left);
        self.each(|tree, node, share| choice.is_made((tree, node), share));
        let ((tree, node), left) = choice.chosen?;
        let (left, may_stay) = if self.carry.is_some() { split(left, STAYING) } else { (left, false) };
        let drawn = warps.sample(tree, [left, u[1]], &self.own())?;
        match self.carried(node, drawn.direction.cos_theta()) {
            Some(carried) => Some((Direction::from_unit(carried.drawn(drawn.direction.xyz(), may_stay).0), None)),
            None => Some((drawn.direction, Some(drawn.leaf))),
        }
    }

    /// Point of the unit square from which [`Mixture::draw`] draws the direction `wo`. Of several points it is the one
    /// for the first of the mixture's sampling trees that can draw `wo`. If none can, it is the one at which `wo` is
    /// drawn independently of the function's values.
    pub(super) fn invert(&self, wo: Direction) -> Option<[f64; 2]> {
        let (own, warps) = (self.own(), self.trees.warps());
        let (mut start, mut found) = (0.0, None);
        self.each(|tree, node, share| {
            let point = match self.carried(node, wo.cos_theta()) {
                Some(carried) => {
                    let (there, part, staying) = carried.origin(wo.xyz());
                    let carrying = 1.0 - STAYING;
                    let from = warps.invert(tree, Direction::from_unit(there), &own).filter(|_| part > 0.0);
                    from.map(|[u, v]| [carrying * u, v]).or_else(|| {
                        let [u, v] = warps.invert(tree, wo, &own).filter(|_| staying > 0.0)?;
                        Some([carrying + STAYING * u, v])
                    })
                }
                None => warps.invert(tree, wo, &own),
            };
            found = point.map(|[u, v]| [(1.0 - self.defensive) * (start + share * u), v]);
            start += share;
            found.is_some()
        });
        if found.is_some() || self.defensive == 0.0 {
            return found;
        }
        let [u, v] = self.background().place(warps, self.at(), wo)?;
        Some([(1.0 - self.defensive) + self.defensive * u, v])
    }
}

/// Checks the sampling options. Returns the row-major number of the query's indices among all combinations of positions
/// on the axes before those of directions and wavelength.
#[inline]
pub(super) fn sampled_entry(
    function: &Function,
    index: &[usize],
    options: SampleOptions,
) -> Result<usize, EvaluateError> {
    if !(0.0..1.0).contains(&options.defensive) {
        return unfit(QueryError::Defensive { found: options.defensive });
    }
    function.geometry().entry(index)
}

/// Splits the interval 0..1 in two, the second part of length `second`. Returns the relative position, 0 to 1, of `u`
/// in the part that contains it, and true if that is the second part.
#[inline(always)]
pub(super) fn split(u: f64, second: f64) -> (f64, bool) {
    let first = 1.0 - second;
    let is_second = u >= first && second > 0.0;
    let left = if is_second { (u - first) / second } else { u / first };
    (left.min(BELOW_ONE), is_second)
}

/// Sampling density of a mixture, from the density `trees` of its sampling trees and the density `background` of its
/// defensive component, which has the fraction `defensive` of the samples.
#[inline(always)]
pub(super) fn mixed(defensive: f64, trees: f64, background: f64) -> f64 {
    (1.0 - defensive) * trees + defensive * background
}

impl<T> Choice<T> {
    #[inline(always)]
    fn by(u: f64) -> Self {
        Self { left: u, chosen: None }
    }

    /// Offers the next alternative of a random choice, which takes up the length `share` of the interval 0..1. Returns
    /// true if the random number lies in that part. If rounding puts the number beyond the last part, the last
    /// alternative is chosen.
    #[inline(always)]
    fn is_made(&mut self, offered: T, share: f64) -> bool {
        self.chosen = Some((offered, (self.left / share).min(BELOW_ONE)));
        self.left -= share;
        self.left < 0.0
    }
}

impl Shares {
    /// Empty selection of sampling trees: the probability of drawing from each is 0.
    pub(super) const NONE: Self = Self { nodes: [0; FEW], parts: [0.0; FEW] };

    /// Selects the sampling tree of a single incoming direction, with probability 1; with probability 0 if the tree's
    /// function is 0 in all outgoing directions.
    #[inline(always)]
    pub(super) fn one(trees: &Trees, entry: usize, node: u32) -> Self {
        let has_light = trees.warps().total(trees.tree(entry, node as usize)) > 0.0;
        Self { nodes: [node, 0, 0], parts: [if has_light { 1.0 } else { 0.0 }, 0.0, 0.0] }
    }

    /// Probabilities of drawing from the sampling trees of the incoming directions around a queried one, in proportion
    /// to interpolation weight times the integral of the tree's function. All are 0 if all integrals are 0.
    #[inline(always)]
    pub(super) fn around(trees: &Trees, entry: usize, &Around { nodes, weights, .. }: &Around) -> Self {
        let first = trees.tree(entry, 0);
        let mut parts = weights.map(f64::from);
        for (part, node) in parts.iter_mut().zip(nodes) {
            *part *= trees.warps().total(first + node as usize);
        }
        let sum = parts[0] + parts[1] + parts[2];
        let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        Self { nodes, parts: parts.map(|part| part * scale) }
    }

    /// Numbers of the incoming directions whose sampling trees are drawn from with nonzero probability, with that
    /// probability.
    #[inline(always)]
    fn each(&self) -> impl Iterator<Item = (u32, f64)> {
        self.nodes.into_iter().zip(self.parts).filter(|(_, share)| *share > 0.0)
    }

    /// Chooses one of the incoming directions around a query by a random number `u` from 0 to 1, to draw from its
    /// sampling tree, and puts it first in the list. Returns `u` rescaled to 0..1 within the interval of the chosen
    /// one.
    #[inline(always)]
    pub(super) fn choose(&mut self, u: f64) -> f64 {
        let mut choice = Choice::by(u);
        for (k, &share) in self.parts.iter().enumerate() {
            if share > 0.0 && choice.is_made(k, share) {
                break;
            }
        }
        let Some((k, left)) = choice.chosen else { return u };
        self.nodes.swap(0, k);
        self.parts.swap(0, k);
        left
    }

    #[inline(always)]
    pub(super) fn has_light(&self) -> bool {
        self.parts[0] + self.parts[1] + self.parts[2] > 0.0
    }
}
