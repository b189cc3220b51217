//! The few operations on 3-vectors that geometry needs.

pub(crate) type Vector = [f64; 3];

#[inline]
pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
pub(crate) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline]
pub(crate) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
pub(crate) fn scale(a: Vector, s: f64) -> Vector {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline]
pub(crate) fn norm(a: Vector) -> f64 {
    // Rounded correctly on every machine, as the other operations here.
    dot(a, a).sqrt()
}

/// `a` turned about +z by the angle with this cosine and sine.
#[inline]
pub(crate) fn turned(a: Vector, [cos, sin]: [f64; 2]) -> Vector {
    [cos * a[0] - sin * a[1], sin * a[0] + cos * a[1], a[2]]
}

/// `a` at unit length; `a` must not be zero.
#[inline]
pub(crate) fn unit(a: Vector) -> Vector {
    scale(a, 1.0 / norm(a))
}
