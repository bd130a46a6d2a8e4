//! BVH construction on the device, with the same stages as on the CPU.
//!
//! ```text
//! vertices of all meshes -> Primitives -> domain -> codes -> sort -> tree -> volumes       bottom levels
//! root boxes, instances  -> Primitives -> the same stages                                  top level
//! both                                                   -> wide nodes, triangles in the order of leaves
//! ```
//!
//! All trees of a level share the same dispatches. Their primitives are stored one tree after another, and the index of the tree is
//! the most significant word of the sort key.

mod built;
mod encoder;
mod instances;
mod ploc;
mod primitives;
mod sort;
mod stages;
mod timing;
mod volumes;
mod wide;

pub use built::Built;
pub(crate) use built::refit_aabbs;
pub use encoder::{BuildEncoder, StageTime};
pub use instances::{DeviceInstance, InstanceBuffer, NOT_PLACED};
pub(crate) use instances::{MeshBoxes, N_INSTANCE_FAULTS, Scales, instance_fault};
pub(crate) use primitives::{Faults, count, fault};
pub use primitives::{IndexBuffer, MeshBuffers, Primitives, Range};
pub use sort::Sorter;
pub(crate) use stages::depth_bound;
pub use stages::{Codes, Grid, Node, Sorted, Trees, codes, domain, sort, tree};
pub use timing::Passes;
pub use volumes::{aabbs, obbs};
pub(crate) use wide::{Change, Collapse, Which};
pub use wide::{MAX_LEAF, WideBvhs, WideLevel};

use canted_lbvh::{Bits, Strategy};

/// Volume strategies that the device supports: all of the CPU's, the axis-aligned one first.
pub const STRATEGIES: [Strategy; 6] = Strategy::ALL;

/// Build settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct BuildConfig {
    /// Length of the Morton codes.
    pub bits: Bits,
    /// How the boxes of inner nodes are computed. Default: [`Strategy::Aabb`]. Use [`Strategy::Combined`] for thin, diagonal geometry.
    pub strategy: Strategy,
}

/// How the topology of a tree is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Topology {
    /// The radix tree over the Morton codes: the quickest build, which recorded rebuilds use.
    #[default]
    Radix,
    /// Locally-ordered clustering, as by `ploc` of `canted_sah`: less traversal cost.
    Ploc,
}

/// How wide BVHs are built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct WideConfig {
    /// Length of the Morton codes.
    pub bits: Bits,
    /// The topology of the binary trees over triangles.
    pub topology: Topology,
    /// The boxes of oriented nodes, which are chosen where they lower the predicted cost. Default: [`Strategy::Aabb`], no oriented nodes. Use
    /// [`Strategy::Combined`] for thin, diagonal geometry.
    pub strategy: Strategy,
}

impl From<BuildConfig> for WideConfig {
    /// Over a radix tree.
    fn from(BuildConfig { bits, strategy }: BuildConfig) -> Self {
        Self { bits, topology: Topology::Radix, strategy }
    }
}
