//! Operations on 3-vectors.

/// Vector with components `[x, y, z]`.
pub type Vector = [f64; 3];

/// Returns the inner product `a · b` of two vectors.
#[inline]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the cross product `a × b` of two vectors.
#[inline]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns the sum `a + b` of two vectors.
#[inline]
pub fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Returns the difference `a − b` of two vectors.
#[inline]
pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Returns the vector `a` times the number `s`.
#[inline]
pub fn scale(a: Vector, s: f64) -> Vector {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// Returns the Euclidean length of a vector.
#[inline]
pub fn norm(a: Vector) -> f64 {
    // Correctly rounded on every machine, like the other operations here.
    dot(a, a).sqrt()
}

/// Rotates the vector `a` about +z by the angle with the given cosine and sine.
#[inline]
pub fn turned(a: Vector, [cos, sin]: [f64; 2]) -> Vector {
    [cos * a[0] - sin * a[1], sin * a[0] + cos * a[1], a[2]]
}

/// Rotates the vector `a` about +z by `angle` radians, counter-clockwise seen from the tip of +z.
#[inline]
pub fn about_z(a: Vector, angle: f64) -> Vector {
    let (sin, cos) = libm::sincos(angle);
    turned(a, [cos, sin])
}

/// Rotates a vector about +y by `angle` radians, from +z towards +x.
#[inline]
pub fn about_y([x, y, z]: Vector, angle: f64) -> Vector {
    let (sin, cos) = libm::sincos(angle);
    [cos * x + sin * z, y, cos * z - sin * x]
}

/// Scales the vector `a`, which must not be zero, to unit length.
#[inline]
pub fn unit(a: Vector) -> Vector {
    scale(a, 1.0 / norm(a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn quarter_turns_exchange_axes() {
        let close = |found: Vector, expected: Vector| norm(sub(found, expected)) < 1e-15;
        assert!(close(about_z([1.0, 0.0, 2.0], FRAC_PI_2), [0.0, 1.0, 2.0]));
        assert!(close(about_y([0.0, 3.0, 1.0], FRAC_PI_2), [1.0, 3.0, 0.0]));
        let turned_back = about_y(about_y([0.3, 0.4, 0.5], 0.7), -0.7);
        assert!(close(turned_back, [0.3, 0.4, 0.5]));
    }
}
