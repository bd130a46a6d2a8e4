use canted_sah::{Builder, TopDownConfig};

use crate::costs::Costs;

/// How much build time is spent on how fast a BVH.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Preset {
    /// For geometry that changes: collapses the radix tree.
    Fast,
    /// Nearly the fastest traversal.
    #[default]
    Balanced,
    /// The fastest traversal: builds two binary trees, collapses the better one and refines its frames.
    Quality,
}

/// How a BVH is built. [`Config::preset`] makes the usual configurations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Traversal costs, which the collapse minimizes.
    pub costs: Costs,
    /// Builder of the binary tree that is collapsed.
    pub builder: Builder,
    /// A second builder; its tree is taken where its predicted cost is lower.
    pub alternative_builder: Option<Builder>,
    /// Whether nodes may be oriented.
    pub oriented: bool,
    /// Whether aligned nodes may be aligned with a frame of the mesh instead of the coordinate axes.
    pub rotate_mesh: bool,
    /// Iterations that rotate the frame of each small subtree about its axes in search of less area.
    pub refine_iterations: u32,
}

impl Config {
    /// The usual settings.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let fast = Self {
            costs: Costs::default(),
            builder: Builder::Lbvh,
            alternative_builder: None,
            oriented: true,
            rotate_mesh: false,
            refine_iterations: 0,
        };
        match preset {
            Preset::Fast => fast,
            Preset::Balanced => Self { builder: Builder::BALANCED, rotate_mesh: true, ..fast },
            Preset::Quality => Self {
                builder: Builder::QUALITY,
                alternative_builder: Some(Builder::TopDown(TopDownConfig::BINNED, None)),
                rotate_mesh: true,
                refine_iterations: 5,
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

impl Default for Config {
    fn default() -> Self {
        Self::preset(Preset::default())
    }
}
