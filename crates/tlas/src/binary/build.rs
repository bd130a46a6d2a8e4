use canted_lbvh::{Child, ChildKind, Corners, Leaf, NodeId, Tree, Volume, Volumes};
use canted_obb::{Aabb, Obb};
use canted_trace::Slabs;
use glam::Vec4;

use super::{AabbPair, Binary, ChildWord, SlabPair};

/// Pairs that one thread lays out at least.
#[cfg(feature = "parallel")]
const CHUNK: usize = 1 << 12;

/// A leaf that a ray can be tested against as a leaning box.
pub trait TracedLeaf: Leaf {
    /// The box along [`Leaf::frame`] that contains it exactly.
    fn slabs(&self) -> Slabs;
}

impl TracedLeaf for Corners {
    fn slabs(&self) -> Slabs {
        Slabs::from_points(self.frame(), *self)
    }
}

impl TracedLeaf for Obb {
    fn slabs(&self) -> Slabs {
        Slabs::from_obb(self)
    }
}

impl Binary {
    /// Lays out `tree` with `volumes` for tracing; `leaves` are in leaf order.
    ///
    /// `bounds` is the box around all leaves.
    #[must_use]
    pub fn new<L: TracedLeaf>(
        tree: &Tree,
        volumes: &Volumes,
        leaves: &[L],
        bounds: &Aabb,
        pair_order: PairOrder,
    ) -> Self {
        if tree.leaves.is_empty() {
            return Self::empty();
        }
        let Order { words, aabb_ids, slab_ids } = match pair_order {
            PairOrder::Numbered => Order::numbered(tree, volumes),
            PairOrder::DepthFirst => Order::depth_first(tree, volumes),
        };
        let layout = Layout { tree, volumes, leaves, words };
        let aabb_pairs = if layout.words.is_empty() {
            make_all(tree.nodes.len(), |i| layout.aabb_pair(i))
        } else {
            make_all(aabb_ids.len(), |i| layout.aabb_pair(aabb_ids[i as usize]))
        };
        let mut binary = Self {
            aabb_pairs,
            slab_pairs: make_all(slab_ids.len(), |i| layout.slab_pair(slab_ids[i as usize])),
            root: tree.root().map(|root| layout.word(root)),
            root_slabs: Slabs::from_aabb(bounds),
            bounds: Obb::from_aabb(bounds),
            reach: bounds.reach(),
            depth: tree.depth,
        };
        if let Some(ChildKind::Inner(root)) = tree.root().map(Child::kind)
            && let Volume::Obb(obb) = volumes.of(root)
        {
            binary.bounds = *obb;
            binary.root_slabs = Slabs::from_obb(obb);
        }
        binary
    }
}

/// What `make` makes of `0..n`, in order, on all threads.
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

/// How pairs follow each other in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairOrder {
    /// As nodes are numbered: the fastest to lay out.
    Numbered,
    /// Depth first, the child of larger area next to its parent: the way that most rays go runs forward through memory.
    /// What it brings, and what it takes of the build, stands in `benches/TRIED.md`.
    DepthFirst,
}

/// Where each inner node's pair stands.
struct Order {
    /// The word by which each node is referred to: its kind and its place among its kind. Empty where every pair is
    /// axis-aligned and stands at its node's number.
    words: Vec<ChildWord>,
    /// Nodes in the order of their axis-aligned pairs.
    aabb_ids: Vec<u32>,
    /// Nodes in the order of their leaning pairs.
    slab_ids: Vec<u32>,
}

impl Order {
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
    fn numbered(tree: &Tree, volumes: &Volumes) -> Self {
        let mut order = Self { words: vec![], aabb_ids: vec![], slab_ids: vec![] };
        let ids = || (0..tree.nodes.len() as u32).map(NodeId);
        if ids().any(|id| volumes.children_oriented(id)) {
            order.words = vec![ChildWord(0); tree.nodes.len()];
            ids().for_each(|id| order.place(id, volumes));
        }
        order
    }

    /// Puts the pair of a node behind those of its kind.
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes")]
    fn place(&mut self, id: NodeId, volumes: &Volumes) {
        let (ids, word): (_, fn(u32) -> ChildWord) = if volumes.children_oriented(id) {
            (&mut self.slab_ids, ChildWord::slabs)
        } else {
            (&mut self.aabb_ids, ChildWord::aabbs)
        };
        self.words[id.index()] = word(ids.len() as u32);
        ids.push(id.0);
    }

    fn depth_first(tree: &Tree, volumes: &Volumes) -> Self {
        let mut order = Self { words: vec![ChildWord(0); tree.nodes.len()], aabb_ids: vec![], slab_ids: vec![] };
        let area = |child: Child| match child.kind() {
            ChildKind::Leaf(_) => -1.0,
            ChildKind::Inner(id) => volumes.aabbs[id.index()].area(),
        };
        let mut stack = vec![tree.root()];
        while let Some(Some(child)) = stack.pop() {
            let ChildKind::Inner(id) = child.kind() else { continue };
            order.place(id, volumes);
            let node = &tree.nodes[id.index()];
            let (first, second) =
                if area(node.left) < area(node.right) { (node.right, node.left) } else { (node.left, node.right) };
            stack.extend([Some(second), Some(first)]);
        }
        order
    }
}

struct Layout<'a, L> {
    tree: &'a Tree,
    volumes: &'a Volumes,
    leaves: &'a [L],
    words: Vec<ChildWord>,
}

impl<L: TracedLeaf> Layout<'_, L> {
    fn word(&self, child: Child) -> ChildWord {
        match child.kind() {
            ChildKind::Leaf(position) => ChildWord::leaf(position),
            ChildKind::Inner(id) => self.words.get(id.index()).copied().unwrap_or(ChildWord::aabbs(id.0)),
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
        let [a, b] = children.map(|child| self.aabb(child));
        AabbPair {
            planes: std::array::from_fn(|k| Vec4::new(a.min[k], b.min[k], a.max[k], b.max[k])),
            children: children.map(|child| self.word(child)),
        }
    }

    fn slab_pair(&self, id: u32) -> SlabPair {
        let children = self.children(id);
        let [a, b] = children.map(|child| self.slabs(child));
        let [first, second] = children.map(|child| f32::from_bits(self.word(child).0));
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
