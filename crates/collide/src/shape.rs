//! Convex shapes.

use canted_obb::vector::to_f64;
use canted_obb::{Aabb, Obb};
use canted_trace::Sphere;

/// A convex solid: all points within a radius of the convex hull of some points.
///
/// One point makes a ball, two a segment or a capsule, three a triangle, eight a box. Implement it for the primitives of a
/// [`WideBvh`](canted_wide::WideBvh) of your own to use the BVH as a [`Body`](crate::Body); a single shape is a body, too.
pub trait Shape {
    /// Calls `visit` with each point, object space. A shape without points touches nothing.
    fn each_point(&self, visit: &mut dyn FnMut([f64; 3]));

    /// How far the shape reaches beyond the hull of its points: finite, not negative.
    ///
    /// Similarities map a shape with a radius exactly. Under another pose the radius is multiplied by at most the least stretch, so what is compared lies
    /// in the image.
    fn radius(&self) -> f64 {
        0.0
    }
}

/// A triangle by its vertices.
impl Shape for [[f32; 3]; 3] {
    #[inline]
    fn each_point(&self, visit: &mut dyn FnMut([f64; 3])) {
        self.iter().for_each(|&vertex| visit(to_f64(vertex)));
    }
}

/// The ball, not only its surface.
impl Shape for Sphere {
    fn each_point(&self, visit: &mut dyn FnMut([f64; 3])) {
        visit(to_f64(self.center));
    }

    fn radius(&self) -> f64 {
        f64::from(self.radius)
    }
}

/// The solid box; empty ones have no points and touch nothing.
impl Shape for Aabb {
    fn each_point(&self, visit: &mut dyn FnMut([f64; 3])) {
        let planes = [self.min, self.max].map(to_f64);
        if !self.is_empty() {
            (0..8).for_each(|corner| visit(std::array::from_fn(|k| planes[corner >> k & 1][k])));
        }
    }
}

/// The solid box, by its corners, which are computed in `f64`.
impl Shape for Obb {
    fn each_point(&self, visit: &mut dyn FnMut([f64; 3])) {
        self.corners().into_iter().for_each(visit);
    }
}

/// A segment; its ends may be equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Both ends.
    pub ends: [[f64; 3]; 2],
}

impl Shape for Segment {
    fn each_point(&self, visit: &mut dyn FnMut([f64; 3])) {
        self.ends.into_iter().for_each(visit);
    }
}

/// All points within a radius of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Both ends of the segment.
    pub ends: [[f64; 3]; 2],
    /// Radius.
    pub radius: f64,
}

impl Shape for Capsule {
    fn each_point(&self, visit: &mut dyn FnMut([f64; 3])) {
        self.ends.into_iter().for_each(visit);
    }

    fn radius(&self) -> f64 {
        self.radius
    }
}

/// The convex hull of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Hull {
    /// The points, in any order.
    pub points: Vec<[f64; 3]>,
}

impl Shape for Hull {
    fn each_point(&self, visit: &mut dyn FnMut([f64; 3])) {
        self.points.iter().for_each(|&point| visit(point));
    }
}
