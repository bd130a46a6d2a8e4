//! Boxes of two children, for building a hierarchy from the leaves up. Each rule proposes a frame.
//!
//! Every rule contains the exact corners of boxes and the vertices of triangles. None looks below the two children, so a
//! hierarchy is built in linear time. [`Obb::or_aabb`] adds the fallback to the axis-aligned box.
//!
//! A box merged with itself, or with a box inside it, grows by rounding only: [`best`] keeps its axes and rounds each
//! half-extent up once; the other rules round the axes again, which adds at most six units in the last place of the
//! longest half-extent to each.

use core::f64::consts::FRAC_1_SQRT_2;

use crate::{
    Enclosure, Moments, Obb, Quaternion, bound_boxes,
    frame::{self, Frame},
    rotation,
    vector::{self, cross, sub},
};

/// A child of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Child {
    /// The box of an inner node.
    Box(Obb),
    /// The vertices of the triangle in a leaf.
    Triangle([[f32; 3]; 3]),
}

/// Tightest box along `frame` that contains both children, as [`crate::bound`].
#[inline]
#[must_use]
pub fn enclose(frame: Frame, children: [&Child; 2]) -> Obb {
    let origin = match children[0] {
        Child::Box(child) => child.center,
        Child::Triangle([corner, ..]) => *corner,
    };
    let mut enclosure = Enclosure::new(frame, origin);
    for child in children {
        match child {
            Child::Box(child) => enclosure.add_box(child),
            Child::Triangle(corners) => corners.iter().for_each(|&corner| enclosure.add_point(corner)),
        }
    }
    enclosure.finish()
}

/// Remaining correlation between axes: a thousandth of the thinner extent is less than the corners determine.
const TOLERANCE: f64 = 1e-3;

/// The box of least area along these frames, the first of equals: that of each child, their average weighted by area, the
/// principal axes of `content`, and the identity.
///
/// `content` are the moments of everything below, from [`Moments::merged`].
#[must_use]
pub fn best(a: &Obb, b: &Obb, content: Option<&Moments>) -> Obb {
    let candidates: [Option<Frame>; 5] = [
        Some(a.frame),
        Some(b.frame),
        Some(average(a.frame, b.frame, [a.area(), b.area()])),
        content.map(|content| content.axes(TOLERANCE)),
        Some(frame::IDENTITY),
    ];
    let children = [&Child::Box(*a), &Child::Box(*b)];
    let mut least: Option<(f64, Obb)> = None;
    for frame in candidates.into_iter().flatten() {
        let candidate = enclose(frame, children);
        let area = candidate.area();
        if least.is_none_or(|(least, _)| area < least) {
            least = Some((area, candidate));
        }
    }
    least.map_or(*a, |(_, best)| best)
}

/// A rule chosen by the kind of the children: [`quaternion`] for two boxes, [`bounded`] where a child is a triangle.
///
/// This is the combined strategy of Sabino 2020, 3.5, with two differences. The source fits two leaves by variant 1, the
/// principal axes of all vertices below; for two leaves that is the same set of six vertices. And both rules weigh the
/// children by surface area, where the source weighs nothing.
#[must_use]
pub fn combined(a: &Child, b: &Child) -> Obb {
    match (a, b) {
        (Child::Box(a), Child::Box(b)) => quaternion(a, b, [a.area(), b.area()]),
        _ => bounded(a, b, Weight::Area),
    }
}

/// Weights of the corners in [`bounded`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Weight {
    /// Every corner the same, as in the sources: a tiny box weighs as much as a large sibling.
    Corners,
    /// By the surface area of the child, both sides for a triangle; [`Weight::Corners`] where neither has an area.
    #[default]
    Area,
}

/// Remaining correlation between axes: no more than rounding the frame to `f32` leaves, so a box merged with itself
/// keeps its axes.
const CORNER_TOLERANCE: f64 = f32::EPSILON as f64;

/// Box along the principal axes of the corners of both children, 16, 11 or 6 points (Ericson 2004; Sabino 2020, 3.5,
/// variant 2).
///
/// The scatter of the corners of a box has a closed form, so no corners are computed.
#[must_use]
pub fn bounded(a: &Child, b: &Child, weight: Weight) -> Obb {
    let areas = match weight {
        Weight::Area => [surface(a), surface(b)],
        Weight::Corners => [0.0; 2],
    };
    let [a_moments, b_moments] = if areas[0] + areas[1] > 0.0 {
        [moments(a, areas[0]), moments(b, areas[1])]
    } else {
        [moments(a, n_corners(a)), moments(b, n_corners(b))]
    };
    enclose(a_moments.merged(&b_moments).axes(CORNER_TOLERANCE), [a, b])
}

fn n_corners(child: &Child) -> f64 {
    match child {
        Child::Box(_) => 8.0,
        Child::Triangle(_) => 3.0,
    }
}

/// Surface area in square scene units.
fn surface(child: &Child) -> f64 {
    match child {
        Child::Box(child) => child.area(),
        Child::Triangle(corners) => {
            let [a, b, c] = corners.map(vector::to_f64);
            vector::length(cross(sub(b, a), sub(c, a)))
        }
    }
}

/// Moments of the corners of a child, with a total of `weight`.
fn moments(child: &Child, weight: f64) -> Moments {
    match child {
        Child::Box(child) => Moments::from_box_corners(child, weight),
        Child::Triangle(corners) => {
            let corners = Moments::from_points(*corners);
            let each = weight / corners.weight;
            Moments { weight, mean: corners.mean, scatter: corners.scatter.map(|x| x * each) }
        }
    }
}

/// Box along the weighted average of two boxes' rotations, in closed form (Ericson 2004, 6.5.3, made safe).
///
/// `weights` are those of the children, e.g. areas or primitive counts; two zeros weigh equally. A skewed frame is
/// replaced by its nearest rotation, a mirrored one by that of the same box with an axis reversed. Of the 24 rotations
/// that map the axes of a box to its axes, the one that brings the second box nearest to the first is chosen. So neither
/// the sign of a quaternion nor the order of the axes matters.
#[must_use]
pub fn quaternion(a: &Obb, b: &Obb, weights: [f64; 2]) -> Obb {
    bound_boxes(average(a.frame, b.frame, weights), [a, b])
}

/// The weighted average of two frames, as [`quaternion`] uses it.
#[must_use]
pub fn average(a: Frame, b: Frame, weights: [f64; 2]) -> Frame {
    average_rotations(rotation_of(a), rotation_of(b), weights).frame()
}

/// The weighted average of two unit quaternions, after a symmetry of the box has brought the second nearest to the
/// first.
///
/// For equal weights this is the chordal mean, halfway along the rotation from one to the other (Markley et al. 2007).
#[inline]
#[must_use]
pub fn average_rotations(p: Quaternion, q: Quaternion, weights: [f64; 2]) -> Quaternion {
    let [w_p, w_q] = if weights[0] + weights[1] > 0.0 { weights } else { [1.0; 2] };
    // Both signs of a symmetry are considered; the chosen one has a positive product, so the sum cannot cancel.
    let near = q.times(nearest_symmetry(q.conjugate().times(p)));
    p.scaled(w_p).plus(near.scaled(w_q)).normalized()
}

fn rotation_of(axes: Frame) -> Quaternion {
    let axes = frame::right_handed(axes);
    if frame::is_orthonormal(axes) {
        Quaternion::from_frame(axes)
    } else {
        rotation::extract(axes.map(vector::to_f64), rotation::MAX_ITERATIONS).rotation
    }
}

/// The rotational symmetry of the cube nearest to `r`, as the unit quaternion with the nearer sign.
///
/// The 24 symmetries are, up to sign, the quaternions with one, two or four non-zero components of equal magnitude. The
/// best of each kind uses the largest components of `r`, the first of equals.
fn nearest_symmetry(r: Quaternion) -> Quaternion {
    let components = [r.w, r.x, r.y, r.z];
    let [w, x, y, z] = components.map(f64::abs);
    let largest = |a: usize, b: usize| if components[b].abs() > components[a].abs() { b } else { a };
    let first = largest(largest(0, 1), largest(2, 3));
    let second = (0..4).filter(|&k| k != first).reduce(largest).unwrap_or(first);
    let one = components[first].abs();
    let two = (one + components[second].abs()) * FRAC_1_SQRT_2;
    let four = 0.5 * ((w + x) + (y + z));
    let mut nearest = [0.0; 4];
    if one >= two && one >= four {
        nearest[first] = 1.0;
    } else if two >= four {
        nearest[first] = FRAC_1_SQRT_2;
        nearest[second] = FRAC_1_SQRT_2;
    } else {
        nearest = [0.5; 4];
    }
    let [w, x, y, z] = core::array::from_fn(|k| nearest[k].copysign(components[k]));
    Quaternion { w, x, y, z }
}
