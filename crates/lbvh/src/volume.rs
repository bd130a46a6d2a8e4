use canted_obb::{Aabb, Obb};

use crate::{Child, ChildKind, NodeId};

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
