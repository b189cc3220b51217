//! The few operations on 3-vectors that geometry needs.

/// `[x, y, z]`.
pub type Vector = [f64; 3];

/// The inner product.
#[inline]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product `a × b`.
#[inline]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The sum.
#[inline]
pub fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// The difference `a − b`.
#[inline]
pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a` times the number `s`.
#[inline]
pub fn scale(a: Vector, s: f64) -> Vector {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// The length.
#[inline]
pub fn norm(a: Vector) -> f64 {
    // Rounded correctly on every machine, as the other operations here.
    dot(a, a).sqrt()
}

/// `a` turned about +z by the angle with this cosine and sine.
#[inline]
pub fn turned(a: Vector, [cos, sin]: [f64; 2]) -> Vector {
    [cos * a[0] - sin * a[1], sin * a[0] + cos * a[1], a[2]]
}

/// `a` at unit length; `a` must not be zero.
#[inline]
pub fn unit(a: Vector) -> Vector {
    scale(a, 1.0 / norm(a))
}
