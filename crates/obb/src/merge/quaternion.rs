use crate::frame::{self, Frame};
use crate::{Obb, Quaternion, bound_boxes, rotation, vector};

/// Box along the weighted average of two boxes' rotations, in closed form (Ericson 2004, 6.5.3, made safe).
///
/// `weights` are the children's, by area or by count of primitives as the caller likes; both zero weighs equally. A
/// skewed frame gives the rotation nearest to it, a mirrored one that of the same box with an axis reversed. Of the 24
/// rotations that take a box's axes to its axes the one is chosen that brings the second box nearest to the first, so
/// neither the sign of a quaternion nor the order of a child's axes matters.
#[must_use]
pub fn quaternion(a: &Obb, b: &Obb, weights: [f64; 2]) -> Obb {
    bound_boxes(average(a.frame, b.frame, weights), [a, b])
}

/// The frame between two frames, as [`quaternion`] uses it: the weighted sum of quaternions at length one.
///
/// For equal weights this is the chordal mean, halfway along the turn from one to the other.
#[must_use]
pub fn average(a: Frame, b: Frame, weights: [f64; 2]) -> Frame {
    let (p, q) = (rotation_of(a), rotation_of(b));
    let [w_p, w_q] = if weights[0] + weights[1] > 0.0 { weights } else { [1.0; 2] };
    let near = q.times(nearest_symmetry(q.conjugate().times(p)));
    // The symmetry is chosen up to sign; the sum needs both on one half of the sphere.
    let side = if p.dot(near) < 0.0 { -1.0 } else { 1.0 };
    p.scaled(w_p).plus(near.scaled(side * w_q)).normalised().frame()
}

fn rotation_of(axes: Frame) -> Quaternion {
    let axes = frame::right_handed(axes);
    if frame::is_orthonormal(axes) {
        Quaternion::from_frame(axes)
    } else {
        rotation::extract(axes.map(vector::from_f32), rotation::MOST_ITERATIONS).rotation
    }
}

/// The rotation of the cube onto itself nearest to `r`.
///
/// The 24 rotations are, up to sign, the quaternions with one, two or four components of equal size, all others zero:
/// 4 of one, 12 of two, 8 of four. The best of each sort lies along the largest components of `r`.
fn nearest_symmetry(r: Quaternion) -> Quaternion {
    let components = [r.w, r.x, r.y, r.z];
    let size = components.map(f64::abs);
    let first = (1..4).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let second = (0..4).filter(|&k| k != first).fold(None, |best: Option<usize>, k| match best {
        Some(best) if size[k] <= size[best] => Some(best),
        _ => Some(k),
    });
    let second = second.unwrap_or(first);
    let one = size[first];
    let two = (size[first] + size[second]) * std::f64::consts::FRAC_1_SQRT_2;
    let four = 0.5 * size.iter().sum::<f64>();
    let mut nearest = [0.0; 4];
    for k in 0..4 {
        let used = if one >= two && one >= four { k == first } else { two < four || k == first || k == second };
        nearest[k] = if used { 1.0_f64.copysign(components[k]) } else { 0.0 };
    }
    let [w, x, y, z] = nearest;
    Quaternion { w, x, y, z }.normalised()
}
