//! A binary BVH over any leaves: one node holds the boxes of two siblings, so one step tests both.

use canted_obb::{Aabb, Obb};
use canted_trace::Slabs;
use glam::Vec4;

/// A binary BVH over leaves of any kind: it stores boxes and leaf positions, and reports the leaves that a ray may hit.
///
/// Boxes carry the part of the padding that depends on their content, so a [`SlabRay`](canted_trace::SlabRay) needs no reach:
/// `SlabRay::new(&ray, 0.0)`, or `SlabRay::with_error(&ray, 0.0, error)` for leaves other than triangles.
///
/// [`Bvh2`](crate::Bvh2) adds triangles. Pairs of two axis-aligned boxes take 64 bytes, pairs with an oriented box 128.
#[derive(Clone, Debug)]
pub struct PairBvh {
    pub(crate) aabb_pairs: Vec<AabbPair>,
    pub(crate) slab_pairs: Vec<SlabPair>,
    pub(crate) root: Option<ChildRef>,
    pub(crate) root_slabs: Slabs,
    pub(crate) bounds: Obb,
    pub(crate) reach: f32,
    pub(crate) depth: u32,
}

impl PairBvh {
    /// A BVH without leaves.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            aabb_pairs: vec![],
            slab_pairs: vec![],
            root: None,
            root_slabs: Slabs::from_aabb(&Aabb::EMPTY),
            bounds: Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] },
            reach: 0.0,
            depth: 0,
        }
    }

    /// The box of the root; a point at the origin if there are no leaves.
    #[must_use]
    pub fn bounds(&self) -> &Obb {
        &self.bounds
    }

    /// Greatest absolute coordinate of the leaves' bounds.
    #[must_use]
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// Number of nodes on the longest path from the root to a leaf, including the leaf.
    #[must_use]
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Memory of all pairs.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        size_of_val(&self.aabb_pairs[..]) + size_of_val(&self.slab_pairs[..])
    }

    /// Number of pairs of two axis-aligned boxes, and of pairs with an oriented box.
    #[must_use]
    pub fn n_pairs(&self) -> (usize, usize) {
        (self.aabb_pairs.len(), self.slab_pairs.len())
    }

    /// Calls `visit` with the box of each node and leaf, relative to the reference point of what was given: the box, its level, 0 for
    /// the root, and whether it is a leaf. Parents come before their children.
    ///
    /// Boxes are those that rays are tested with, up to rounding: with the part of the padding that depends on their content.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        let mut open: Vec<(ChildRef, Obb, u32)> = self.root.map(|root| (root, self.bounds, 0)).into_iter().collect();
        while let Some((child, obb, level)) = open.pop() {
            let pair = self.pair(child);
            visit(obb, level, pair.is_none());
            let children = pair.into_iter().flatten().rev();
            open.extend(children.filter_map(|(child, obb)| Some((child, obb?, level + 1))));
        }
    }

    /// The children of a pair and their boxes; `None` for a leaf.
    fn pair(&self, child: ChildRef) -> Option<[(ChildRef, Option<Obb>); 2]> {
        let (children, rows, planes): (_, [[[f32; 3]; 3]; 2], &[Vec4; 3]) = match child.kind() {
            ChildRefKind::Leaf(_) => return None,
            ChildRefKind::Aabbs(index) => {
                let pair = &self.aabb_pairs[index as usize];
                (pair.children, [Obb::IDENTITY_FRAME; 2], &pair.planes)
            }
            ChildRefKind::Slabs(index) => {
                let pair = &self.slab_pairs[index as usize];
                let row = |i: usize, k: usize| {
                    let z = pair.rows_z[k / 2];
                    [pair.rows_xy[k][i], pair.rows_xy[k][2 + i], z[2 * (k % 2) + i]]
                };
                (pair.children(), [0, 1].map(|i| std::array::from_fn(|k| row(i, k))), &pair.planes)
            }
        };
        let ends = |i: usize| std::array::from_fn(|k| planes[k][i]);
        Some([0, 1].map(|i| (children[i], Obb::from_slabs(rows[i], ends(i), ends(2 + i)))))
    }
}

/// A child of a pair: a leaf, or a pair of either kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct ChildRef(pub(crate) u32);

/// What a [`ChildRef`] refers to.
pub(crate) enum ChildRefKind {
    /// The position of a leaf.
    Leaf(u32),
    /// The index of a pair with two axis-aligned boxes.
    Aabbs(u32),
    /// The index of a pair with an oriented box.
    Slabs(u32),
}

impl ChildRef {
    const LEAF: u32 = 1 << 31;
    const SLABS: u32 = 1 << 30;

    pub(crate) fn leaf(position: u32) -> Self {
        Self(position | Self::LEAF)
    }

    pub(crate) fn aabbs(index: u32) -> Self {
        Self(index)
    }

    pub(crate) fn slabs(index: u32) -> Self {
        Self(index | Self::SLABS)
    }

    #[inline(always)]
    pub(crate) fn kind(self) -> ChildRefKind {
        if self.0 & Self::LEAF != 0 {
            ChildRefKind::Leaf(self.0 & !Self::LEAF)
        } else if self.0 & Self::SLABS != 0 {
            ChildRefKind::Slabs(self.0 & !Self::SLABS)
        } else {
            ChildRefKind::Aabbs(self.0)
        }
    }
}

/// Two axis-aligned siblings.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct AabbPair {
    /// For each axis: lower planes of both children, then upper planes.
    pub(crate) planes: [Vec4; 3],
    pub(crate) children: [ChildRef; 2],
}

/// Two siblings, at least one of them with an oriented box: three unit rows each, with an interval along each row.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct SlabPair {
    /// For each row: x of both children, y of both.
    pub(crate) rows_xy: [Vec4; 3],
    /// z of both children, for rows 0 and 1, then row 2; the last two lanes hold the bits of the child references.
    pub(crate) rows_z: [Vec4; 2],
    /// For each row: lower ends of both children, then upper ends.
    pub(crate) planes: [Vec4; 3],
}
