//! Nodes and leaves for walks of the caller, such as over two BVHs at once, and visits of what comes near a ray.

use canted_obb::PrimId;
use canted_obb::round::{down, up};
use canted_trace::{Ray, ScaledRay, with_stack};

use crate::bvh::WideBvh;
use crate::leaf::LeafPrimitive;
use crate::node::{ALIGNED_LINES, ChildWord, DecodedWord, NodeBox, NodeKind, ORIENTED_LINES, node_words, rows};
use crate::simd::{Simd, Task};
use crate::traverse::{LeafRange, TracedRay, Visitor, walk};

/// A node or a leaf of a [`WideBvh`], to be used with that BVH only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subtree(ChildWord);

impl Subtree {
    /// Whether it is a leaf.
    #[must_use]
    pub fn is_leaf(self) -> bool {
        matches!(self.0.kind(), DecodedWord::Leaf { .. })
    }
}

/// The eight boxes of a node, a lane for each; those of slots without a child are empty or far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NodeLanes<'a> {
    /// Boxes in the frame of the mesh, [`WideBvh::frame`]: rows lower x, upper x, lower y and so on.
    Aligned(&'a [[f32; 8]; 8]),
    /// Boxes with a frame each: for each of three axes its x, y, z, the center along it, and the half-extent.
    Oriented(&'a [[f32; 8]; 16]),
}

impl<P: LeafPrimitive> WideBvh<P> {
    /// The root of the nodes; `None` without primitives.
    #[must_use]
    pub fn root(&self) -> Option<Subtree> {
        (self.n_primitives > 0).then_some(Subtree(self.nodes.root))
    }

    /// The box around all primitives.
    #[must_use]
    pub fn root_box(&self) -> NodeBox {
        let reference = self.reference_point().map(f64::from);
        // Differences of f32 lose at most a last bit of f64, so the next f32 outward is beyond it.
        let [lo, hi] = [self.bounds.min, self.bounds.max].map(|end| end.map(f64::from));
        let lo = std::array::from_fn(|k| f64::from(down(lo[k] - reference[k]).next_down()));
        let hi = std::array::from_fn(|k| f64::from(up(hi[k] - reference[k]).next_up()));
        NodeBox { rows: canted_obb::Obb::IDENTITY_FRAME, lo, hi }
    }

    /// The point that boxes are relative to.
    #[must_use]
    pub fn reference_point(&self) -> [f32; 3] {
        self.frame.reference.point()
    }

    /// The boxes of a node; `None` for a leaf.
    #[inline]
    #[must_use]
    pub fn lanes(&self, subtree: Subtree) -> Option<NodeLanes<'_>> {
        let lines = &self.nodes.lines;
        match subtree.0.kind() {
            DecodedWord::Node(NodeKind::Aligned, line) => {
                Some(NodeLanes::Aligned(rows::<ALIGNED_LINES, 8>(lines, line)))
            }
            DecodedWord::Node(NodeKind::Oriented, line) => {
                Some(NodeLanes::Oriented(rows::<ORIENTED_LINES, 16>(lines, line)))
            }
            DecodedWord::Leaf { .. } | DecodedWord::Empty => None,
        }
    }

    /// The child in a lane of a node, and its box; `None` for an empty slot and in a leaf.
    ///
    /// # Panics
    /// If there is no such lane.
    #[inline]
    #[must_use]
    pub fn child(&self, subtree: Subtree, lane: usize) -> Option<(Subtree, NodeBox)> {
        let DecodedWord::Node(kind, line) = subtree.0.kind() else { return None };
        let word = node_words(&self.nodes.lines, kind, line)[lane];
        (word != ChildWord::EMPTY)
            .then(|| (Subtree(word), NodeBox::of_slot(&self.nodes.lines, kind, line, lane, self.frame.rows)))
    }

    /// Calls `visit` with each primitive of a leaf, and its shape; with none of a node. A primitive may be in several leaves.
    #[inline]
    pub fn for_each_in(&self, subtree: Subtree, visit: impl FnMut(PrimId, &P::Shape)) {
        if let DecodedWord::Leaf { first, n } = subtree.0.kind() {
            P::for_each_shape(&self.leaves, LeafRange::new(first, n), visit);
        }
    }

    /// Calls `visit` with each primitive that may come within `distance` of the points of a ray, nearer subtrees first, and with its shape.
    ///
    /// `visit` gets the greatest `t` that is still searched, and returns the new one; a negative one ends the search. A primitive is visited
    /// if a point of it lies within `distance`, in each coordinate, of the point of the ray at such a `t`; others may be visited too, and
    /// one may come twice.
    pub fn visit_along(&self, ray: &Ray, distance: f64, mut visit: impl FnMut(PrimId, &P::Shape, f32) -> f32) {
        let Some(scaled) = ScaledRay::new(ray) else { return };
        let traced = TracedRay::within(&scaled, &self.frame, distance);
        let leaf = &mut |leaf: LeafRange| {
            let mut t_max = leaf.t_max;
            P::for_each_shape(&self.leaves, leaf, |primitive, shape| {
                if t_max >= 0.0 {
                    let before = scaled.caller_t(t_max);
                    let after = visit(primitive, shape, before);
                    // What the caller leaves as it is stays as it is; else rounded up, so that ties are still visited.
                    if after != before {
                        t_max = t_max.min(up(f64::from(after) * scaled.scale()));
                    }
                }
            });
            t_max
        };
        with_stack(self.nodes.stack_len(), |stack| {
            self.path.run(VisitAlong { bvh: self, ray: &traced, stack, called: Called(leaf) });
        });
    }
}

struct VisitAlong<'a, P: LeafPrimitive> {
    bvh: &'a WideBvh<P>,
    ray: &'a TracedRay,
    stack: &'a mut [u64],
    called: Called<'a>,
}

/// Calls a function for each leaf.
struct Called<'a>(&'a mut dyn FnMut(LeafRange) -> f32);

impl<P: LeafPrimitive> Task for VisitAlong<'_, P> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(mut self, simd: S) {
        walk::<S, _, _, true>(
            simd,
            &self.bvh.nodes,
            &self.ray.numbers,
            self.ray.scaled.t_max,
            self.stack,
            &mut self.called,
        );
    }
}

impl Visitor for Called<'_> {
    #[inline(always)]
    fn leaf(&mut self, leaf: LeafRange) -> f32 {
        (self.0)(leaf)
    }

    #[inline(always)]
    fn node(&mut self, _: NodeKind) {}
}
