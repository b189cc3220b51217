//! Orthonormal bases of a few samples on an axis, starting with the polynomials at the samples' positions.

use crate::domain::TriangleMesh;
use crate::numeric::dense::dot;
use crate::numeric::orthogonal::remainder;

/// Positions of the entries of an axis, for fitting polynomials to neighbouring samples.
pub(super) enum Place {
    /// Triangles of a mesh that is fine enough for fitting cubic polynomials.
    Plane(TriangleMesh),
    /// Positions of all entries of a one-dimensional axis, for example its wavelengths.
    Line(Vec<f64>),
    /// Axis whose entries have no order (index, colours) or are too few. Only the mean over it is subtracted when noise
    /// is estimated, not polynomials up to degree 3.
    Unordered,
}

/// Orthonormal vectors on a few neighbouring samples of an axis, by polynomial degree from 2 up. Smooth signals have
/// small coefficients in the high degrees, noise has equal ones in all.
pub(super) struct Basis {
    /// Polynomials of degree 2 at the positions of the samples (on a line, or in the tangent plane of triangles),
    /// orthogonal over these samples to all lower degrees.
    pub(super) second: Vec<Vec<f64>>,
    /// Polynomials of degree 3 at the positions of the samples (on a line, or in the tangent plane of triangles),
    /// orthogonal over these samples to all lower degrees.
    pub(super) third: Vec<Vec<f64>>,
    /// Vectors over the samples that are orthogonal to every polynomial of degree up to 3 in the samples' positions. On
    /// an axis without order they are orthogonal to the constant alone.
    pub(super) high: Vec<Vec<f64>>,
}

/// Fraction of a vector's length below which its remainder outside a span counts as 0, hence the vector as linearly
/// dependent.
const DEPENDENT: f64 = 1e-5;

impl Basis {
    /// Basis of the missing second axis of a block of samples along one axis only: the number 1. Stored as a vector of
    /// high degree, it leaves the coefficients of the first axis unchanged.
    pub(super) fn single() -> Self {
        Self { second: Vec::new(), third: Vec::new(), high: vec![vec![1.0]] }
    }
}

impl Place {
    /// Builds an orthonormal basis, polynomials first, on the samples at `entries`; `None` if no vector orthogonal to
    /// the polynomials would remain.
    pub(super) fn basis(&self, entries: &[usize]) -> Option<Basis> {
        let n = entries.len();
        // Number of polynomials up to degree 3, plus one.
        let fewest = match self {
            Self::Plane(_) => 11,
            Self::Line(_) => 5,
            Self::Unordered => 2,
        };
        if n < fewest {
            return None;
        }
        let mut vectors: Vec<Vec<f64>> = vec![vec![1.0 / (n as f64).sqrt(); n]];
        let (mut second, mut third) = (Vec::new(), Vec::new());
        if let Some((x, y)) = self.coordinates(entries) {
            for degree in 1_i32..=3 {
                let powers = if y.is_some() { 0..=degree } else { 0..=0 };
                for k in powers {
                    let monomial: Vec<f64> =
                        (0..n).map(|i| power(x[i], degree - k) * y.as_ref().map_or(1.0, |y| power(y[i], k))).collect();
                    let Some(vector) = orthonormal(monomial, &vectors) else { continue };
                    match degree {
                        2 => second.push(vector.clone()),
                        3 => third.push(vector.clone()),
                        _ => {}
                    }
                    vectors.push(vector);
                }
            }
        }
        let mut high = Vec::new();
        while vectors.len() < n {
            // The unit vector with the largest remainder.
            let left = |i: usize| 1.0 - vectors.iter().map(|v| v[i] * v[i]).sum::<f64>();
            let (_, best) = (0..n).map(|i| (left(i), i)).max_by(|a, b| a.0.total_cmp(&b.0))?;
            let mut unit = vec![0.0; n];
            unit[best] = 1.0;
            let vector = orthonormal(unit, &vectors)?;
            high.push(vector.clone());
            vectors.push(vector);
        }
        Some(Basis { second, third, high })
    }

    /// Returns the coordinates of the given axis entries in which polynomials are fitted to the samples, each scaled to
    /// about −1..1: one on a line, two in the tangent plane of triangles.
    fn coordinates(&self, entries: &[usize]) -> Option<(Vec<f64>, Option<Vec<f64>>)> {
        match self {
            Self::Plane(mesh) => {
                let points: Vec<[f64; 3]> = entries.iter().map(|&i| mesh.centroid(i).xyz()).collect();
                let sum = points.iter().fold([0.0; 3], |sum, p| [sum[0] + p[0], sum[1] + p[1], sum[2] + p[2]]);
                // Any two directions across the mean do: the axes of its two smallest components, projected.
                let mut order = [0, 1, 2];
                order.sort_by(|&a: &usize, &b| sum[a].abs().total_cmp(&sum[b].abs()));
                let along = |axis: usize| {
                    let squared = dot(&sum, &sum);
                    let v: Vec<f64> = points.iter().map(|p| p[axis] - sum[axis] * dot(p, &sum) / squared).collect();
                    centred(&v)
                };
                Some((along(order[0]), Some(along(order[1]))))
            }
            Self::Line(values) => {
                let values: Vec<f64> = entries.iter().map(|&i| values[i]).collect();
                Some((centred(&values), None))
            }
            Self::Unordered => None,
        }
    }
}

fn power(x: f64, exponent: i32) -> f64 {
    (0..exponent).fold(1.0, |product, _| product * x)
}

/// Shifts and scales values linearly, so that they span the interval −1..1.
fn centred(values: &[f64]) -> Vec<f64> {
    let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), &v| (low.min(v), high.max(v)));
    let half = ((high - low) / 2.0).max(f64::MIN_POSITIVE);
    values.iter().map(|v| (v - f64::midpoint(low, high)) / half).collect()
}

/// Remainder of `vector` outside the span of `vectors`, normalised to length 1; `None` if it vanishes.
fn orthonormal(vector: Vec<f64>, vectors: &[Vec<f64>]) -> Option<Vec<f64>> {
    remainder(vector, vectors, |squares| squares.after.sqrt() > DEPENDENT * squares.before.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Domain;

    #[test]
    fn bases_are_orthonormal_and_complete_for_any_entries() {
        let mesh = TriangleMesh::new(Domain::Sphere, 3).unwrap();
        let even: Vec<f64> = (0..40).map(|i| 380.0 + 5.0 * f64::from(i) + f64::from(i % 3)).collect();
        let cases: [(Place, Vec<usize>, usize, usize); 5] = [
            (Place::Plane(mesh), (48..64).collect(), 4, 6),
            (Place::Plane(mesh), (48..64).filter(|i| i % 5 != 0).collect(), 4, 3),
            (Place::Line(even.clone()), (3..11).collect(), 1, 4),
            (Place::Line(even), vec![3, 4, 6, 7, 9], 1, 1),
            (Place::Unordered, vec![0, 1, 2], 0, 2),
        ];
        for (place, entries, third, high) in cases {
            let basis = place.basis(&entries).unwrap();
            assert_eq!((basis.third.len(), basis.high.len()), (third, high), "{entries:?}");
            let all: Vec<&Vec<f64>> = [&basis.second, &basis.third, &basis.high].into_iter().flatten().collect();
            for (i, a) in all.iter().enumerate() {
                assert!(a.iter().sum::<f64>().abs() < 1e-12);
                for (j, b) in all.iter().enumerate() {
                    assert!((dot(a, b) - f64::from(u8::from(i == j))).abs() < 1e-12);
                }
            }
        }
        assert!(Place::Plane(mesh).basis(&[0, 1, 2, 3]).is_none());
    }
}
