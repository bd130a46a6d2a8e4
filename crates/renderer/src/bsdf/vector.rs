//! Three-component arithmetic in `f32`, the precision that a GPU has too.

pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The unit vector along `v`, which is not zero.
///
/// Scaled by its largest component first: half vectors at the horizon may be too short to be squared.
pub(super) fn unit(v: [f32; 3]) -> [f32; 3] {
    let largest = v[0].abs().max(v[1].abs()).max(v[2].abs());
    let v = v.map(|x| x / largest);
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

pub(super) fn mean(colour: [f32; 3]) -> f32 {
    (colour[0] + colour[1] + colour[2]) / 3.0
}
