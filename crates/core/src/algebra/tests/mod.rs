//! Identities of the algebra over every basis, boundary rule and length, and every error.

mod materials;
mod products;
mod refusals;
mod spectra;

use super::LineSpace;
use crate::transform::{AxisTransform, Boundary, LineBasis};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::sync::Arc;

/// Numbers of samples of the spectra with which sums and products in the compressed domain are tested.
const LENGTHS: [usize; 7] = [1, 2, 3, 5, 8, 75, 91];

fn space(basis: LineBasis, boundary: Boundary, length: usize) -> Arc<LineSpace> {
    LineSpace::new(AxisTransform::Line { basis, boundary }, length).unwrap()
}

fn own(name: &str, length: usize) -> Arc<LineSpace> {
    LineSpace::new(AxisTransform::line(name.parse().unwrap()), length).unwrap()
}

/// Returns a pseudo-random positive test spectrum with structure at every scale.
fn samples(length: usize, seed: u64) -> Vec<f64> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let phase = rng.random::<f64>() * 6.0;
    (0..length).map(|i| 1.0 + 0.6 * (i as f64 * 0.13 + phase).sin() + 0.3 * rng.random::<f64>()).collect()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, x| most.max(x.abs()))
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

fn plain(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
