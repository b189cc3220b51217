//! One halving of one plane: features, predictions, residuals, children.

use super::expectation::Expectation;
use super::grid::AXES;
use super::halvings::Halving;
use super::neighbours::Along;
use super::template::{BEFORE, Template};
use crate::codec::{BitCoder, DEPTHS, Expected, ResidualCoder};
use crate::numeric::recursive::Recursive;
use crate::numeric::wide;

/// Number of groups of spectral channels, each with a least-squares predictor and error statistics of its own. The
/// first channels have a group each; all later ones share the last.
pub(super) const PLANE_CLASSES: usize = 4;
/// Upper bound on the magnitude of a quantised prediction residual.
const LARGEST: f64 = (1 << 30) as f64;
/// Upper bound on the number of features from which least squares predict a detail, padding included.
const FEATURES: usize = 40;
/// Weight of the mean error of earlier predictions in the estimated squared error of predicting a detail (difference of
/// merged neighbours on a grid); the error at an adjacent node has weight 1. Raising it trusts neighbours less.
const PRIOR: f64 = 0.5;
/// Ratio of the squared error expected of fixed prediction filters to that of least-squares prediction, as long as
/// neither's error is known at neighbouring nodes. Raising it favours least squares.
const FIXED: f64 = 0.6;
/// Lower bound on the expected squared error of a prediction, in squared quantiser steps.
const FLOOR: f64 = 0.0125;
/// Variance of the quantisation error of a detail, in squared quantiser steps.
const QUANTISATION: f64 = 1.0 / 12.0;
/// Smallest ridge (regularisation) parameter of the least-squares prediction, in squared natural logarithms.
const RIDGE: f64 = 1e-9;
/// Upper bound on the magnitude of a detail that least squares may predict, in natural logarithms.
const LARGEST_PREDICTION: f64 = 6.0;
/// Parameters of the squared prediction error that a grid node inherits from the coarser node of which it is a part:
/// its weight in the estimate of the node's own error, and the factor by which it shrinks from level to level.
///
/// The error at an adjacent node has weight 1.
const INHERITED: (f32, f32) = (0.5, 0.8);
/// Limit to which the ratio of expected squared errors, of least-squares prediction to fixed prediction filters, is
/// clamped before it serves to blend both predictions.
const LARGEST_RATIO: f64 = 1e9;
/// Upper bound on a stored squared error of the prediction of a detail (difference of merged neighbours on a grid), in
/// squared quantiser steps.
const LARGEST_ERROR: f64 = 1e30;

/// Rounds a value in quantiser steps to the nearest integer, clamped to the largest magnitude.
#[inline]
pub(super) fn integer_of(steps: f64) -> i32 {
    steps.round().clamp(-LARGEST, LARGEST) as i32
}

/// Geometry of one halving of a grid (neighbours, prediction filters), common to all spectral channels.
pub(super) struct Halved<'a> {
    halving: &'a Halving,
    template: &'a Template,
    depth: usize,
    /// Parts of the row-major indices of grid nodes (directions or blocks of merged ones) −2 … 2 nodes away along the
    /// last axis, for each coordinate on it. The other axes add their own parts.
    offsets: Vec<[u32; 5]>,
}

/// Predictors of details (differences of merged neighbours), trained by the details decoded before.
pub(super) struct Learned<'a> {
    pub(super) expectation: &'a mut Expectation,
    pub(super) system: &'a mut Recursive,
    /// Number of quantiser steps in a change of 1 in the natural logarithm of a sample. If the samples themselves are
    /// coded, a fixed number of quantiser steps takes its place as the scale of predictions.
    pub(super) unit: f64,
    /// True if adaptive least squares predict details (differences of merged neighbours) in addition to the fixed
    /// filters.
    pub(super) learns: bool,
}

/// State of one spectral channel, in quantiser steps, while each grid node is split in two along one axis. Arrays of
/// means, details and errors have one extra element, for missing neighbours.
pub(super) struct PlaneOf<'a> {
    /// Class number of the spectral channel; channels of a class share predictors and coding contexts.
    pub(super) class: usize,
    pub(super) means: &'a mut [f32],
    /// Weights of the finer grid nodes (directions or blocks of merged ones). Two neighbouring ones make up a coarser
    /// node, whose value is their weighted mean.
    pub(super) weights: &'a [f32],
    /// Original details (differences of merged neighbours) that an encoder codes, unquantised; `None` in a decoder.
    pub(super) wanted: Option<&'a [f32]>,
    /// Reciprocal of the quantiser step, which converts natural logarithms (or samples) to quantiser steps.
    pub(super) per_step: f64,
    /// Extra width of the quantiser's zero bin, in steps: prediction residuals within 0.5 + this become 0.
    pub(super) dead_zone: f64,
    /// Squared prediction error that each grid node (block of merged directions) inherits from the coarser node of
    /// which it is a part, in squared quantiser steps; negative if none is known. `None` for the node of all
    /// directions.
    pub(super) inherited: Option<&'a [f32]>,
    /// Decoded details of this spectral channel and the two channels before it, by node; 0 where none is decoded.
    pub(super) details: &'a mut [Vec<f32>; BEFORE + 1],
    /// Squared errors, at each grid node coded recently, of prediction by fixed filters, by least squares and by the
    /// blend of both, in squared quantiser steps; then 1 if these errors are known, else 0. [`Halving::recent`] has
    /// their places.
    pub(super) errors: &'a mut [[f32; 4]],
    pub(super) children: &'a mut [f32],
    /// Squared prediction errors that the children inherit, in squared quantiser steps, as in `inherited`; `None` if
    /// the children are not split any further.
    pub(super) errors_of_children: Option<&'a mut [f32]>,
}

/// Neighbours of one row of grid nodes, grouped by their use in predicting the difference of the two children of a
/// node.
#[derive(Default)]
struct Row {
    differences: [Along; 4],
    slopes: Vec<[Along; 2]>,
    details: Vec<Along>,
    others: [Along; 3],
    errors: Vec<(Along, f32)>,
}

impl Row {
    fn set(&mut self, halving: &Halving, template: &Template, coordinates: [usize; AXES - 1]) {
        let along = |distance| halving.parents.along(coordinates, distance);
        self.differences = template.differences.map(along);
        self.slopes.clear();
        self.slopes.extend(template.slopes.iter().map(|pair| pair.map(along)));
        self.details.clear();
        self.details.extend(template.details.iter().map(|&distance| along(distance)));
        self.others = template.others.map(along);
        self.errors.clear();
        let recent = |&(distance, counts)| (halving.recent.along(coordinates, distance), counts);
        self.errors.extend(template.errors.iter().map(recent));
    }
}

/// Predictions of one detail (difference of two child nodes) and their expected errors.
struct Predicted {
    fixed: f64,
    learned: f64,
    blend: f64,
    /// Expected squared error, in squared quantiser steps, of the blend of both predictions (by fixed filters and by
    /// least squares).
    variance: f64,
    /// Mean squared error, in squared quantiser steps, of the predictions at neighbouring grid nodes (blocks of merged
    /// directions). These predictions blend those by fixed filters and by least squares.
    near: f64,
}

impl<'a> Halved<'a> {
    pub(super) fn new(halving: &'a Halving, template: &'a Template, depth: usize) -> Self {
        Self { halving, template, depth: depth.min(DEPTHS - 1), offsets: halving.parents.last_axis() }
    }

    /// Encodes or decodes one refinement of a spectral channel, in which each block of merged directions is split into
    /// two along one axis of the grid.
    ///
    /// Codes the differences of the two halves, computes the halves from them, and returns the number of nonzero
    /// residuals.
    pub(super) fn code<C: BitCoder>(
        &self,
        coder: &mut C,
        models: (&mut ResidualCoder, &mut Learned<'_>),
        plane: &mut PlaneOf<'_>,
    ) -> u64 {
        wide(
            #[inline(always)]
            || self.code_rows(coder, models, plane),
        )
    }

    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    fn code_rows<C: BitCoder>(
        &self,
        coder: &mut C,
        (residuals, learned): (&mut ResidualCoder, &mut Learned<'_>),
        plane: &mut PlaneOf<'_>,
    ) -> u64 {
        let Halving { axis, children, parents, recent, guess } = self.halving;
        let axis = *axis;
        let second = children[axis + 1..].iter().product::<usize>();
        let place = axis * PLANE_CLASSES + plane.class;
        let on_last = axis == AXES - 1;
        let width = parents.lengths[AXES - 1];
        let nowhere = parents.count();
        let mut kept = 0;
        let mut row = Row::default();
        for number in 0..parents.rows() {
            let coordinates = parents.coordinates(number);
            row.set(self.halving, self.template, coordinates);
            if let Some(places) = recent.cleared_before(coordinates) {
                plane.errors[places].fill([0.0; 4]);
            }
            let place_of_errors = recent.row(coordinates);
            let first = first_child(coordinates, axis, children);
            for x in 0..width {
                let node = number * width + x;
                let at = if on_last { x } else { coordinates[axis] };
                let child = first + if on_last { 2 * x } else { x };
                let mean = plane.means[node];
                let inherited = plane.inherited.map_or(-1.0, |inherited| inherited[node]);
                if 2 * at + 1 >= children[axis] {
                    plane.children[child] = mean;
                    if let Some(errors) = &mut plane.errors_of_children {
                        errors[child] = inherited;
                    }
                    continue;
                }
                let [w0, w1] = [child, child + second].map(|child| f64::from(plane.weights[child]));
                let sum = w0 + w1;
                let weight = if w0 > 0.0 && w1 > 0.0 { w0 * w1 / sum } else { 0.0 };
                plane.means[nowhere] = mean;
                let features = self.features(&row, plane, x, nowhere);
                let squared_step = if weight > 0.0 { 1.0 / weight } else { 1.0 };
                let bin = learned.expectation.bin_of(f64::from(mean));
                let prior = learned.expectation.of(bin);
                if learned.learns && learned.system.is_due() {
                    let least = QUANTISATION * squared_step + RIDGE * learned.unit * learned.unit;
                    learned.system.solve(&guess[at], least);
                }
                let errors = self.errors_around(&row, plane.errors, x, inherited);
                let predicted = predict(&features, &guess[at], learned, errors, (prior, squared_step));
                let (detail, error) = if weight > 0.0 {
                    let step = squared_step.sqrt();
                    let wanted = plane.wanted.map_or(0.0, |wanted| f64::from(wanted[node]) * plane.per_step);
                    let wanted = (wanted - predicted.blend) / step;
                    let wanted = if wanted.abs() < 0.5 + plane.dead_zone { 0 } else { integer_of(wanted) };
                    let expected =
                        Expected::new(predicted.variance * weight, predicted.near * weight, self.depth, place);
                    let q = residuals.code(coder, expected, wanted);
                    kept += u64::from(q != 0);
                    let detail = predicted.blend + expected.mean_of(q) * step;
                    let squared = |prediction: f64| {
                        let error = detail - prediction;
                        (error * error).min(LARGEST_ERROR)
                    };
                    let error = squared(predicted.blend);
                    plane.errors[place_of_errors + x] =
                        [squared(predicted.fixed) as f32, squared(predicted.learned) as f32, error as f32, 1.0];
                    learned.expectation.learn(bin, error);
                    if learned.learns {
                        learned.system.learn(&features, detail);
                    }
                    plane.details[0][node] = detail as f32;
                    (detail, error as f32 * INHERITED.1)
                } else {
                    (predicted.blend, inherited)
                };
                let mean = f64::from(mean);
                // Without any weight both children share the detail equally; a single weighted child takes the mean.
                let (down, up) = if weight > 0.0 {
                    (w1 / sum, w0 / sum)
                } else {
                    let moved = |own: f64, other: f64| match (own > 0.0, other > 0.0) {
                        (true, _) => 0.0,
                        (false, true) => 1.0,
                        (false, false) => 0.5,
                    };
                    (moved(w0, w1), moved(w1, w0))
                };
                plane.children[child] = (mean - down * detail) as f32;
                plane.children[child + second] = (mean + up * detail) as f32;
                if let Some(errors) = &mut plane.errors_of_children {
                    errors[child] = error;
                    errors[child + second] = error;
                }
            }
        }
        kept
    }

    /// Computes the inputs of the prediction of a detail (difference of the two halves of a block of directions):
    /// differences of the means of neighbouring blocks, and their details.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    fn features(&self, row: &Row, plane: &PlaneOf<'_>, x: usize, nowhere: usize) -> [f64; FEATURES] {
        let offsets = &self.offsets[x];
        let means = &plane.means[..=nowhere];
        let mean = f64::from(means[nowhere]);
        let mut features = [0.0; FEATURES];
        let mut next = 0;
        let mut push = |feature: f64| {
            features[next] = feature;
            next += 1;
        };
        let has_second = self.halving.parents.lengths[self.halving.axis] > 4;
        for (i, along) in row.differences.iter().enumerate() {
            let at = if i < 2 || has_second { along.at(offsets, nowhere) } else { nowhere };
            push(f64::from(means[at]) - mean);
        }
        for pair in &row.slopes {
            let [after, before] = pair.map(|along| along.at(offsets, nowhere));
            let exist = after < nowhere && before < nowhere;
            push(if exist { f64::from(means[after]) - f64::from(means[before]) } else { 0.0 });
        }
        let [own, others @ ..] = &*plane.details;
        for along in &row.details {
            push(f64::from(own[along.at(offsets, nowhere)]));
        }
        for other in others {
            for along in &row.others {
                push(f64::from(other[along.at(offsets, nowhere)]));
            }
        }
        features
    }

    /// Weighted sums of the squared errors with which the details of neighbouring blocks of directions were predicted:
    /// by fixed filters, by least squares, by the blend of both. The fourth number is the sum of the weights.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    fn errors_around(&self, row: &Row, errors: &[[f32; 4]], x: usize, inherited: f32) -> [f32; 4] {
        let offsets = &self.offsets[x];
        let nowhere = errors.len() - 1;
        let mut sums = [0.0; 4];
        for (along, counts) in &row.errors {
            let error = &errors[along.at(offsets, nowhere)];
            for k in 0..4 {
                sums[k] += counts * error[k];
            }
        }
        if inherited >= 0.0 {
            let inherited = INHERITED.0 * inherited;
            sums[0] += inherited;
            sums[1] += inherited;
            sums[2] += inherited;
            sums[3] += INHERITED.0;
        }
        sums
    }
}

/// Index, in the finer grid, of the first of the nodes that merge along `axis` into the first node of a row of the
/// coarser grid. `coordinates` are the row's place on all axes but the last.
fn first_child(coordinates: [usize; AXES - 1], axis: usize, children: &[usize; AXES]) -> usize {
    let mut first = 0;
    for b in 0..AXES - 1 {
        first = first * children[b] + if b == axis { 2 * coordinates[b] } else { coordinates[b] };
    }
    first * children[AXES - 1]
}

/// Predicts a detail by fixed filters and by least squares, blended by the inverse fourth powers of their expected
/// squared errors.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
fn predict(
    features: &[f64; FEATURES],
    guess: &[f64; 4],
    learned: &Learned<'_>,
    errors: [f32; 4],
    (prior, squared_step): (f64, f64),
) -> Predicted {
    let fixed = ((guess[0] * features[0] + guess[1] * features[1]) + guess[2] * features[2]) + guess[3] * features[3];
    let largest = LARGEST_PREDICTION * learned.unit;
    let by_squares = if learned.learns { learned.system.predict(features).clamp(-largest, largest) } else { fixed };
    let floor = FLOOR * squared_step;
    let [of_fixed, of_learned, of_blend, weight] = errors.map(f64::from);
    let share = 1.0 / (weight + PRIOR);
    let variance = |sum: f64, prior: f64| (sum + PRIOR * (prior + floor)) * share + floor;
    let ratio = variance(of_learned, prior) / variance(of_fixed, FIXED * prior);
    let ratio = ratio.min(LARGEST_RATIO);
    let square = ratio * ratio;
    let by_fixed = square * square;
    let blend = if learned.learns { (by_squares + by_fixed * fixed) / (1.0 + by_fixed) } else { fixed };
    Predicted {
        fixed,
        learned: by_squares,
        blend,
        variance: variance(of_blend, prior),
        near: if weight > 0.0 { of_blend / weight } else { prior },
    }
}
