use canted_obb::{Aabb, Obb};

use crate::{Child, ChildKind, NodeId};

/// A node's volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Volume<'a> {
    /// Axis-aligned.
    Aabb(&'a Aabb),
    /// Leaning.
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

/// How leaning volumes are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Strategy {
    /// Axis-aligned boxes only.
    #[default]
    Aabb,
    /// Principal axes of everything below, extents of every point below.
    PcaUnbounded,
    /// Principal axes of the children's corners, or of points where children are leaves.
    PcaBounded,
    /// The rotation halfway between the children's.
    Quaternion,
    /// By the children: unbounded over two leaves, bounded over one, quaternion over none.
    Combined,
    /// The best frame for extents along fixed directions, carried up exactly.
    Dop,
}

impl Strategy {
    /// All strategies, the axis-aligned one first.
    pub const ALL: [Self; 6] =
        [Self::Aabb, Self::PcaUnbounded, Self::PcaBounded, Self::Quaternion, Self::Combined, Self::Dop];
}

/// How volumes are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VolumeConfig {
    /// Where frames come from.
    pub strategy: Strategy,
    /// Whether the axis-aligned box takes the place of a leaning one whose area is not less. Its loose boxes would
    /// otherwise make those above looser still.
    pub fallback: bool,
}

impl Default for VolumeConfig {
    fn default() -> Self {
        Self { strategy: Strategy::Aabb, fallback: true }
    }
}

/// The volumes of a tree's nodes. Each contains every point below it, exactly.
#[derive(Clone, Debug)]
pub struct Volumes {
    /// Axis-aligned box of each inner node.
    pub aabbs: Vec<Aabb>,
    /// Leaning box of each inner node; empty under [`Strategy::Aabb`].
    pub(crate) obbs: Vec<Obb>,
    /// Whether the leaning box is the node's volume.
    pub(crate) oriented: Vec<bool>,
    /// Whether a node's children are worth testing as leaning boxes; empty under [`Strategy::Aabb`].
    pub(crate) children_oriented: Vec<bool>,
    /// Whether a leaf's leaning box has less area than its axis-aligned one; empty under [`Strategy::Aabb`].
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

    /// Whether a node's children are to be tested as leaning boxes: by predicted cost, see [`crate::Costs`].
    #[inline]
    #[must_use]
    pub fn children_oriented(&self, id: NodeId) -> bool {
        self.children_oriented.get(id.index()).copied().unwrap_or(false)
    }

    /// Whether a child's volume is a leaning box.
    #[inline]
    #[must_use]
    pub fn is_oriented(&self, child: Child) -> bool {
        match child.kind() {
            ChildKind::Inner(id) => self.oriented.get(id.index()).copied().unwrap_or(false),
            ChildKind::Leaf(position) => self.leaf_oriented.get(position as usize).copied().unwrap_or(false),
        }
    }
}
