//! Pyramid of pairs: roots, then one halving after another in closed loop. One function encodes and decodes.

use super::expectation::Expectation;
use super::grid::{AXES, Grid};
use super::halvings::Halvings;
use super::plane::{Halved, Learned, PLANE_CLASSES, PlaneOf, integer_of};
use super::source::{Source, group};
use super::template::Template;
use crate::codec::{BitCoder, ResidualCoder, code_number};
use crate::numeric::recursive::Recursive;
use std::borrow::Cow;
use std::mem::take;

/// Factor on the weight of earlier training examples of the least-squares predictor whenever grid nodes are split once
/// more along the same axis. Raising it lengthens the memory.
const FADING: f64 = 0.3;

/// Quantiser step, scale of values and choice of predictors with which spectral channels are coded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quantiser {
    /// Quantiser step of orthonormal coefficients, in the unit of the values.
    pub(crate) step: f64,
    /// Factor that scales limits of the predictor, such as the largest prediction, to the coded values. It is 1 for
    /// natural logarithms, and a fixed multiple of the quantiser step for samples.
    pub(crate) unit: f64,
    /// True if adaptive least squares predict details (differences of merged neighbours) in addition to the fixed
    /// filters. They gain on large noisy arrays, and lose on small smooth ones.
    pub(crate) learns: bool,
    /// Extra width of an encoder's zero bin, in quantiser steps: prediction residuals within 0.5 + this become 0. In
    /// smooth functions most details are 0, and an isolated ±1 costs more bits than its error is worth.
    pub(crate) dead_zone: f64,
}

/// Coder of spectral channels `[channel, node]` on a grid of directions, as means over ever larger blocks of
/// directions.
pub(crate) struct PairPyramid {
    halvings: Halvings,
    templates: [Template; AXES],
}

impl PairPyramid {
    /// Builds the coder of spectral channels on a grid of angles. `order` lists the axes along which neighbours merge
    /// in pairs, finest first; superfluous entries are skipped, and merges added until one node is left.
    ///
    /// `weights` holds one set of weights of all grid nodes for each slice of the tensor or (`by_plane`) each spectral
    /// channel; the last set serves all later ones.
    pub(crate) fn new(grid: &Grid, order: &[u8], weights: &[u8], by_plane: bool) -> Self {
        let long: [bool; AXES] = grid.lengths().map(|n| n > 1);
        let templates = std::array::from_fn(|axis| Template::new(axis, long));
        Self { halvings: Halvings::new(grid, order, weights, by_plane), templates }
    }

    #[cfg(test)]
    pub(super) fn halvings(&self) -> &Halvings {
        &self.halvings
    }

    /// Computes, before quantisation, the means over ever larger blocks of values `[slice, channel, node]` and the
    /// differences (details) of the nodes merged. Values of weight 0 may be any number.
    pub(crate) fn source(&self, planes: &[f32], vectors: usize) -> Source {
        Source::new(&self.halvings, planes, vectors)
    }

    /// Encodes values on a grid of directions, or decodes them, as the type of `coder` says. Returns the decoded values
    /// and the number of nonzero quantised integers.
    ///
    /// There are `planes` spectral channels in all, `vectors` of them for each part of the tensor that is coded on its
    /// own.
    ///
    /// Only an encoder passes `source`; of one that it gives away, details are freed once they are coded. The last
    /// `left_out` divisions of merged grid nodes are not coded: values are then means over blocks of angles.
    pub(crate) fn code<C: BitCoder>(
        &self,
        coder: &mut C,
        Quantiser { step, unit, learns, dead_zone }: Quantiser,
        (planes, vectors): (usize, usize),
        mut source: Option<Cow<'_, Source>>,
        left_out: usize,
    ) -> (Vec<f32>, u64) {
        let mut residuals = ResidualCoder::default();
        let mut kept = 0;
        let roots = self.code_roots(coder, step, (planes, vectors), source.as_deref(), &mut kept);
        let levels = self.halvings.all().get(left_out..).unwrap_or_default();
        if levels.is_empty() {
            return (in_units(roots, step), kept);
        }
        // Nodes of several channels at a time, and the errors that they inherit: those of a large table are freed as
        // soon as they are split.
        let group = group(&self.halvings);
        // The nodes of a channel have one element behind them, for missing neighbours.
        let with_room = |roots: &[f32]| roots.iter().flat_map(|&root| [root, 0.0]).collect();
        let mut values: Vec<Vec<f32>> = roots.chunks(group).map(with_room).collect();
        drop(roots);
        let mut inherited: Vec<Vec<f32>> = values.iter().map(|_| Vec::new()).collect();
        let unit = unit / step;
        let mut expectations = vec![Expectation::new(unit); PLANE_CLASSES];
        let system = |axis: usize| vec![Recursive::new(self.templates[axis].features()); PLANE_CLASSES];
        let mut systems: [Vec<Recursive>; AXES] = std::array::from_fn(system);
        let mut seen = [false; AXES];
        let mut finest = Vec::new();
        for (level, halving) in levels.iter().enumerate().map(|(k, halving)| (left_out + k, halving)).rev() {
            if std::mem::replace(&mut seen[halving.axis], true) {
                systems[halving.axis].iter_mut().for_each(|system| system.fade(FADING));
            }
            let (parents, children) = (halving.parents.count(), halving.children.iter().product::<usize>());
            let is_finest = level == left_out;
            if is_finest {
                finest = vec![0.0; planes * children];
            }
            let mut details = [vec![0.0; parents + 1], vec![0.0; parents + 1], vec![0.0; parents + 1]];
            let mut errors = vec![[0.0; 4]; halving.recent.count() + 1];
            let halved = Halved::new(halving, &self.templates[halving.axis], self.depth(level));
            for (number, (values, inherited)) in values.iter_mut().zip(&mut inherited).enumerate() {
                let (mut coarse, of_coarse) = (take(values), take(inherited));
                let count = coarse.len() / (parents + 1);
                if !is_finest {
                    *values = vec![0.0; count * (children + 1)];
                    *inherited = vec![0.0; count * children];
                }
                for at in 0..count {
                    let plane = number * group + at;
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
                            means: &mut coarse[at * (parents + 1)..][..=parents],
                            weights: &self.halvings.weights_of((plane, vectors), level),
                            wanted: source.as_ref().map(|source| source.details(level, plane, parents)),
                            per_step: 1.0 / step,
                            dead_zone,
                            inherited: of_coarse.get(at * parents..).and_then(|all| all.get(..parents)),
                            details: &mut details,
                            errors: &mut errors,
                            children: if is_finest {
                                &mut finest[plane * children..][..children]
                            } else {
                                &mut values[at * (children + 1)..][..children]
                            },
                            // The finest nodes are not split, so their errors are of no use.
                            errors_of_children: inherited
                                .get_mut(at * children..)
                                .and_then(|all| all.get_mut(..children)),
                        },
                    );
                }
                if let Some(Cow::Owned(source)) = &mut source {
                    source.free(number, level);
                }
            }
        }
        (in_units(finest, step), kept)
    }

    /// Class of the size of merged blocks after `level` halvings, a context of the residual coder.
    fn depth(&self, level: usize) -> usize {
        let axes = self.templates.iter().filter(|template| template.is_long()).count();
        level / axes.max(1)
    }

    /// Encodes or decodes the mean of each spectral channel over the whole grid, and returns it in quantiser steps.
    fn code_roots<C: BitCoder>(
        &self,
        coder: &mut C,
        step: f64,
        (planes, vectors): (usize, usize),
        source: Option<&Source>,
        kept: &mut u64,
    ) -> Vec<f32> {
        let root = |plane: usize| {
            let weight = self.halvings.weight_of_all((plane, vectors));
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

/// Converts values from quantiser steps to their own unit.
fn in_units(mut values: Vec<f32>, step: f64) -> Vec<f32> {
    let step = step as f32;
    for value in &mut values {
        *value *= step;
    }
    values
}
