//! Boxes from boxes: one rule a file, each of which proposes frames for the content of two children.
//!
//! Every rule contains its children's real corners and its triangles' vertices exactly. None looks below its children,
//! so a tree is covered in linear time. [`Obb::or_aabb`] adds the fallback to the axis-parallel box.
//!
//! A box merged with itself, or with one inside it, grows by rounding alone: [`best`] finds its axes and rounds each
//! half-extent up once; the others round the axes anew, which the longest half-extent may carry into the rest, by at
//! most six units in the last place of the longest.

mod best;
mod bounded;
mod combined;
mod quaternion;

pub use best::best;
pub use bounded::{Weight, bounded};
pub use combined::combined;
pub use quaternion::{average, average_rotations, quaternion};

use crate::{Enclosure, Frame, Obb};

/// What a child of a node holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Child {
    /// An inner node: its box.
    Box(Obb),
    /// A leaf: the corners of its triangle.
    Triangle([[f32; 3]; 3]),
}

/// Tightest box along `frame` around both children, as [`crate::bound`].
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
