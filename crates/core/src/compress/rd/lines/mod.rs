//! Planes on a product of lines as a pyramid of pairs: weighted means, halved along one axis at a time, each detail predicted
//! from all that is decoded.
//!
//! Two entries with weights w₁, w₂ become their mean and the detail δ = c₁ − c₀. √W·δ, W = w₁w₂ / (w₁ + w₂), is an
//! orthonormal coefficient (Parseval is exact over weighted samples), so δ has the step Δ / √W. Predictions blend average
//! interpolation with recursive least squares; residuals are coded by the density that errors nearby suggest. Between bytes
//! and samples there are f64 additions, multiplications, divisions and square roots in a fixed order, and tables of integers.

mod expectation;
mod guess;
mod neighbours;
mod order;
mod plane;
mod source;
mod template;

use crate::codec::{BitCoder, ResidualCoder, code_number};
use crate::numeric::recursive::Recursive;
use expectation::Expectation;
use guess::Coefficients;
use neighbours::Places;
pub(crate) use order::{code_order, order_of_halvings};
use plane::{Halved, Learned, PlaneOf};
pub(crate) use source::Source;
use template::Template;

/// Axes of a product of lines.
pub(crate) const AXES: usize = 4;
/// Planes with a system of least squares and with expected errors of their own; all later ones share the last.
const PLANE_CLASSES: usize = 4;
/// Weight of earlier examples when an axis is halved again.
const FADING: f64 = 0.3;
/// Quantised magnitudes stay below this.
const LARGEST: f64 = (1 << 30) as f64;

/// A line axis: positions of its entries, strictly increasing.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    /// Positions, in any unit.
    pub(crate) positions: Vec<f64>,
    /// The circumference, of a circle.
    pub(crate) period: Option<f64>,
}

impl Line {
    /// Evenly spaced entries, around a circle or not.
    pub(crate) fn even(length: usize, is_circle: bool) -> Self {
        let positions = (0..length).map(|i| i as f64).collect();
        Self { positions, period: is_circle.then_some(length as f64) }
    }
}

/// Up to four lines, the last of them last; missing ones in front have one entry.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    lines: [Line; AXES],
}

impl Grid {
    /// The product of at most four lines.
    pub(crate) fn new(lines: &[Line]) -> Self {
        let missing = AXES.saturating_sub(lines.len());
        Self {
            lines: std::array::from_fn(|axis| {
                axis.checked_sub(missing).and_then(|i| lines.get(i)).cloned().unwrap_or_else(|| Line::even(1, false))
            }),
        }
    }

    /// Entries of each axis.
    pub(crate) fn lengths(&self) -> [usize; AXES] {
        std::array::from_fn(|axis| self.lines[axis].positions.len())
    }
}

/// How planes are quantised and predicted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quantiser {
    /// The step of orthonormal coefficients, in the unit of the planes.
    pub(crate) step: f64,
    /// The unit of values: 1 natural logarithm where they are logarithms.
    pub(crate) unit: f64,
    /// Least squares predict beside the fixed filters. They gain on large arrays with noise, and lose on small smooth ones.
    pub(crate) learns: bool,
}

/// One halving: `children` become `parents`.
struct Halving {
    axis: usize,
    children: [usize; AXES],
    parents: Places,
    /// By node of the halved axis.
    guess: Vec<Coefficients>,
}

/// Weights of the samples of planes and of all means over them.
struct Weights {
    /// By halving from the finest, last the root.
    levels: Vec<Vec<f32>>,
}

/// The pyramid of planes `[planes, leaves]` on a grid.
pub(crate) struct PairPyramid {
    /// From the finest.
    halvings: Vec<Halving>,
    /// One for each tensor, or for each plane; the last for all that follow.
    weights: Vec<Weights>,
    /// Planes of one tensor have weights of their own.
    by_plane: bool,
    templates: [Template; AXES],
}

impl PairPyramid {
    /// The pyramid of planes on a grid, halved in an order (what it lacks is added, what is too much left out); `weights` of
    /// all leaves, for each tensor or `by_plane`, one after another, the last for all that follow.
    pub(crate) fn new(grid: &Grid, order: &[u8], weights: &[f32], by_plane: bool) -> Self {
        let mut children = grid.lengths();
        let leaves = children.iter().product::<usize>();
        let long: [bool; AXES] = children.map(|n| n > 1);
        let mut levels: Vec<Weights> =
            weights.chunks(leaves.max(1)).map(|w| Weights { levels: vec![w.to_vec()] }).collect();
        let mut halved = [0; AXES];
        let mut halvings = Vec::with_capacity(order.len());
        let rest = (0..AXES).flat_map(|axis| std::iter::repeat_n(axis, usize::BITS as usize));
        for axis in order.iter().map(|&axis| usize::from(axis) % AXES).chain(rest) {
            if children[axis] < 2 {
                continue;
            }
            let circles = grid.lines.each_ref().map(|line| line.period.is_some());
            let mut wraps = circles;
            wraps[axis] &= children[axis].is_multiple_of(2);
            let mut parents = children;
            parents[axis] = children[axis].div_ceil(2);
            halved[axis] += 1;
            let guess = guess::coefficients(&grid.lines[axis], halved[axis], wraps[axis]);
            for set in &mut levels {
                if let Some(last) = set.levels.last() {
                    let sums = source::sums(last, children, axis);
                    set.levels.push(sums);
                }
            }
            halvings.push(Halving { axis, children, parents: Places::new(parents, wraps), guess });
            children = parents;
        }
        let templates = std::array::from_fn(|axis| Template::new(axis, long));
        Self { halvings, weights: levels, by_plane, templates }
    }

    /// Weights of a plane, of `vectors` planes to a tensor, after so many halvings.
    fn weights_of(&self, (plane, vectors): (usize, usize), level: usize) -> &[f32] {
        let set = if self.by_plane { plane } else { plane / vectors.max(1) };
        &self.weights[set.min(self.weights.len() - 1)].levels[level]
    }

    /// Codes `planes` planes, `vectors` of each of several tensors: an encoder is given their source, a decoder nothing; both
    /// return what a decoder has, and the number of integers that are not 0. The finest `left_out` halvings are not coded:
    /// means of their blocks come back.
    pub(crate) fn code<C: BitCoder>(
        &self,
        coder: &mut C,
        Quantiser { step, unit, learns }: Quantiser,
        (planes, vectors): (usize, usize),
        source: Option<&Source>,
        left_out: usize,
    ) -> (Vec<f32>, u64) {
        let mut residuals = ResidualCoder::default();
        let mut kept = 0;
        let mut values = self.code_roots(coder, step, (planes, vectors), source, &mut kept);
        let unit = unit / step;
        let mut expectations = vec![Expectation::new(unit); PLANE_CLASSES];
        let system = |axis: usize| vec![Recursive::new(self.templates[axis].features()); PLANE_CLASSES];
        let mut systems: [Vec<Recursive>; AXES] = std::array::from_fn(system);
        let mut seen = [false; AXES];
        let mut inherited: Vec<f32> = Vec::new();
        for (level, halving) in self.halvings.iter().enumerate().skip(left_out).rev() {
            if std::mem::replace(&mut seen[halving.axis], true) {
                systems[halving.axis].iter_mut().for_each(|system| system.fade(FADING));
            }
            let (parents, children) = (halving.parents.count(), halving.children.iter().product::<usize>());
            let mut finer = vec![0.0; planes * children];
            let mut errors_of_finer = vec![0.0; planes * children];
            let mut details = [vec![0.0; parents + 1], vec![0.0; parents + 1], vec![0.0; parents + 1]];
            let mut means = vec![0.0; parents + 1];
            let mut errors = vec![[0.0; 4]; parents + 1];
            let halved = Halved::new(halving, &self.templates[halving.axis], self.depth(level));
            for plane in 0..planes {
                means[..parents].copy_from_slice(&values[plane * parents..][..parents]);
                errors.fill([0.0; 4]);
                details.rotate_right(1);
                details[0].fill(0.0);
                let class = (plane % vectors.max(1)).min(PLANE_CLASSES - 1);
                kept += halved.code(
                    coder,
                    (
                        &mut residuals,
                        &mut Learned {
                            expectation: &mut expectations[class],
                            system: &mut systems[halving.axis][class],
                            unit,
                            learns,
                        },
                    ),
                    &mut PlaneOf {
                        class,
                        means: &mut means,
                        weights: self.weights_of((plane, vectors), level),
                        wanted: source.map(|source| source.details(level, plane, parents)),
                        per_step: 1.0 / step,
                        inherited: inherited.get(plane * parents..).and_then(|all| all.get(..parents)),
                        details: &mut details,
                        errors: &mut errors,
                        children: &mut finer[plane * children..][..children],
                        errors_of_children: &mut errors_of_finer[plane * children..][..children],
                    },
                );
            }
            values = finer;
            inherited = errors_of_finer;
        }
        let step = step as f32;
        for value in &mut values {
            *value *= step;
        }
        (values, kept)
    }

    /// The class of depths that contexts tell apart.
    fn depth(&self, level: usize) -> usize {
        let axes = self.templates.iter().filter(|template| template.is_long()).count();
        level / axes.max(1)
    }

    /// Codes the means over all leaves, in steps.
    fn code_roots<C: BitCoder>(
        &self,
        coder: &mut C,
        step: f64,
        (planes, vectors): (usize, usize),
        source: Option<&Source>,
        kept: &mut u64,
    ) -> Vec<f32> {
        let root = |plane: usize| {
            let weight = self.weights_of((plane, vectors), self.halvings.len()).first().copied().unwrap_or(0.0);
            if weight <= 0.0 {
                return 0.0;
            }
            let scale = f64::from(weight).sqrt();
            let wanted = source.map_or(0.0, |source| source.root(plane) / step * scale);
            let q = code_number(coder, plane::integer_of(wanted));
            *kept += u64::from(q != 0);
            (f64::from(q) / scale) as f32
        };
        (0..planes).map(root).collect()
    }
}

#[cfg(test)]
mod tests;
