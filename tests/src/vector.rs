//! Vectors in `f64`, for oracles.

/// A vector, or a point.
pub type Vector = [f64; 3];

/// `a - b`.
#[must_use]
pub fn sub(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] - b[k])
}

/// The dot product.
#[must_use]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The cross product.
#[must_use]
pub fn cross(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
}

/// The Euclidean norm.
#[must_use]
pub fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}
