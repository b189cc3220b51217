//! What directions are drawn from under one incoming direction: a mixture of the trees around it and of a defensive part.
//!
//! The smooth function under an incoming direction wi stands between those of the nodes around it, with weights that are not
//! negative and add up to 1. The first coordinate of the unit square chooses a node, by its weight times the light under it;
//! that node's tree draws a direction; where lobes move with wi it is carried along ([`super::Alignment`]). The density is
//! that of all the nodes together,
//!
//! pdf(wo) = (1 − δ) Σₖ shareₖ · pₖ(wo carried back to node k) · dω′/dω + δ · b(wo),
//!
//! with b by the cosine over the whole domain, or uniform over a luminaire's light. An average of logarithms is at most the
//! average of values, so no weight f·cos/pdf exceeds what the nodes reflect on average but for light that carrying brings
//! nearer to the horizon or further from it. Where every sample is kept the nodes are the cells whose mean the function is. The
//! piecewise constant form, with its uniform density, has one node: the cell of wi.

use super::background::Background;
use super::carried::{Carried, STAYING};
use super::incoming::Alignment;
use super::lookup::Stencil;
use super::material::Form;
use super::trees::Trees;
use super::warp::{BELOW_ONE, Density, SampleOptions};
use super::{EvaluateError, Material};
use crate::domain::vector::Vector;
use crate::domain::{Direction, Domain};

/// Nodes that are around a direction, but where every sample is kept.
pub(super) const FEW: usize = 3;

/// The mixture under an incoming direction.
pub(super) struct Mixture<'a> {
    trees: &'a Trees,
    material: &'a Material,
    entry: usize,
    options: SampleOptions,
    parts: Parts,
    /// How directions are carried, over which domain, and to which incoming direction.
    carry: Option<(Alignment, Domain, Vector)>,
    defensive: f64,
}

/// The trees of a mixture.
enum Parts {
    Few(Shares),
    /// Cells, the trees' number of the first one, and what their weights times their light add up to, over the part of trees.
    Many(Stencil, usize, f64),
}

/// Trees and their shares, which add up to the part of trees; 0 beyond those that there are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    pub(super) nodes: [u32; FEW],
    pub(super) parts: [f64; FEW],
    pub(super) count: usize,
}

impl<'a> Mixture<'a> {
    #[inline(always)]
    pub(super) fn new(
        material: &'a Material,
        trees: &'a Trees,
        index: &[usize],
        wi: Option<Direction>,
        options: SampleOptions,
        carries: bool,
    ) -> Result<Self, EvaluateError> {
        let entry = material.sampled_entry(index, options)?;
        let defensive = if trees.background().has_any(entry, options.density) { options.defensive } else { 0.0 };
        let mut mixture =
            Self { trees, material, entry, options, parts: Parts::Few(Shares::NONE), carry: None, defensive };
        match (options.density, &material.form) {
            (Density::Uniform, _) => {
                let nodes = [material.incoming_entry(wi)? as u32, 0, 0];
                let shares = Shares::new(trees, entry, nodes, [1.0, 0.0, 0.0], 1);
                mixture.parts = Parts::Few(shares);
            }
            (Density::Linear, Form::Planes { smooth, .. }) => {
                let (around, wi) = material.around(smooth, None, wi)?;
                let weights = around.weights.map(f64::from);
                mixture.parts = Parts::Few(Shares::new(trees, entry, around.nodes, weights, around.count));
                if carries {
                    mixture.carry = material.aligned_domain().map(|(alignment, domain)| (alignment, domain, wi));
                }
            }
            (Density::Linear, Form::Samples { .. }) => {
                let stencil = material.incoming_stencil(wi)?;
                let first = trees.tree(entry, 0);
                let light = |(cell, weight): (usize, f32)| f64::from(weight) * trees.warps().total(first + cell);
                let sum = stencil.entries().map(light).sum();
                mixture.parts = Parts::Many(stencil, first, sum);
            }
        }
        mixture.settle();
        Ok(mixture)
    }

    /// Leaves all to the defensive part where no tree has light.
    #[inline(always)]
    fn settle(&mut self) {
        let has_light = match &self.parts {
            Parts::Few(shares) => shares.has_light(),
            Parts::Many(.., sum) => *sum > 0.0,
        };
        if !has_light {
            self.defensive = if self.defensive > 0.0 { 1.0 } else { 0.0 };
        }
    }

    /// The entry of the incoming axis that holds the direction, where that is known.
    #[inline(always)]
    pub(super) fn incoming(&self) -> Option<usize> {
        let Parts::Few(shares) = &self.parts else { return None };
        match (self.options.density, &self.material.form) {
            (Density::Linear, Form::Planes { smooth, .. }) if !Material::knows_entry(smooth) => None,
            _ => Some(shares.nodes[0] as usize),
        }
    }

    /// The cell of a leaf under the first node, which is that of the piecewise constant form.
    #[inline(always)]
    pub(super) fn cell(&self, leaf: usize) -> usize {
        let incoming = if let Parts::Few(shares) = &self.parts { shares.nodes[0] as usize } else { 0 };
        let [n_in, n_out, _] = self.material.shape;
        (self.entry * n_in + incoming) * n_out + leaf
    }

    /// The trees and their shares.
    #[inline(always)]
    fn each(&self, mut work: impl FnMut(usize, usize, f64) -> bool) {
        match &self.parts {
            Parts::Few(shares) => {
                for k in 0..shares.count {
                    let node = shares.nodes[k] as usize;
                    if shares.parts[k] > 0.0 && work(self.trees.tree(self.entry, node), node, shares.parts[k]) {
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

    /// How a direction is carried from a node, on the side of the horizon where `z` is.
    #[inline(always)]
    fn carried(&self, node: usize, z: f64) -> Option<Carried> {
        let (alignment, domain, to) = self.carry?;
        Some(Carried::over(alignment, domain, z, self.material.node_direction(node), to))
    }

    /// The options of a tree alone.
    #[inline(always)]
    fn own(&self) -> SampleOptions {
        SampleOptions { defensive: 0.0, ..self.options }
    }

    /// The density of a direction of the outgoing domain, as the material knows it: turned to azimuth 0 of isotropic data.
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

    /// The density of a direction whose trees' is known.
    #[inline(always)]
    fn with_defence(&self, trees: f64, wo: Direction) -> f64 {
        if self.defensive == 0.0 {
            return trees;
        }
        let background = self.background().pdf(self.trees.warps(), self.at(), wo);
        (1.0 - self.defensive) * trees + self.defensive * background
    }

    fn background(&self) -> &'a Background {
        self.trees.background()
    }

    fn at(&self) -> (usize, Density) {
        (self.entry, self.options.density)
    }

    /// A direction, and the leaf in which a tree drew it where that does not move; `None` where nothing is drawn.
    #[inline(always)]
    pub(super) fn draw(&self, u: [f64; 2]) -> Option<(Direction, Option<usize>)> {
        let by_trees = 1.0 - self.defensive;
        let warps = self.trees.warps();
        if u[0] >= by_trees && self.defensive > 0.0 {
            let u = [((u[0] - by_trees) / self.defensive).min(BELOW_ONE), u[1].min(BELOW_ONE)];
            return Some((self.background().draw(warps, self.at(), u)?, None));
        }
        let mut left = (u[0] / by_trees).min(BELOW_ONE);
        let mut chosen = None;
        // Rounding may leave a little beyond the last one.
        self.each(|tree, node, share| {
            chosen = Some((tree, node, (left / share).min(BELOW_ONE)));
            left -= share;
            left < 0.0
        });
        let (tree, node, mut first) = chosen?;
        let mut may_stay = false;
        if self.carry.is_some() {
            (first, may_stay) = stays(first);
        }
        let drawn = warps.sample(tree, [first, u[1]], &self.own())?;
        match self.carried(node, drawn.direction.cos_theta()) {
            Some(carried) => Some((Direction::from_unit(carried.drawn(drawn.direction.xyz(), may_stay)), None)),
            None => Some((drawn.direction, Some(drawn.leaf))),
        }
    }

    /// A point of the unit square that [`Mixture::draw`] takes to a direction: of the first node whose tree draws it, or else
    /// of the defensive part.
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

/// What is left of a node's part of the first coordinate, and whether it is among those directions that may stay.
#[inline(always)]
pub(super) fn stays(u: f64) -> (f64, bool) {
    let carrying = 1.0 - STAYING;
    let may_stay = u >= carrying;
    let left = if may_stay { (u - carrying) / STAYING } else { u / carrying };
    (left.min(BELOW_ONE), may_stay)
}

impl Shares {
    /// No tree.
    pub(super) const NONE: Self = Self { nodes: [0; FEW], parts: [0.0; FEW], count: 0 };

    /// Of nodes with these weights; shares add up to 1, or are 0 where no tree has light.
    #[inline(always)]
    pub(super) fn new(trees: &Trees, entry: usize, nodes: [u32; FEW], weights: [f64; FEW], count: usize) -> Self {
        let first = trees.tree(entry, 0);
        let mut light = [0.0; FEW];
        for k in 0..count {
            light[k] = weights[k] * trees.warps().total(first + nodes[k] as usize);
        }
        let sum = light[0] + light[1] + light[2];
        let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        Self { nodes, parts: light.map(|light| light * scale), count }
    }

    /// The node that a number from 0 to 1 chooses, and what is left of the number, stretched over the node's share.
    #[inline(always)]
    pub(super) fn choose(&self, mut u: f64) -> (u32, f64) {
        let mut chosen = (self.nodes[0], u);
        for (&node, &share) in self.nodes.iter().zip(&self.parts) {
            if share > 0.0 {
                // Rounding may leave a little beyond the last one.
                chosen = (node, (u / share).min(BELOW_ONE));
                u -= share;
                if u < 0.0 {
                    break;
                }
            }
        }
        chosen
    }

    #[inline(always)]
    pub(super) fn has_light(&self) -> bool {
        self.parts[0] + self.parts[1] + self.parts[2] > 0.0
    }
}
