//! Three-component arithmetic in `f64`.

pub(crate) use canted_obb::vector::{
    Vector, add, cross, dot, length, scale, sub, to_f32 as narrow, to_f64 as wide, unit,
};

/// Two unit vectors that form a right-handed frame with the unit vector `normal`. Source: Duff et al. 2017.
pub(crate) fn tangents([x, y, z]: Vector) -> [Vector; 2] {
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]]
}
