//! Three-component vectors in `f32`, the precision of the GPU.

pub(super) use canted_obb::vector::dot;

/// Normalizes `v`, which is not zero.
///
/// Scales by the largest component first, because half vectors near the horizon may be too short to be squared.
pub(super) fn unit(v: [f32; 3]) -> [f32; 3] {
    let largest = v[0].abs().max(v[1].abs()).max(v[2].abs());
    let v = v.map(|x| x / largest);
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

pub(super) fn mean(color: [f32; 3]) -> f32 {
    (color[0] + color[1] + color[2]) / 3.0
}
