//! What queries are about: BVHs, and single shapes.

use std::sync::Arc;

use canted_obb::PrimId;
use canted_obb::vector::{sub, to_f64};
use canted_wide::{LeafPrimitive, NodeBox, NodeLanes, Subtree, WideBvh};

use crate::shape::Shape;

/// A body of queries: a [`WideBvh`] whose primitives are [`Shape`]s, or a single shape.
pub trait Body {
    /// A node or a leaf.
    #[doc(hidden)]
    type Node: Copy + PartialEq;

    /// The root and its box; `None` for a body without primitives.
    #[doc(hidden)]
    fn root(&self) -> Option<(Self::Node, NodeBox)>;

    /// The point that boxes are relative to.
    #[doc(hidden)]
    fn reference_point(&self) -> [f64; 3];

    /// The frame of aligned nodes.
    #[doc(hidden)]
    fn frame(&self) -> [[f32; 3]; 3];

    /// The boxes of a node; `None` for a leaf.
    #[doc(hidden)]
    fn lanes(&self, node: Self::Node) -> Option<NodeLanes<'_>>;

    /// A child of a node, and its box.
    #[doc(hidden)]
    fn child(&self, node: Self::Node, lane: usize) -> Option<(Self::Node, NodeBox)>;

    /// Calls `visit` with each primitive of a leaf.
    #[doc(hidden)]
    fn each_shape(&self, leaf: Self::Node, visit: impl FnMut(PrimId, &dyn Shape));
}

impl<P: LeafPrimitive> Body for WideBvh<P>
where
    P::Shape: Shape,
{
    type Node = Subtree;

    fn root(&self) -> Option<(Subtree, NodeBox)> {
        Self::root(self).map(|root| (root, self.root_box()))
    }

    fn reference_point(&self) -> [f64; 3] {
        to_f64(Self::reference_point(self))
    }

    fn frame(&self) -> [[f32; 3]; 3] {
        Self::frame(self)
    }

    #[inline]
    fn lanes(&self, node: Subtree) -> Option<NodeLanes<'_>> {
        Self::lanes(self, node)
    }

    #[inline]
    fn child(&self, node: Subtree, lane: usize) -> Option<(Subtree, NodeBox)> {
        Self::child(self, node, lane)
    }

    #[inline]
    fn each_shape(&self, leaf: Subtree, mut visit: impl FnMut(PrimId, &dyn Shape)) {
        self.for_each_in(leaf, |primitive, shape| visit(primitive, shape));
    }
}

/// What is shared, such as the bottom-level BVHs of several scenes.
impl<B: Body> Body for Arc<B> {
    type Node = B::Node;

    fn root(&self) -> Option<(B::Node, NodeBox)> {
        (**self).root()
    }

    fn reference_point(&self) -> [f64; 3] {
        (**self).reference_point()
    }

    fn frame(&self) -> [[f32; 3]; 3] {
        (**self).frame()
    }

    #[inline]
    fn lanes(&self, node: B::Node) -> Option<NodeLanes<'_>> {
        (**self).lanes(node)
    }

    #[inline]
    fn child(&self, node: B::Node, lane: usize) -> Option<(B::Node, NodeBox)> {
        (**self).child(node, lane)
    }

    #[inline]
    fn each_shape(&self, leaf: B::Node, visit: impl FnMut(PrimId, &dyn Shape)) {
        (**self).each_shape(leaf, visit);
    }
}

const IDENTITY: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Least and greatest coordinates of the points of a shape; `None` without points, and if one is not a number.
fn bounds(shape: &(impl Shape + ?Sized)) -> Option<[[f64; 3]; 2]> {
    let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut is_finite = true;
    shape.each_point(&mut |point| {
        is_finite &= point.iter().all(|x| x.is_finite());
        lo = std::array::from_fn(|k| lo[k].min(point[k]));
        hi = std::array::from_fn(|k| hi[k].max(point[k]));
    });
    (is_finite && lo[0] <= hi[0]).then_some([lo, hi])
}

fn center([lo, hi]: [[f64; 3]; 2]) -> [f64; 3] {
    std::array::from_fn(|k| lo[k] + 0.5 * (hi[k] - lo[k]))
}

/// Primitive 0.
impl<S: Shape> Body for S {
    type Node = ();

    fn root(&self) -> Option<((), NodeBox)> {
        let [lo, hi] = bounds(self)?;
        let (center, radius) = (center([lo, hi]), self.radius());
        // The error of the difference is that of coordinates in `f64`, which queries allow for.
        let (lo, hi) = (sub(lo, center).map(|x| x - radius), sub(hi, center).map(|x| x + radius));
        (radius >= 0.0).then_some(((), NodeBox { rows: IDENTITY, lo, hi }))
    }

    fn reference_point(&self) -> [f64; 3] {
        bounds(self).map_or([0.0; 3], center)
    }

    fn frame(&self) -> [[f32; 3]; 3] {
        IDENTITY
    }

    fn lanes(&self, (): ()) -> Option<NodeLanes<'_>> {
        None
    }

    fn child(&self, (): (), _: usize) -> Option<((), NodeBox)> {
        None
    }

    fn each_shape(&self, (): (), mut visit: impl FnMut(PrimId, &dyn Shape)) {
        visit(PrimId(0), self);
    }
}
