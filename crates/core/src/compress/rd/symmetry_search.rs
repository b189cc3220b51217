//! Search for the symmetries of a tensor, by comparing rows with their images.

use super::shape::Shape;
use super::symmetry::{Group, closure};
use crate::codec::Class;
use crate::domain::Symmetry;
use rayon::prelude::*;

/// Largest number of spectra compared with their images when symmetries are sought. Raising it costs time.
const MOST_COMPARED: usize = 1 << 15;

/// Symmetries of the data that hold within a tolerance.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    /// Generators of the group of symmetries that the data have.
    pub(crate) generators: Vec<Symmetry>,
    /// Number of members of the group of symmetries that the data have.
    pub(crate) order: usize,
    /// Largest deviation of the data from a generating symmetry, root mean square of logarithms.
    pub(crate) deviation: f64,
}

/// Finds the largest group of symmetries that map the logarithms of samples to themselves, up to a root mean square
/// deviation of `tolerance`.
///
/// The deviation is the root mean square difference between samples and their images, divided by √2: that of one entry
/// from its orbit's mean if entries differ by independent noise.
pub(crate) fn symmetries(shape: &Shape, logs: &[f32], classes: Option<&[Class]>, tolerance: f64) -> Found {
    let mut accepted: Vec<(f64, Symmetry)> = Symmetry::of(shape.mesh().domain())
        .into_par_iter()
        .filter(|&s| s != Symmetry::IDENTITY)
        .filter_map(|symmetry| {
            let group = Group::new(shape, &[Symmetry::IDENTITY, symmetry])?;
            let deviation = deviation(shape, &group, logs, classes, tolerance)?;
            (deviation <= tolerance).then_some((deviation, symmetry))
        })
        .collect();
    accepted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut generators: Vec<Symmetry> = Vec::new();
    let mut largest = 0.0;
    for &(deviation, symmetry) in &accepted {
        if closure(&generators).contains(&symmetry) {
            continue;
        }
        generators.push(symmetry);
        let all = closure(&generators);
        if all.iter().all(|s| *s == Symmetry::IDENTITY || accepted.iter().any(|(_, known)| known == s)) {
            largest = deviation;
        } else {
            generators.pop();
        }
    }
    Found { order: closure(&generators).len(), generators, deviation: largest }
}

/// Root mean square difference between logarithms of spectra and of their images under the symmetry that is second in
/// `group`, after the identity. It is divided by √2, because both contain noise. `None` as soon as it must exceed
/// `tolerance`, or if nothing can be compared.
fn deviation(shape: &Shape, group: &Group, logs: &[f32], classes: Option<&[Class]>, tolerance: f64) -> Option<f64> {
    let n = shape.length();
    let stride = shape.rows().div_ceil(MOST_COMPARED);
    // Bound over all possible comparisons: a larger sum cannot become a mean within the tolerance.
    let most = 2.0 * tolerance * tolerance * (shape.rows().div_ceil(stride) * n) as f64;
    let live = |at: usize| classes.is_none_or(|c| matches!(c[at], Class::Positive | Class::Negative));
    let (mut sum, mut count) = (0.0_f64, 0_usize);
    for at in (0..shape.rows()).step_by(stride) {
        let (block, leaf) = (at / shape.leaves(), at % shape.leaves());
        let own = shape.row(block, leaf) * n;
        let other = shape.row(group.block(1, block), group.leaf(1, leaf)) * n;
        if own == other {
            continue;
        }
        if classes.is_none() {
            sum += squared_distance(&logs[own..][..n], &logs[other..][..n]);
            count += n;
        } else {
            for k in (0..n).filter(|k| live(own + k) && live(other + k)) {
                let difference = f64::from(logs[own + k]) - f64::from(logs[other + k]);
                sum += difference * difference;
                count += 1;
            }
        }
        if sum > most * (1.0 + 1e-9) {
            return None;
        }
    }
    (count > 0).then(|| (sum / count as f64 / 2.0).sqrt())
}

/// Squared distance Σ (a − b)² of two spectra, in four partial sums that are added at the end.
fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    let mut sums = [0.0_f64; 4];
    let square = |a: f32, b: f32| {
        let difference = f64::from(a) - f64::from(b);
        difference * difference
    };
    let (fours, others) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = fours.remainder().iter().zip(others.remainder()).map(|(&a, &b)| square(a, b)).sum();
    for (a, b) in fours.zip(others) {
        for (sum, (&a, &b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += square(a, b);
        }
    }
    sums[0] + sums[1] + (sums[2] + sums[3]) + rest
}
