use canted_lbvh::{Child, ChildKind, Corners, Leaf, NodeId, Tree, Volume, Volumes};
use canted_obb::{Aabb, Obb};
use canted_trace::{Slabs, pad_aabb};
use glam::Vec4;

use super::bvh::PairBvh;
use super::child::ChildRef;
use super::node::{AabbPair, SlabPair};
use super::order::{Order, PairOrder};

/// Least number of pairs that a thread lays out.
#[cfg(feature = "parallel")]
const CHUNK: usize = 1 << 12;

/// A leaf with an oriented box.
pub trait OrientedLeaf: Leaf {
    /// The box along [`Leaf::frame`] that contains the leaf exactly.
    fn slabs(&self) -> Slabs;
}

impl OrientedLeaf for Corners {
    fn slabs(&self) -> Slabs {
        Slabs::from_points(self.frame(), *self)
    }
}

impl OrientedLeaf for Obb {
    fn slabs(&self) -> Slabs {
        Slabs::from_obb(self)
    }
}

impl PairBvh {
    /// Lays out `tree` with the boxes in `volumes`, each padded by the reach of the leaves below it.
    ///
    /// `leaves` are in leaf order, `bounds` is the box around all of them.
    #[must_use]
    pub fn new<L: OrientedLeaf>(
        tree: &Tree,
        volumes: &Volumes,
        leaves: &[L],
        bounds: &Aabb,
        pair_order: PairOrder,
    ) -> Self {
        if tree.leaves.is_empty() {
            return Self::empty();
        }
        let Order { refs, aabb_ids, slab_ids } = Order::new(tree, volumes, pair_order);
        let layout = Layout { tree, volumes, leaves, refs };
        let aabb_pairs = if layout.refs.is_empty() {
            make_all(tree.nodes.len(), |i| layout.aabb_pair(i))
        } else {
            make_all(aabb_ids.len(), |i| layout.aabb_pair(aabb_ids[i as usize]))
        };
        let mut bvh = Self {
            aabb_pairs,
            slab_pairs: make_all(slab_ids.len(), |i| layout.slab_pair(slab_ids[i as usize])),
            root: tree.root().map(|root| layout.child_ref(root)),
            root_slabs: Slabs::from_aabb(bounds).padded(bounds.reach()),
            bounds: Obb::from_aabb(bounds),
            reach: bounds.reach(),
            depth: tree.depth,
        };
        if let Some(ChildKind::Inner(root)) = tree.root().map(Child::kind)
            && let Volume::Obb(obb) = volumes.of(root)
        {
            bvh.bounds = *obb;
            bvh.root_slabs = Slabs::from_obb(obb).padded(bounds.reach());
        }
        bvh
    }
}

/// The results of `make` for `0..n`, in order, computed on all threads.
#[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
fn make_all<T: Send>(n: usize, make: impl Fn(u32) -> T + Sync) -> Vec<T> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        (0..n as u32).into_par_iter().with_min_len(CHUNK).map(&make).collect()
    }
    #[cfg(not(feature = "parallel"))]
    (0..n as u32).map(make).collect()
}

struct Layout<'a, L> {
    tree: &'a Tree,
    volumes: &'a Volumes,
    leaves: &'a [L],
    refs: Vec<ChildRef>,
}

impl<L: OrientedLeaf> Layout<'_, L> {
    fn child_ref(&self, child: Child) -> ChildRef {
        match child.kind() {
            ChildKind::Leaf(position) => ChildRef::leaf(position),
            ChildKind::Inner(id) => self.refs.get(id.index()).copied().unwrap_or(ChildRef::aabbs(id.0)),
        }
    }

    fn aabb(&self, child: Child) -> Aabb {
        match child.kind() {
            ChildKind::Leaf(position) => self.leaves[position as usize].aabb(),
            ChildKind::Inner(id) => self.volumes.aabbs[id.index()],
        }
    }

    fn slabs(&self, child: Child) -> Slabs {
        match child.kind() {
            ChildKind::Leaf(position) if self.volumes.is_oriented(child) => self.leaves[position as usize].slabs(),
            ChildKind::Inner(id) => match self.volumes.of(id) {
                Volume::Obb(obb) => Slabs::from_obb(obb),
                Volume::Aabb(aabb) => Slabs::from_aabb(aabb),
            },
            ChildKind::Leaf(_) => Slabs::from_aabb(&self.aabb(child)),
        }
    }

    fn children(&self, id: u32) -> [Child; 2] {
        let node = self.tree.nodes[NodeId(id).index()];
        [node.left, node.right]
    }

    fn aabb_pair(&self, id: u32) -> AabbPair {
        let children = self.children(id);
        let [a, b] = children.map(|child| self.aabb(child)).map(|aabb| pad_aabb(&aabb, aabb.reach()));
        AabbPair {
            planes: std::array::from_fn(|k| Vec4::new(a.min[k], b.min[k], a.max[k], b.max[k])),
            children: children.map(|child| self.child_ref(child)),
        }
    }

    fn slab_pair(&self, id: u32) -> SlabPair {
        let children = self.children(id);
        let [a, b] = children.map(|child| self.slabs(child).padded(self.aabb(child).reach()));
        let [first, second] = children.map(|child| f32::from_bits(self.child_ref(child).0));
        SlabPair {
            rows_xy: std::array::from_fn(|k| Vec4::new(a.rows[k][0], b.rows[k][0], a.rows[k][1], b.rows[k][1])),
            rows_z: [
                Vec4::new(a.rows[0][2], b.rows[0][2], a.rows[1][2], b.rows[1][2]),
                Vec4::new(a.rows[2][2], b.rows[2][2], first, second),
            ],
            planes: std::array::from_fn(|k| Vec4::new(a.lo[k], b.lo[k], a.hi[k], b.hi[k])),
        }
    }
}
