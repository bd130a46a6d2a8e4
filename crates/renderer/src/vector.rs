//! Three-component arithmetic in `f64`, as little as the crate needs.

pub(crate) type Vector = [f64; 3];

#[inline]
pub(crate) fn wide(v: [f32; 3]) -> Vector {
    v.map(f64::from)
}

#[inline]
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
pub(crate) fn narrow(v: Vector) -> [f32; 3] {
    v.map(|x| x as f32)
}

#[inline]
pub(crate) fn add(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] + b[k])
}

#[inline]
pub(crate) fn sub(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] - b[k])
}

#[inline]
pub(crate) fn scale(a: Vector, s: f64) -> Vector {
    a.map(|x| x * s)
}

#[inline]
pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
pub(crate) fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The unit vector along `a`; `None` where `a` has no direction or its square leaves the range of `f64`.
#[inline]
pub(crate) fn unit(a: Vector) -> Option<Vector> {
    let length = length(a);
    (length > 0.0 && length.is_finite()).then(|| scale(a, 1.0 / length))
}

/// Two unit vectors that make a right-handed frame with a unit `normal`; after Duff et al. 2017.
pub(crate) fn tangents([x, y, z]: Vector) -> [Vector; 2] {
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]]
}
