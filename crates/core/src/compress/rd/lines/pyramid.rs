//! The pyramid of pairs: roots, then halving after halving in closed loop, the same function encoding and decoding.

use super::expectation::Expectation;
use super::grid::{AXES, Grid};
use super::halvings::Halvings;
use super::plane::{Halved, Learned, PLANE_CLASSES, PlaneOf, integer_of};
use super::source::Source;
use super::template::Template;
use crate::codec::{BitCoder, ResidualCoder, code_number};
use crate::numeric::recursive::Recursive;

/// Weight of earlier examples when an axis is halved again.
const FADING: f64 = 0.3;

/// Step, unit and predictors of the planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quantiser {
    /// The step of orthonormal coefficients, in the unit of the planes.
    pub(crate) step: f64,
    /// The unit of values: 1 natural logarithm where they are logarithms.
    pub(crate) unit: f64,
    /// Least squares predict beside the fixed filters. They gain on large arrays with noise, and lose on small smooth ones.
    pub(crate) learns: bool,
    /// An encoder's: residuals within half a step and this part of one become 0. Of smooth functions most details are 0, and
    /// a lone ±1 takes more bits than its error is worth.
    pub(crate) dead_zone: f64,
}

/// The pyramid of planes `[planes, leaves]` on a grid.
pub(crate) struct PairPyramid {
    halvings: Halvings,
    templates: [Template; AXES],
}

impl PairPyramid {
    /// The pyramid of planes on a grid, halved in an order (what it lacks is added, what is too much left out); `weights` of
    /// all leaves, for each tensor or `by_plane`, one after another, the last for all that follow.
    pub(crate) fn new(grid: &Grid, order: &[u8], weights: &[f32], by_plane: bool) -> Self {
        let long: [bool; AXES] = grid.lengths().map(|n| n > 1);
        let templates = std::array::from_fn(|axis| Template::new(axis, long));
        Self { halvings: Halvings::new(grid, order, weights, by_plane), templates }
    }

    #[cfg(test)]
    pub(super) fn halvings(&self) -> &Halvings {
        &self.halvings
    }

    /// Analyses planes `[tensors, vectors, leaves]`; samples without weight may hold anything.
    pub(crate) fn source(&self, planes: &[f32], vectors: usize) -> Source {
        Source::new(&self.halvings, planes, vectors)
    }

    /// Codes `planes` planes, `vectors` of each of several tensors: an encoder is given their source, a decoder nothing; both
    /// return what a decoder has, and the number of integers that are not 0. The finest `left_out` halvings are not coded:
    /// means of their blocks come back.
    pub(crate) fn code<C: BitCoder>(
        &self,
        coder: &mut C,
        Quantiser { step, unit, learns, dead_zone }: Quantiser,
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
        for (level, halving) in self.halvings.all().iter().enumerate().skip(left_out).rev() {
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
                        weights: self.halvings.weights_of((plane, vectors), level),
                        wanted: source.map(|source| source.details(level, plane, parents)),
                        per_step: 1.0 / step,
                        dead_zone,
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
            let weight =
                self.halvings.weights_of((plane, vectors), self.halvings.all().len()).first().copied().unwrap_or(0.0);
            if weight <= 0.0 {
                return 0.0;
            }
            let scale = f64::from(weight).sqrt();
            let wanted = source.map_or(0.0, |source| source.root(plane) / step * scale);
            let q = code_number(coder, integer_of(wanted));
            *kept += u64::from(q != 0);
            (f64::from(q) / scale) as f32
        };
        (0..planes).map(root).collect()
    }
}
