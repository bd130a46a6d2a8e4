use canted_sah::{Builder, GroupConfig, TopDownConfig};
use canted_trace::TriangleTest;

use crate::costs::Costs;

/// How much build time is spent on how fast a BVH.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Preset {
    /// For geometry that is built again for each frame: a binary tree by Morton codes, aligned nodes only.
    Dynamic,
    /// For geometry that changes: a binary tree over groups of up to eight primitives.
    Fast,
    /// Nearly the fastest traversal: smaller groups, moved where that helps, and a mesh frame.
    #[default]
    Balanced,
    /// The fastest traversal: groups are moved further; where oriented nodes may pay, the better of two binary trees.
    Quality,
}

/// How a BVH is built. [`Config::preset`] makes the usual configurations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Traversal costs, which the collapse minimizes.
    pub costs: Costs,
    /// Builds a binary tree over groups of primitives first, and `builder` is used only where a sample of its subtrees shows
    /// that oriented nodes may pay; `None` for `builder` always.
    pub groups: Option<GroupConfig>,
    /// Builder of a binary tree with a primitive per leaf.
    pub builder: Builder,
    /// A second such builder; its tree is taken where its predicted cost is lower.
    pub alternative_builder: Option<Builder>,
    /// Whether nodes may be oriented.
    pub oriented: bool,
    /// Whether aligned nodes may be aligned with a frame of the mesh instead of the coordinate axes.
    pub rotate_mesh: bool,
    /// The triangle test of rays; BVHs over other primitives have none.
    pub test: TriangleTest,
}

impl Config {
    /// The usual settings.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let fast = Self {
            costs: Costs::default(),
            groups: Some(GroupConfig::FAST),
            builder: Builder::TopDown(TopDownConfig::BINNED, None),
            alternative_builder: None,
            oriented: true,
            rotate_mesh: false,
            test: TriangleTest::Watertight,
        };
        match preset {
            Preset::Dynamic => Self { groups: Some(GroupConfig::DYNAMIC), oriented: false, ..fast },
            Preset::Fast => fast,
            Preset::Balanced => {
                Self { groups: Some(GroupConfig::BALANCED), builder: Builder::BALANCED, rotate_mesh: true, ..fast }
            }
            Preset::Quality => Self {
                groups: Some(GroupConfig::QUALITY),
                builder: Builder::QUALITY,
                alternative_builder: Some(Builder::TopDown(TopDownConfig::BINNED, None)),
                rotate_mesh: true,
                ..fast
            },
        }
    }

    /// The same settings with aligned nodes only, along the coordinate axes.
    #[must_use]
    pub fn axis_aligned(self) -> Self {
        Self { oriented: false, rotate_mesh: false, ..self }
    }

    /// The settings as builds use them: see [`Costs`].
    pub(crate) fn usable(&self) -> Self {
        Self { costs: self.costs.usable(self.oriented), ..*self }
    }
}

impl From<Preset> for Config {
    fn from(preset: Preset) -> Self {
        Self::preset(preset)
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::preset(Preset::default())
    }
}
