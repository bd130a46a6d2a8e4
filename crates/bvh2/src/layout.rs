//! A tree and its volumes in the form that rays traverse.

use canted_lbvh::{Child, ChildKind, Corners, Leaf, NodeId, Tree, Volume, Volumes, par};
use canted_obb::{Aabb, Obb};
use canted_trace::{Slabs, pad_aabb};
use glam::Vec4;

use crate::pairs::{AabbPair, ChildRef, PairBvh, SlabPair};

/// Least number of pairs that a thread lays out.
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
fn make_all<T: Send>(n: usize, make: impl Fn(u32) -> T + Sync) -> Vec<T> {
    par::from_fn(n, CHUNK, |i| make(i as u32))
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

/// The order of pairs in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairOrder {
    /// In the order of node numbers: the fastest to lay out.
    Numbered,
    /// Depth first, the child of larger area next to its parent, so most rays read memory forwards.
    /// `benches/TRIED.md` has its gain for rays and its cost for the build.
    DepthFirst,
}

/// The position of each inner node's pair.
pub(crate) struct Order {
    /// The reference to each node. Empty if every pair is axis-aligned and in the position of its node's number.
    pub(crate) refs: Vec<ChildRef>,
    /// Nodes in the order of their axis-aligned pairs.
    pub(crate) aabb_ids: Vec<u32>,
    /// Nodes in the order of their oriented pairs.
    pub(crate) slab_ids: Vec<u32>,
}

impl Order {
    pub(crate) fn new(tree: &Tree, volumes: &Volumes, pair_order: PairOrder) -> Self {
        match pair_order {
            PairOrder::Numbered => Self::numbered(tree, volumes),
            PairOrder::DepthFirst => Self::depth_first(tree, volumes),
        }
    }

    fn numbered(tree: &Tree, volumes: &Volumes) -> Self {
        let mut order = Self { refs: vec![], aabb_ids: vec![], slab_ids: vec![] };
        let ids = || (0..tree.nodes.len() as u32).map(NodeId);
        if ids().any(|id| volumes.children_oriented(id)) {
            order.refs = vec![ChildRef(0); tree.nodes.len()];
            ids().for_each(|id| order.append(id, volumes));
        }
        order
    }

    fn depth_first(tree: &Tree, volumes: &Volumes) -> Self {
        let mut order = Self { refs: vec![ChildRef(0); tree.nodes.len()], aabb_ids: vec![], slab_ids: vec![] };
        let area = |child: Child| match child.kind() {
            ChildKind::Leaf(_) => -1.0,
            ChildKind::Inner(id) => volumes.aabbs[id.index()].area(),
        };
        let mut stack = vec![tree.root()];
        while let Some(Some(child)) = stack.pop() {
            let ChildKind::Inner(id) = child.kind() else { continue };
            order.append(id, volumes);
            let node = &tree.nodes[id.index()];
            let (first, second) =
                if area(node.left) < area(node.right) { (node.right, node.left) } else { (node.left, node.right) };
            stack.extend([Some(second), Some(first)]);
        }
        order
    }

    /// Appends the pair of a node to the pairs of its kind.
    fn append(&mut self, id: NodeId, volumes: &Volumes) {
        let (ids, make): (_, fn(u32) -> ChildRef) = if volumes.children_oriented(id) {
            (&mut self.slab_ids, ChildRef::slabs)
        } else {
            (&mut self.aabb_ids, ChildRef::aabbs)
        };
        self.refs[id.index()] = make(ids.len() as u32);
        ids.push(id.0);
    }
}
