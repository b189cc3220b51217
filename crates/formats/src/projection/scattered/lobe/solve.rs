//! Fit of a lobe and of the base beneath it: Levenberg-Marquardt steps with a robust loss.
//!
//! Each incidence has its own base. The normal equations are therefore those of the lobe bordered by a small block for
//! each incidence, which is eliminated.

use super::near::{Near, Sample, TERMS};
use super::shape::{ANGLE, LEAST_TAIL, NUMBERS, Prepared, STRETCH, Shape, TAIL, WIDTH};
use crate::domain::LobeCentre;
use crate::numeric::cholesky::{backward, factor_clamped, forward};

/// Upper bound on the iterations that fit a smooth background to samples, without a lobe.
const ROUNDS: usize = 40;
/// Relative reduction of the misfit by one iteration, below which the fit of a lobe and its background ends. The misfit
/// is a robust sum of squared residuals in standard deviations. Raising the limit is faster and less accurate.
const ENOUGH: f64 = 1e-5;
/// Absolute reduction of the misfit by one iteration, below which the fit of a lobe and its background ends. The misfit
/// is a robust sum of squared residuals in standard deviations. Raising the limit is faster and less accurate.
const LITTLE: f64 = 1e-2;
/// Initial damping of the Levenberg-Marquardt steps.
const DAMPING: f64 = 1e-3;
/// Number by which the Levenberg-Marquardt damping is multiplied after a step that does not reduce the misfit.
const HARDER: f64 = 8.0;
/// Number by which the Levenberg-Marquardt damping is multiplied after a step that reduces the misfit.
const SOFTER: f64 = 0.2;
/// Levenberg-Marquardt damping beyond which a fit gives up, since no step is expected to succeed.
const MOST_DAMPING: f64 = 1e8;
/// Largest change of the natural logarithm of a lobe's width in one iteration of a lobe fit. The logarithm of the
/// lobe's peak may change 1/0.3 (3.3) times as much. Raising it risks steps that miss the best fit.
const LONGEST: f64 = 0.7;
/// Largest change of a coefficient of the background's natural logarithm in one iteration of a fit of the background
/// beneath a lobe. Raising it risks steps that miss the best fit.
const LONGEST_OF_BASE: f64 = 3.0;
/// Prior standard deviation of the coefficients of the background: changes of its logarithm over the radius of the
/// samples. It matters if samples are too few.
const BASE_DEVIATION: f64 = 1.5;
/// Priors (mean, standard deviation) of p₁ and p₂. The natural logarithm of a lobe's peak is p₀ + p₁t + p₂t², where t
/// is −ln cos θi minus a constant. Peaks rise with the angle of incidence θi.
const RISE: [(f64, f64); 2] = [(0.5, 1.0), (0.0, 0.5)];
/// Prior (mean, standard deviation) of p₁ for a lobe in half-vector slopes. The natural logarithm of its peak is p₀ +
/// p₁t + p₂t², where t is −ln cos θi minus a constant. At a constant albedo its peak rises with 1/cos²θi: p₁ = 2.
const RISE_OF_HALF_VECTORS: (f64, f64) = (2.0, 1.0);
/// Prior standard deviation of the logarithm of the ratio of one width of a lobe to the geometric mean of both widths.
const STRETCH_DEVIATION: f64 = 1.0;

/// Least-squares problem of fitting a lobe and its background: samples, noise, and free parameters.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) near: &'a Near,
    /// Standard deviation, due to noise, of the natural logarithm of a sample to which lobe and background are fitted.
    pub(super) noise: f64,
    /// For each parameter of the lobe, true if it is fitted and false if it is fixed.
    pub(super) free: [bool; NUMBERS],
    /// Cross-validation fold whose samples are left out; `None` to use all samples.
    pub(super) without: Option<u32>,
    /// Radius about the lobe centre, as a chord on the unit sphere, within which samples are left out of the fit of
    /// lobe and background.
    pub(super) beyond: f64,
    /// Lower and upper bound of the logarithm of the lobe's half-width.
    pub(super) widths: [f64; 2],
}

/// Result of a fit: a lobe, or none, and the coefficients of the background under each incoming direction.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) shape: Option<Shape>,
    pub(super) bases: Vec<[f64; TERMS]>,
    pub(super) cost: f64,
}

/// Contribution of the samples under one incoming direction to the normal equations from which a lobe and the
/// background beneath it are fitted.
#[derive(Clone, Copy)]
struct Block {
    lobe: [[f64; NUMBERS]; NUMBERS],
    border: [[f64; TERMS]; NUMBERS],
    base: [[f64; TERMS]; TERMS],
    lobe_right: [f64; NUMBERS],
    base_right: [f64; TERMS],
    cost: f64,
}

/// Normal equations of the lobe parameters after elimination of the background coefficients.
struct Reduced {
    /// Cholesky factor of the normal matrix; rows and columns are scaled to a diagonal of 1.
    matrix: [[f64; NUMBERS]; NUMBERS],
    right: [f64; NUMBERS],
    scales: [f64; NUMBERS],
    /// For each incoming direction, the Cholesky factor and the right-hand side of the normal equations for the
    /// coefficients of the background beneath the lobe.
    factored: Vec<([[f64; TERMS]; TERMS], [f64; TERMS])>,
}

impl Problem<'_> {
    fn is_counted(&self, sample: &Sample) -> bool {
        Some(sample.fold) != self.without && sample.distance >= self.beyond
    }

    /// Fits to the samples near a lobe centre the background alone, without a lobe.
    pub(super) fn base(&self) -> Fit {
        let medians = self.near.groups.iter().map(|group| {
            let mut logs: Vec<f64> =
                group.iter().filter(|sample| self.is_counted(sample)).map(|sample| sample.log).collect();
            logs.sort_by(f64::total_cmp);
            let mut base = [0.0; TERMS];
            base[0] = logs.get(logs.len() / 2).copied().unwrap_or(0.0);
            base
        });
        let start = Fit { shape: None, bases: medians.collect(), cost: f64::INFINITY };
        self.fit(start, ROUNDS)
    }

    /// Fits the background, and the lobe if `start` has one, to the samples: by Levenberg-Marquardt iterations from the
    /// guess `start`, at most `rounds` of them.
    pub(super) fn fit(&self, start: Fit, rounds: usize) -> Fit {
        let mut best = start;
        let mut blocks = self.blocks(&best);
        best.cost = self.cost(&best, &blocks);
        let (mut damping, mut done) = (DAMPING, 0);
        while done < rounds && damping < MOST_DAMPING {
            done += 1;
            let mut next = self.step(&best, &blocks, damping);
            let found = self.blocks(&next);
            next.cost = self.cost(&next, &found);
            if next.cost < best.cost {
                let gain = best.cost - next.cost;
                (best, blocks) = (next, found);
                damping = (damping * SOFTER).max(1e-9);
                if gain < ENOUGH * best.cost || gain < LITTLE {
                    break;
                }
            } else {
                damping *= HARDER;
            }
        }
        best
    }

    /// Returns the robust cost of a fit of lobe and background: the costs of the residuals of the samples, plus those
    /// of the deviations of the parameters from their priors.
    fn cost(&self, fit: &Fit, blocks: &[Block]) -> f64 {
        let samples: f64 = blocks.iter().map(|block| block.cost).sum();
        let bases: f64 = fit.bases.iter().flat_map(|base| &base[1..]).map(|b| (b / BASE_DEVIATION).powi(2)).sum();
        let lobe = fit.shape.map_or(0.0, |shape| {
            let expected = self.expected(&shape);
            (0..NUMBERS).map(|i| expected[i].1 * expected[i].0 * expected[i].0).sum()
        });
        samples + bases + lobe
    }

    /// Returns, for each lobe parameter, its deviation from the prior mean and the inverse variance of the prior.
    fn expected(&self, shape: &Shape) -> [(f64, f64); NUMBERS] {
        let mut expected = [(0.0, 0.0); NUMBERS];
        let mut rise = RISE;
        if shape.centre == LobeCentre::HalfVector {
            rise[0] = RISE_OF_HALF_VECTORS;
        }
        for (i, (mean, deviation)) in rise.into_iter().enumerate() {
            expected[i + 1] = (shape.numbers[i + 1] - mean, 1.0 / (deviation * deviation));
        }
        expected[STRETCH] = (shape.numbers[STRETCH], 1.0 / (STRETCH_DEVIATION * STRETCH_DEVIATION));
        for (expected, free) in expected.iter_mut().zip(self.free) {
            if !free {
                expected.1 = 0.0;
            }
        }
        expected
    }

    fn blocks(&self, fit: &Fit) -> Vec<Block> {
        let prepared = fit.shape.map(|shape| shape.prepared());
        let groups = self.near.groups.iter().zip(&fit.bases);
        groups.map(|(group, base)| self.block(group, base, prepared.as_ref())).collect()
    }

    fn block(&self, group: &[Sample], base: &[f64; TERMS], shape: Option<&Prepared>) -> Block {
        let mut block = Block {
            lobe: [[0.0; NUMBERS]; NUMBERS],
            border: [[0.0; TERMS]; NUMBERS],
            base: [[0.0; TERMS]; TERMS],
            lobe_right: [0.0; NUMBERS],
            base_right: [0.0; TERMS],
            cost: 0.0,
        };
        for sample in group.iter().filter(|sample| self.is_counted(sample)) {
            let at = predicted(sample, base, shape);
            let certainty = 1.0 / self.noise.max(sample.stated);
            let residual = (sample.log - at.log) * certainty;
            let (cost, root) = robust(residual);
            block.cost += cost;
            let weight = certainty * certainty / root;
            let residual = sample.log - at.log;
            let by_base = sample.terms.map(|term| (1.0 - at.share) * term);
            for i in 0..TERMS {
                let weighted = weight * by_base[i];
                block.base_right[i] += weighted * residual;
                for (sum, other) in block.base[i][..=i].iter_mut().zip(&by_base) {
                    *sum += weighted * other;
                }
            }
            if at.share <= 1e-9 {
                continue;
            }
            for i in 0..NUMBERS {
                let weighted = weight * at.share * at.slopes[i];
                block.lobe_right[i] += weighted * residual;
                for (sum, other) in block.lobe[i][..=i].iter_mut().zip(&at.slopes) {
                    *sum += weighted * at.share * other;
                }
                for (sum, other) in block.border[i].iter_mut().zip(&by_base) {
                    *sum += weighted * other;
                }
            }
        }
        block
    }

    /// Returns the standard deviation of a linear combination, with coefficients `factors`, of the free parameters of a
    /// lobe.
    pub(super) fn deviation(&self, fit: &Fit, factors: [f64; NUMBERS]) -> f64 {
        let step = self.reduced(fit, &self.blocks(fit), 0.0);
        let held = std::array::from_fn(|i| if self.free[i] { factors[i] * step.scales[i] } else { 0.0 });
        let half = forward::<NUMBERS, NUMBERS>(&step.matrix, held);
        inner(&half, &half).sqrt()
    }

    /// Returns the parameters of a lobe and of the background beneath it after one damped Levenberg-Marquardt step.
    fn step(&self, from: &Fit, blocks: &[Block], damping: f64) -> Fit {
        let Reduced { matrix, right, scales, factored } = self.reduced(from, blocks, damping);
        let shape = from.shape.map(|shape| {
            let mut step = backward::<NUMBERS, NUMBERS>(&matrix, forward::<NUMBERS, NUMBERS>(&matrix, right));
            step.iter_mut().zip(scales).for_each(|(step, scale)| *step *= scale);
            let longest = step[WIDTH].abs().max(step[STRETCH].abs()).max(0.3 * step[0].abs());
            if longest > LONGEST {
                step = step.map(|step| step * LONGEST / longest);
            }
            let mut numbers = shape.numbers;
            numbers.iter_mut().zip(step).for_each(|(number, step)| *number += step);
            numbers[WIDTH] = numbers[WIDTH].clamp(self.widths[0], self.widths[1]);
            numbers[TAIL] = numbers[TAIL].clamp(LEAST_TAIL, 0.5);
            numbers[STRETCH] = numbers[STRETCH].clamp(-2.0, 2.0);
            numbers[ANGLE] = numbers[ANGLE].clamp(-10.0, 10.0);
            Shape { numbers, ..shape }
        });
        let taken = |i: usize| shape.zip(from.shape).map_or(0.0, |(to, from)| to.numbers[i] - from.numbers[i]);
        let taken: [f64; NUMBERS] = std::array::from_fn(taken);
        let bases = factored.iter().zip(blocks).zip(&from.bases).map(|(((own, own_right), block), base)| {
            let left = std::array::from_fn(|k| {
                own_right[k] - (0..NUMBERS).map(|i| block.border[i][k] * taken[i]).sum::<f64>()
            });
            let change = backward::<TERMS, TERMS>(own, forward::<TERMS, TERMS>(own, left));
            std::array::from_fn(|k| base[k] + change[k].clamp(-LONGEST_OF_BASE, LONGEST_OF_BASE))
        });
        Fit { shape, bases: bases.collect(), cost: f64::INFINITY }
    }

    /// Returns the damped normal equations of the lobe parameters alone, with the background eliminated.
    fn reduced(&self, from: &Fit, blocks: &[Block], damping: f64) -> Reduced {
        let (mut matrix, mut right) = ([[0.0; NUMBERS]; NUMBERS], [0.0; NUMBERS]);
        let certainty = 1.0 / (BASE_DEVIATION * BASE_DEVIATION);
        let mut factored = Vec::with_capacity(blocks.len());
        for (block, base) in blocks.iter().zip(&from.bases) {
            let (mut own, mut own_right) = (block.base, block.base_right);
            for i in 0..TERMS {
                if i > 0 {
                    own[i][i] += certainty;
                    own_right[i] -= certainty * base[i];
                }
                own[i][i] = own[i][i] * (1.0 + damping) + 1e-9;
            }
            factor_clamped::<TERMS, TERMS>(&mut own);
            let solved = forward::<TERMS, TERMS>(&own, own_right);
            let borders = block.border.map(|row| forward::<TERMS, TERMS>(&own, row));
            for i in 0..NUMBERS {
                right[i] += block.lobe_right[i] - inner(&borders[i], &solved);
                for j in 0..=i {
                    matrix[i][j] += block.lobe[i][j] - inner(&borders[i], &borders[j]);
                }
            }
            factored.push((own, own_right));
        }
        let expected = from.shape.map_or([(0.0, 0.0); NUMBERS], |shape| self.expected(&shape));
        for (i, (off, certainty)) in expected.into_iter().enumerate() {
            let diagonal: f64 = blocks.iter().map(|block| block.lobe[i][i]).sum();
            matrix[i][i] += damping * diagonal + certainty * (1.0 + damping) + 1e-9;
            right[i] -= certainty * off;
        }
        for i in (0..NUMBERS).filter(|&i| !self.free[i]) {
            matrix[i] = [0.0; NUMBERS];
            for row in &mut matrix {
                row[i] = 0.0;
            }
            (matrix[i][i], right[i]) = (1.0, 0.0);
        }
        // Equal scales: pivots are clamped relative to the first.
        let scales: [f64; NUMBERS] = std::array::from_fn(|i| 1.0 / matrix[i][i].max(1e-300).sqrt());
        for i in 0..NUMBERS {
            right[i] *= scales[i];
            for j in 0..=i {
                matrix[i][j] *= scales[i] * scales[j];
            }
        }
        factor_clamped::<NUMBERS, NUMBERS>(&mut matrix);
        Reduced { matrix, right, scales, factored }
    }

    /// Returns the robust cost of predicting the samples of a cross-validation fold by `fit`.
    pub(super) fn cost_of(&self, fit: &Fit, fold: u32) -> f64 {
        let prepared = fit.shape.map(|shape| shape.prepared());
        let mut cost = 0.0;
        for (group, base) in self.near.groups.iter().zip(&fit.bases) {
            for sample in group.iter().filter(|sample| sample.fold == fold) {
                let at = predicted(sample, base, prepared.as_ref());
                cost += robust((sample.log - at.log) / self.noise.max(sample.stated)).0;
            }
        }
        cost
    }
}

/// Value that a fit of lobe and background predicts at a sample.
pub(super) struct Predicted {
    /// Natural logarithm of the fitted value at a sample: the sum of background and lobe.
    pub(super) log: f64,
    /// Natural logarithm of the fitted background at a sample: the fitted value without the contribution of the lobe.
    pub(super) base: f64,
    /// Fraction that the lobe contributes to the fitted value at a sample, 0 to 1.
    pub(super) share: f64,
    slopes: [f64; NUMBERS],
}

/// Evaluates the sum of background and lobe at a sample.
#[inline]
pub(super) fn predicted(sample: &Sample, base: &[f64; TERMS], shape: Option<&Prepared>) -> Predicted {
    let base = inner(base, &sample.terms);
    let Some(shape) = shape else { return Predicted { log: base, base, share: 0.0, slopes: [0.0; NUMBERS] } };
    let lobe = shape.at(sample);
    let difference = lobe.log - base;
    let (log, share) = if difference > 30.0 {
        (lobe.log, 1.0)
    } else if difference < -25.0 {
        (base, 0.0)
    } else {
        let ratio = libm::exp(difference);
        (base + libm::log1p(ratio), ratio / (1.0 + ratio))
    };
    Predicted { log, base, share, slopes: lobe.slopes }
}

/// Returns the soft L1 cost 2·(√(1 + r²) − 1) of a residual r in standard deviations, and √(1 + r²), whose inverse is
/// the weight of the residual.
#[inline]
pub(super) fn robust(residual: f64) -> (f64, f64) {
    let root = (1.0 + residual * residual).sqrt();
    (2.0 * (root - 1.0), root)
}

fn inner<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
