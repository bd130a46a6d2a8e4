//! Bounding volumes of nodes: strategies, and the pass that computes them from the leaves up.

use canted_obb::{Aabb, Dop, Enclosure, Moments, Obb, eigen, merge};

use crate::{
    Child, ChildKind, Leaf, Node, NodeId, Tree,
    bottom_up::{bottom_up, bottom_up_into},
    par,
};

/// The bounding volume of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Volume<'a> {
    /// Axis-aligned.
    Aabb(&'a Aabb),
    /// Oriented.
    Obb(&'a Obb),
}

impl Volume<'_> {
    /// Surface area in square scene units.
    #[must_use]
    pub fn area(&self) -> f64 {
        match self {
            Self::Aabb(aabb) => aabb.area(),
            Self::Obb(obb) => obb.area(),
        }
    }

    /// Volume in cubic scene units.
    #[must_use]
    pub fn volume(&self) -> f64 {
        match self {
            Self::Aabb(aabb) => aabb.volume(),
            Self::Obb(obb) => obb.volume(),
        }
    }
}

/// How oriented volumes are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Strategy {
    /// Axis-aligned boxes only.
    #[default]
    Aabb,
    /// Principal axes of the surface below, extents of every point below.
    PcaUnbounded,
    /// Principal axes of the corners of both children: [`merge::bounded`](canted_obb::merge::bounded).
    PcaBounded,
    /// The average rotation of both children: [`merge::quaternion`](canted_obb::merge::quaternion()).
    Quaternion,
    /// As [`Strategy::Quaternion`] where both children are boxes, as [`Strategy::PcaBounded`] where one is a triangle:
    /// [`merge::combined`](canted_obb::merge::combined).
    Combined,
    /// The best of sixteen fixed frames, by extents along fixed directions: [`canted_obb::Dop`].
    Dop,
}

impl Strategy {
    /// All strategies, the axis-aligned one first.
    pub const ALL: [Self; 6] =
        [Self::Aabb, Self::PcaUnbounded, Self::PcaBounded, Self::Quaternion, Self::Combined, Self::Dop];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Aabb => "aabb",
            Self::PcaUnbounded => "pca-unbounded",
            Self::PcaBounded => "pca-bounded",
            Self::Quaternion => "quaternion",
            Self::Combined => "combined",
            Self::Dop => "dop",
        }
    }
}

/// Configuration of [`crate::volumes()`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VolumeConfig {
    /// How oriented volumes are computed.
    pub strategy: Strategy,
    /// Whether to use the axis-aligned box where the oriented one has no less area. A loose oriented box would also loosen
    /// the boxes above it.
    pub fallback: bool,
}

impl Default for VolumeConfig {
    fn default() -> Self {
        Self { strategy: Strategy::Aabb, fallback: true }
    }
}

/// Relative traversal costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Test of an axis-aligned box.
    pub aabb: f64,
    /// Test of an oriented box.
    pub obb: f64,
    /// Test of a primitive.
    pub primitive: f64,
}

impl Default for Costs {
    /// Measured for a binary BVH: times of the tests, fitted to rays per second.
    fn default() -> Self {
        Self { aabb: 1.0, obb: 1.5, primitive: 2.0 }
    }
}

/// The volumes of all nodes of a tree. Each contains every point below it, exactly.
#[derive(Clone, Debug)]
pub struct Volumes {
    /// Axis-aligned box of each inner node.
    pub aabbs: Vec<Aabb>,
    /// Oriented box of each inner node; empty under [`Strategy::Aabb`].
    pub(crate) obbs: Vec<Obb>,
    /// Whether the oriented box is the volume of the node.
    pub(crate) oriented: Vec<bool>,
    /// Whether to test the children of a node as oriented boxes; empty under [`Strategy::Aabb`].
    pub(crate) children_oriented: Vec<bool>,
    /// Whether the oriented box of a leaf has less area than its axis-aligned one; empty under [`Strategy::Aabb`].
    pub(crate) leaf_oriented: Vec<bool>,
}

impl Volumes {
    /// The volume of an inner node.
    #[inline]
    #[must_use]
    pub fn of(&self, id: NodeId) -> Volume<'_> {
        match self.oriented.get(id.index()) {
            Some(true) => Volume::Obb(&self.obbs[id.index()]),
            _ => Volume::Aabb(&self.aabbs[id.index()]),
        }
    }

    /// Whether to test the children of a node as oriented boxes, by predicted traversal cost ([`crate::Costs`]).
    #[inline]
    #[must_use]
    pub fn children_oriented(&self, id: NodeId) -> bool {
        self.children_oriented.get(id.index()).copied().unwrap_or(false)
    }

    /// Whether the volume of a child is an oriented box.
    #[inline]
    #[must_use]
    pub fn is_oriented(&self, child: Child) -> bool {
        match child.kind() {
            ChildKind::Inner(id) => self.oriented.get(id.index()).copied().unwrap_or(false),
            ChildKind::Leaf(position) => self.leaf_oriented.get(position as usize).copied().unwrap_or(false),
        }
    }
}

const CHUNK: usize = 1 << 8;

/// Computes the volume of every node; `leaves` are in leaf order.
///
/// Reads: the tree, its leaves. Writes: an axis-aligned box per node and, depending on the strategy, an oriented one.
/// Holds: each volume contains every point below it, exactly; the same bits for any number of threads.
/// Source: Sabino 2020, 3.5, with moments merged (Gottschalk et al. 1996) instead of a scan per node.
#[must_use]
pub fn volumes<L: Leaf>(tree: &Tree, leaves: &[L], config: &VolumeConfig) -> Volumes {
    let leaf = |position: u32| &leaves[position as usize];
    let aabbs = bottom_up(tree, Aabb::EMPTY, |i| leaf(i).aabb(), |_, _, a, b| a.union(*b));
    let mut volumes =
        Volumes { aabbs, obbs: vec![], oriented: vec![], children_oriented: vec![], leaf_oriented: vec![] };
    let kept = |obb: Obb, aabb: &Aabb| if config.fallback { obb.or_aabb(aabb) } else { obb };
    volumes.obbs = match config.strategy {
        Strategy::Aabb => return volumes,
        Strategy::PcaUnbounded => {
            let of_leaf = |i: u32| leaf(i).moments();
            let axes = |_, moments: &Moments| moments.axes(eigen::COARSE);
            let unset = (Moments::EMPTY, Obb::IDENTITY_FRAME);
            let frames = bottom_up_into(tree, unset, of_leaf, |a, b| a.merged(b), axes);
            from_points(tree, leaves, |id| frames[id.index()])
        }
        Strategy::Dop => {
            let of_leaf = |i: u32| {
                let mut dop = Dop::EMPTY;
                leaf(i).grow_dop(&mut dop);
                dop
            };
            let aabbs = &volumes.aabbs;
            let best = |id: NodeId, dop: &Dop| dop.best_box().unwrap_or_else(|| Obb::from_aabb(&aabbs[id.index()]));
            bottom_up_into(tree, (Dop::EMPTY, UNSET), of_leaf, Dop::union, best)
        }
        Strategy::PcaBounded => {
            merged(tree, leaves, &volumes.aabbs, kept, |a, b| merge::bounded(a, b, merge::Weight::Area))
        }
        Strategy::Quaternion => {
            let as_box = |child: &merge::Child| match child {
                merge::Child::Box(obb) => *obb,
                merge::Child::Triangle(corners) => canted_obb::bound(corners.frame(), *corners),
            };
            merged(tree, leaves, &volumes.aabbs, kept, |a, b| {
                let (a, b) = (as_box(a), as_box(b));
                merge::quaternion(&a, &b, [a.area(), b.area()])
            })
        }
        Strategy::Combined => merged(tree, leaves, &volumes.aabbs, kept, merge::combined),
    };
    volumes.choose(tree, leaves, config.fallback);
    volumes
}

/// As [`volumes`], with oriented boxes along given frames, one for each node, around all points below; takes time proportional to the sum of all
/// subtree sizes. For a tree whose boxes were found elsewhere.
#[must_use]
pub fn volumes_along<L: Leaf>(tree: &Tree, leaves: &[L], frames: &[canted_obb::Frame]) -> Volumes {
    let aabb = VolumeConfig { strategy: Strategy::Aabb, fallback: true };
    let mut volumes = volumes(tree, leaves, &aabb);
    volumes.obbs = from_points(tree, leaves, |id| frames[id.index()]);
    volumes.choose(tree, leaves, true);
    volumes
}

/// Boxes along `frame_of` each node of every point below it; takes time proportional to the sum of all subtree sizes.
fn from_points<L: Leaf>(tree: &Tree, leaves: &[L], frame_of: impl Fn(NodeId) -> canted_obb::Frame + Sync) -> Vec<Obb> {
    let mut obbs = vec![UNSET; tree.nodes.len()];
    par::for_chunks(&mut obbs, CHUNK, |first, out| {
        for (i, (obb, node)) in out.iter_mut().zip(&tree.nodes[first..]).enumerate() {
            let frame = frame_of(NodeId((first + i) as u32));
            let below = &leaves[node.first as usize..=node.last as usize];
            let origin = below[0].points().next().unwrap_or_default();
            let mut enclosure = Enclosure::new(frame, origin);
            for leaf in below {
                leaf.grow(&mut enclosure);
            }
            *obb = enclosure.finish();
        }
    });
    obbs
}

/// Boxes by `rule` of two children, from the leaves up.
fn merged<L: Leaf>(
    tree: &Tree,
    leaves: &[L],
    aabbs: &[Aabb],
    kept: impl Fn(Obb, &Aabb) -> Obb + Sync,
    rule: impl Fn(&merge::Child, &merge::Child) -> Obb + Sync,
) -> Vec<Obb> {
    let as_child = |child: Child, below: &Obb| match child.kind() {
        ChildKind::Leaf(position) => leaves[position as usize].child(),
        ChildKind::Inner(_) => merge::Child::Box(*below),
    };
    let join = |id: NodeId, node: &Node, a: &Obb, b: &Obb| {
        kept(rule(&as_child(node.left, a), &as_child(node.right, b)), &aabbs[id.index()])
    };
    bottom_up(tree, UNSET, |_| UNSET, join)
}

/// Initial value.
const UNSET: Obb = Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] };

impl Volumes {
    /// Decides for each node whether the oriented box is its volume: with `fallback` only if its area is less.
    fn choose<L: Leaf>(&mut self, tree: &Tree, leaves: &[L], fallback: bool) {
        self.oriented = vec![false; self.obbs.len()];
        par::for_chunks(&mut self.oriented, CHUNK, |first, out| {
            for (oriented, (obb, aabb)) in out.iter_mut().zip(self.obbs[first..].iter().zip(&self.aabbs[first..])) {
                *oriented = !fallback || obb.area() < aabb.area();
            }
        });
        self.leaf_oriented = vec![false; leaves.len()];
        par::for_chunks(&mut self.leaf_oriented, CHUNK, |first, out| {
            for (oriented, leaf) in out.iter_mut().zip(&leaves[first..]) {
                *oriented = leaf.oriented_area() < leaf.aabb().area();
            }
        });
        let costs = Costs::default();
        let mut children_oriented = vec![false; tree.nodes.len()];
        par::for_chunks(&mut children_oriented, CHUNK, |first, out| {
            for (i, (oriented, node)) in out.iter_mut().zip(&tree.nodes[first..]).enumerate() {
                let id = NodeId((first + i) as u32);
                let children = [node.left, node.right];
                *oriented = if fallback {
                    self.oriented_gain(&costs, leaves, id, children) > 0.0
                } else {
                    children.iter().any(|&child| self.is_oriented(child))
                };
            }
        });
        self.children_oriented = children_oriented;
    }

    /// Predicted saving of testing the children of a node as oriented boxes, in cost times area.
    ///
    /// A line through the node hits the box of a child with the ratio of areas. Each child that is missed saves the tests of
    /// its own children, or its primitive; in return the test of this node costs more.
    fn oriented_gain<L: Leaf>(&self, costs: &Costs, leaves: &[L], id: NodeId, children: [Child; 2]) -> f64 {
        let saved = |child: Child| match child.kind() {
            _ if !self.is_oriented(child) => 0.0,
            ChildKind::Leaf(position) => {
                let leaf = &leaves[position as usize];
                (leaf.aabb().area() - leaf.oriented_area()) * costs.primitive
            }
            ChildKind::Inner(child) => {
                (self.aabbs[child.index()].area() - self.obbs[child.index()].area()) * 2.0 * costs.aabb
            }
        };
        let extra = self.of(id).area() * 2.0 * (costs.obb - costs.aabb);
        saved(children[0]) + saved(children[1]) - extra
    }
}
