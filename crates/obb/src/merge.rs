//! Boxes of two children, for building a hierarchy from the leaves up. Each rule proposes a frame.
//!
//! Every rule contains the exact corners of boxes and the vertices of triangles. None looks below the two children, so a
//! hierarchy is built in linear time. [`Obb::or_aabb`] adds the fallback to the axis-aligned box.
//!
//! A box merged with itself, or with a box inside it, grows by rounding only: [`best`] keeps its axes and rounds each
//! half-extent up once; the other rules round the axes again, which adds at most six units in the last place of the
//! longest half-extent to each.

mod bounded;
mod quaternion;

pub use bounded::{Weight, bounded};
pub use quaternion::{average, average_rotations, quaternion};

use crate::{Enclosure, Frame, Moments, Obb, frame};

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
