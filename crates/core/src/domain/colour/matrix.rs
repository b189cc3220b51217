//! 3 × 3 matrices: product with a vector, and inverse.

/// 3 × 3 matrix, stored as three rows.
pub(super) type Matrix = [[f64; 3]; 3];

/// Returns the product of a matrix and a vector.
pub(super) fn product(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Returns the inverse of a matrix, by cofactors.
pub(super) const fn inverse(m: Matrix) -> Matrix {
    let [[a, b, c], [d, e, f], [g, h, i]] = m;
    let (p, q, r) = (e * i - f * h, f * g - d * i, d * h - e * g);
    let n = 1.0 / (a * p + b * q + c * r);
    [
        [n * p, n * (c * h - b * i), n * (b * f - c * e)],
        [n * q, n * (a * i - c * g), n * (c * d - a * f)],
        [n * r, n * (b * g - a * h), n * (a * e - b * d)],
    ]
}
