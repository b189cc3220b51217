//! Refits the kept coefficients of a tensor by weighted least squares, using only the plan and its adjoint.

use crate::transform::Plan;
use rayon::prelude::*;

/// Improves the kept (nonzero) coefficients c in place by minimising Σ (w·(Sc − s))², with S the synthesis, s the
/// samples and w their weights. The method is preconditioned conjugate gradients on the normal equations (CGLS, Björck
/// 1996, section 7.4), with at most `iterations` iterations. The preconditioner uses `effects`, the norms of the
/// weighted synthesis functions. Returns the root of the sum reached.
///
/// # Panics
/// If the lengths differ.
pub fn refit(
    plan: &Plan,
    samples: &[f32],
    weights: &[f32],
    effects: &[f32],
    coefficients: &mut [f32],
    iterations: usize,
) -> f64 {
    let kept: Vec<bool> = coefficients.iter().map(|&c| c != 0.0).collect();
    let mut residual = coefficients.to_vec();
    plan.inverse(&mut residual);
    zip3(&mut residual, samples, weights, |decoded, s, w| w * (s - decoded));
    let gradient = |residual: &[f32], out: &mut Vec<f32>| {
        out.clear();
        out.extend(residual.iter().zip(weights).map(|(r, w)| r * w));
        plan.inverse_transposed(out);
        out.iter_mut().zip(&kept).for_each(|(g, &kept)| *g = if kept { *g } else { 0.0 });
    };
    let precondition = |g: f32, effect: f32| if effect > 0.0 { g / (effect * effect) } else { 0.0 };
    let mut g = Vec::with_capacity(samples.len());
    gradient(&residual, &mut g);
    let mut direction: Vec<f32> = g.iter().zip(effects).map(|(&g, &e)| precondition(g, e)).collect();
    let mut gamma = product(&g, &direction);
    let first = gamma;
    let mut image = vec![0.0_f32; samples.len()];
    for _ in 0..iterations {
        if gamma <= 1e-10 * first || gamma == 0.0 {
            break;
        }
        image.copy_from_slice(&direction);
        plan.inverse(&mut image);
        image.par_iter_mut().zip(weights).for_each(|(q, w)| *q *= w);
        let square = product(&image, &image);
        if square == 0.0 {
            break;
        }
        let alpha = (gamma / square) as f32;
        coefficients.par_iter_mut().zip(&direction).for_each(|(c, p)| *c += alpha * p);
        residual.par_iter_mut().zip(&image).for_each(|(r, q)| *r -= alpha * q);
        gradient(&residual, &mut g);
        let next: f64 = blocks(&g, effects, |g, e| f64::from(g) * f64::from(precondition(g, e)));
        let beta = (next / gamma) as f32;
        gamma = next;
        zip3(&mut direction, &g, effects, |p, g, e| precondition(g, e) + beta * p);
    }
    product(&residual, &residual).sqrt()
}

const BLOCK: usize = 1 << 14;

fn product(a: &[f32], b: &[f32]) -> f64 {
    blocks(a, b, |a, b| f64::from(a) * f64::from(b))
}

/// Sums `term(x, y)` over the elements x of `a` and y of `b`, block by block in a fixed order, so that the rounded
/// result does not depend on the number of threads.
fn blocks(a: &[f32], b: &[f32], term: impl Fn(f32, f32) -> f64 + Sync) -> f64 {
    let parts: Vec<f64> = a
        .par_chunks(BLOCK)
        .zip(b.par_chunks(BLOCK))
        .map(|(a, b)| a.iter().zip(b).map(|(&a, &b)| term(a, b)).sum())
        .collect();
    parts.into_iter().sum()
}

fn zip3(out: &mut [f32], a: &[f32], b: &[f32], f: impl Fn(f32, f32, f32) -> f32 + Sync) {
    assert!(out.len() == a.len() && a.len() == b.len(), "tensors to combine have the same length");
    out.par_iter_mut().zip(a).zip(b).for_each(|((o, &a), &b)| *o = f(*o, a, b));
}

#[cfg(test)]
mod tests {
    use super::super::k_term::{largest, refitted};
    use super::super::{Dictionary, effects};
    use super::*;
    use crate::domain::Axis;
    use crate::transform::{AxisTransform, LineBasis};

    #[test]
    fn conjugate_gradients_reach_the_dense_solution() {
        let samples: Vec<f64> = (0..80).map(|i| 0.3 + (f64::from(i) * 0.2).sin().powi(2)).collect();
        let transform = AxisTransform::line(LineBasis::BIOR44);
        let dictionary = Dictionary::new("bior4.4", 80, transform).unwrap();
        let plain = largest(&dictionary, &samples, 10, true);
        let dense = refitted(&dictionary, &samples, &plain.kept, &[]).unwrap();
        let axes = [Axis::Index { count: 80, labels: Vec::new() }];
        let plan = Plan::new(&axes, &[transform]).unwrap();
        let s: Vec<f32> = samples.iter().map(|&s| s as f32).collect();
        let w: Vec<f32> = s.iter().map(|s| 1.0 / s).collect();
        let diagonal = effects(&axes, &[transform], &w).unwrap();
        let mut c = vec![0.0_f32; 80];
        plain.kept.iter().zip(&plain.coefficients).for_each(|(&k, &value)| c[k] = value as f32);
        let left = refit(&plan, &s, &w, &diagonal, &mut c, 60);
        let expected: f64 = dense.samples.iter().zip(&samples).map(|(d, s)| ((d - s) / s).powi(2)).sum();
        assert!((left - expected.sqrt()).abs() < 1e-3 * expected.sqrt(), "{left} {}", expected.sqrt());
        assert_eq!(c.iter().filter(|c| **c != 0.0).count(), 10);
    }
}
