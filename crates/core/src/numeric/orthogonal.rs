//! Orthonormal vectors by the Gram–Schmidt method, in order.

use super::dense::{dot, norm, scale, subtract};

/// Squared lengths of a vector before and after it was made orthogonal to other vectors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Squares {
    pub(crate) before: f64,
    pub(crate) after: f64,
}

/// Subtracts from `vector` its component along `unit`, which has length 1.
#[inline]
pub(crate) fn take_one_away(vector: &mut [f64], unit: &[f64]) {
    let along = dot(vector, unit);
    subtract(vector, along, unit);
}

/// Subtracts from `vector` its components along each of `units`, which have length 1, one after another.
pub(crate) fn take_away(vector: &mut [f64], units: &[Vec<f64>]) {
    for unit in units {
        take_one_away(vector, unit);
    }
}

/// Makes `vector` orthogonal to `units` like [`take_away`], but in two passes, to remove the rounding errors of the
/// first. Two passes suffice (Kahan; Parlett 1980, *The Symmetric Eigenvalue Problem*, section 6-9).
pub(crate) fn take_away_twice(vector: &mut [f64], units: &[Vec<f64>]) -> Squares {
    let before = dot(vector, vector);
    for _ in 0..2 {
        take_away(vector, units);
    }
    Squares { before, after: dot(vector, vector) }
}

/// Returns the component of `vector` orthogonal to the unit vectors `units`, scaled to length 1. `None` if
/// `is_independent` classifies it as rounding error.
pub(crate) fn remainder(
    mut vector: Vec<f64>,
    units: &[Vec<f64>],
    is_independent: impl Fn(Squares) -> bool,
) -> Option<Vec<f64>> {
    let squares = take_away_twice(&mut vector, units);
    (squares.after > 0.0 && is_independent(squares)).then(|| {
        let length = squares.after.sqrt();
        for x in &mut vector {
            *x /= length;
        }
        vector
    })
}

/// Makes vectors orthonormal by the Gram–Schmidt method; drops vectors that `is_independent` classifies as dependent on
/// earlier ones.
pub(crate) fn orthonormalise(vectors: &mut Vec<Vec<f64>>, is_independent: impl Fn(Squares) -> bool) {
    let mut kept: Vec<Vec<f64>> = Vec::with_capacity(vectors.len());
    for vector in vectors.drain(..) {
        kept.extend(remainder(vector, &kept, &is_independent));
    }
    *vectors = kept;
}

/// Makes vectors orthonormal in place by the Gram–Schmidt method; a vector that depends linearly on earlier ones
/// becomes 0.
///
/// It does not use [`orthonormalise`]: decoders run it, and the container format defines one pass and a multiplication
/// by the inverse length.
pub(crate) fn orthonormalise_decoded(vectors: &mut [Vec<f64>]) {
    for i in 0..vectors.len() {
        let (before, rest) = vectors.split_at_mut(i);
        let Some(vector) = rest.first_mut() else { return };
        take_away(vector, before);
        let size = norm(vector);
        scale(vector, if size > 1e-6 { 1.0 / size } else { 0.0 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns four test vectors, the third of which is the sum of the first two.
    fn vectors() -> Vec<Vec<f64>> {
        let a = vec![1.0, 2.0, 0.5, 4.0];
        let b = vec![0.0, 1.0, -1.0, 2.0];
        let sum = a.iter().zip(&b).map(|(a, b)| a + b).collect();
        vec![a, b, sum, vec![3.0, 0.1, 1.0, 1.0]]
    }

    /// Computes the textbook form of the Gram–Schmidt method: each vector minus its projections on earlier ones,
    /// normalised.
    fn plain() -> Vec<Vec<f64>> {
        let mut units: Vec<Vec<f64>> = Vec::new();
        for vector in [0, 1, 3].map(|i| vectors()[i].clone()) {
            let mut left = vector.clone();
            for unit in &units {
                let along: f64 = (0..4).map(|k| vector[k] * unit[k]).sum();
                (0..4).for_each(|k| left[k] -= along * unit[k]);
            }
            let length = left.iter().map(|x| x * x).sum::<f64>().sqrt();
            units.push(left.iter().map(|x| x / length).collect());
        }
        units
    }

    #[track_caller]
    fn assert_close(found: &[Vec<f64>], expected: &[Vec<f64>]) {
        assert_eq!(found.len(), expected.len());
        for (x, y) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((x - y).abs() < 1e-12, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn both_ways_give_the_vectors_of_the_textbook() {
        let mut kept = vectors();
        orthonormalise(&mut kept, |squares| squares.after > 1e-12 * squares.before);
        assert_close(&kept, &plain());
        let mut decoded = vectors();
        orthonormalise_decoded(&mut decoded);
        assert_eq!(decoded.remove(2), [0.0; 4]);
        assert_close(&decoded, &plain());
    }

    #[test]
    fn vectors_of_zeros_are_never_independent() {
        assert_eq!(remainder(vec![0.0; 3], &[], |_| true), None);
        assert_eq!(remainder(vec![0.0, 4.0], &[vec![1.0, 0.0]], |_| true), Some(vec![0.0, 1.0]));
    }
}
