//! Three-vectors of `f64`, the few operations that fits need.

pub(crate) type Vector = [f64; 3];

#[inline]
pub(crate) fn from_f32(v: [f32; 3]) -> Vector {
    v.map(f64::from)
}

#[inline]
#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
pub(crate) fn to_f32(v: Vector) -> [f32; 3] {
    v.map(|x| x as f32)
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

/// Greatest absolute component.
#[inline]
pub(crate) fn reach(a: Vector) -> f64 {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}

/// The vector at length one; `None` for zero and for what is not finite. Safe at any scale.
pub(crate) fn normalized(a: Vector) -> Option<Vector> {
    let reach = reach(a);
    if !(reach > 0.0 && a.iter().all(|x| x.is_finite())) {
        return None;
    }
    let a = scale(a, crate::round::binade_inverse(reach));
    Some(scale(a, 1.0 / length(a)))
}
