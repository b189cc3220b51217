//! Inner products of synthesis functions, with which dot products of coefficients equal sums over samples.

use super::entry::Entry;
use super::windows::Windows;

/// Symmetric matrix of the inner products `⟨ψ_i, ψ_j⟩` of n basis functions, with one weight per sample: n² numbers,
/// row by row.
#[derive(Clone, Debug)]
pub(super) struct InnerProducts {
    size: usize,
    values: Vec<f64>,
}

impl InnerProducts {
    /// Computes all inner products of basis functions on a signal of `length` samples; without `weights` every sample
    /// has weight 1.
    pub(super) fn of(functions: &Windows, length: usize, weights: Option<&[f64]>) -> Self {
        let size = functions.len();
        let mut values = vec![0.0; size * size];
        let mut weighted = vec![0.0; length];
        for i in 0..size {
            weighted.fill(0.0);
            functions.add(i, 1.0, &mut weighted);
            if let Some(weights) = weights {
                weighted.iter_mut().zip(weights).for_each(|(x, w)| *x *= w);
            }
            for j in 0..=i {
                let product = functions.times(j, &weighted);
                values[i * size + j] = product;
                values[j * size + i] = product;
            }
        }
        Self { size, values }
    }

    /// Returns the inner product of basis functions `i` and `j`.
    ///
    /// # Panics
    /// If `i` or `j` is not the index of a coefficient.
    pub(super) fn at(&self, i: usize, j: usize) -> f64 {
        assert!(i < self.size && j < self.size, "coefficients {i} and {j} of {}", self.size);
        self.values[i * self.size + j]
    }

    /// Returns `Σ a_i·b_j·⟨ψ_i, ψ_j⟩`: the inner product of two functions with coefficients `a` and `b`.
    pub(super) fn sum(&self, a: &[Entry], b: &[Entry]) -> f64 {
        let row = |a: &Entry| {
            let row = &self.values[a.index as usize * self.size..][..self.size];
            a.value * b.iter().map(|b| row[b.index as usize] * b.value).sum::<f64>()
        };
        a.iter().map(row).sum()
    }
}
