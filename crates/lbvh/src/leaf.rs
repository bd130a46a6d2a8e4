use canted_obb::vector::{cross, dot, sub};
use canted_obb::{Aabb, Dop, Enclosure, Frame, Moments, Obb, merge};

use crate::Corners;

/// A primitive of a tree: a triangle, by its corners, or a box.
pub trait Leaf: Copy + Send + Sync {
    /// Its axis-aligned bounding box.
    fn aabb(&self) -> Aabb;

    /// The leaf as input of [`merge`].
    fn child(&self) -> merge::Child;

    /// Moments of its surface, for principal axes.
    fn moments(&self) -> Moments;

    /// Adds it to a DOP.
    fn grow_dop(&self, dop: &mut Dop);

    /// Adds it to an enclosure.
    fn grow(&self, enclosure: &mut Enclosure);

    /// Axes of its best oriented box, of unit length up to rounding.
    fn frame(&self) -> Frame;

    /// Surface area of that box.
    fn oriented_area(&self) -> f64;

    /// Points that every volume above contains exactly.
    fn points(&self) -> impl Iterator<Item = [f32; 3]>;
}

impl Leaf for Corners {
    #[inline]
    fn aabb(&self) -> Aabb {
        let [a, b, c] = *self;
        let mut aabb = Aabb { min: a, max: a };
        aabb.grow(b);
        aabb.grow(c);
        aabb
    }

    fn child(&self) -> merge::Child {
        merge::Child::Triangle(*self)
    }

    fn moments(&self) -> Moments {
        Moments::from_triangle(*self)
    }

    fn grow_dop(&self, dop: &mut Dop) {
        self.iter().for_each(|&corner| dop.grow(corner));
    }

    fn grow(&self, enclosure: &mut Enclosure) {
        self.iter().for_each(|&corner| enclosure.add_point(corner));
    }

    /// Along the longest edge, which gives the smallest rectangle of a triangle; the identity for a degenerate one.
    fn frame(&self) -> Frame {
        let [a, b, c] = self.map(|p| p.map(f64::from));
        let edges = [sub(b, a), sub(c, b), sub(a, c)];
        let longest =
            (1..3).fold(0, |best, i| if dot(edges[i], edges[i]) > dot(edges[best], edges[best]) { i } else { best });
        let normal = cross(edges[longest], edges[(longest + 1) % 3]);
        let (edge, up) = (dot(edges[longest], edges[longest]).sqrt(), dot(normal, normal).sqrt());
        // Negated to reject NaN from an overflow too.
        if !(up > 0.0 && up.is_finite()) {
            return Obb::IDENTITY_FRAME;
        }
        let (along, normal) = (edges[longest].map(|x| x / edge), normal.map(|x| x / up));
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
        let rounded = |axis: [f64; 3]| axis.map(|x| x as f32);
        [rounded(along), rounded(cross(normal, along)), rounded(normal)]
    }

    /// Both sides of the rectangle along the longest edge, which has twice the area of the triangle.
    fn oriented_area(&self) -> f64 {
        let [a, b, c] = self.map(|p| p.map(f64::from));
        let normal = cross(sub(b, a), sub(c, a));
        2.0 * dot(normal, normal).sqrt()
    }

    fn points(&self) -> impl Iterator<Item = [f32; 3]> {
        self.iter().copied()
    }
}

/// The box of an instance.
impl Leaf for Obb {
    fn aabb(&self) -> Aabb {
        Self::aabb(self)
    }

    fn child(&self) -> merge::Child {
        merge::Child::Box(*self)
    }

    fn moments(&self) -> Moments {
        Moments::from_box_corners(self, self.area())
    }

    #[expect(clippy::cast_possible_truncation, reason = "the extents only choose a frame")]
    fn grow_dop(&self, dop: &mut Dop) {
        self.corners().iter().for_each(|corner| dop.grow(corner.map(|x| x as f32)));
    }

    fn grow(&self, enclosure: &mut Enclosure) {
        enclosure.add_box(self);
    }

    /// Its own axes.
    fn frame(&self) -> Frame {
        self.frame
    }

    fn oriented_area(&self) -> f64 {
        self.area()
    }

    /// The center only: corners are not representable in `f32`.
    fn points(&self) -> impl Iterator<Item = [f32; 3]> {
        std::iter::once(self.center)
    }
}
