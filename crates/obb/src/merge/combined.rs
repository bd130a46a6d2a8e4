use super::{Child, Weight, bounded, quaternion};
use crate::Obb;

/// The rule by kind of child (Sabino 2020, 3.5): principal axes of the six vertices of two triangles, of the eleven
/// corners of a box and a triangle, and the quaternion average of two boxes.
///
/// The average weighs by area, `bounded` too; the source weighs nothing.
#[must_use]
pub fn combined(a: &Child, b: &Child) -> Obb {
    match (a, b) {
        (Child::Box(a), Child::Box(b)) => quaternion(a, b, [a.area(), b.area()]),
        _ => bounded(a, b, Weight::Area),
    }
}
