use canted_obb::vector::{cross, dot, sub};
use canted_obb::{Aabb, Dop, Enclosure, Frame, Moments, Obb, merge};

use crate::Corners;

/// What a tree is built over: triangles, by their corners, or boxes.
pub trait Leaf: Copy + Send + Sync {
    /// Smallest axis-aligned box around it.
    fn aabb(&self) -> Aabb;

    /// It as the child of a node that merges boxes.
    fn child(&self) -> merge::Child;

    /// Its surface, for principal axes.
    fn moments(&self) -> Moments;

    /// Grows extents along fixed directions to it.
    fn grow_dop(&self, dop: &mut Dop);

    /// Grows a box to it.
    fn grow(&self, enclosure: &mut Enclosure);

    /// Axes, of length one but for rounding, of the leaning box that fits it best.
    fn frame(&self) -> Frame;

    /// Surface area of that box.
    fn oriented_area(&self) -> f64;

    /// Points that every volume above must contain exactly.
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

    /// Along the longest edge: of all rectangles around a triangle the smallest. The axes of the space for a triangle
    /// without area.
    fn frame(&self) -> Frame {
        let [a, b, c] = self.map(|p| p.map(f64::from));
        let edges = [sub(b, a), sub(c, b), sub(a, c)];
        let longest =
            (1..3).fold(0, |best, i| if dot(edges[i], edges[i]) > dot(edges[best], edges[best]) { i } else { best });
        let normal = cross(edges[longest], edges[(longest + 1) % 3]);
        let (edge, up) = (dot(edges[longest], edges[longest]).sqrt(), dot(normal, normal).sqrt());
        // Negated, so that what overflowed to NaN goes the same way.
        if !(up > 0.0 && up.is_finite()) {
            return Obb::IDENTITY_FRAME;
        }
        let (along, normal) = (edges[longest].map(|x| x / edge), normal.map(|x| x / up));
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
        let rounded = |axis: [f64; 3]| axis.map(|x| x as f32);
        [rounded(along), rounded(cross(normal, along)), rounded(normal)]
    }

    /// Both sides of the rectangle along the longest edge, which is twice the triangle.
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

    /// Its own axes, at length one where they are orthogonal.
    fn frame(&self) -> Frame {
        self.frame
    }

    fn oriented_area(&self) -> f64 {
        self.area()
    }

    /// The centre: corners are no `f32` numbers.
    fn points(&self) -> impl Iterator<Item = [f32; 3]> {
        std::iter::once(self.center)
    }
}
