use canted_sah::{Builder, TopDownConfig};

use crate::Costs;

/// How much is spent on a build for how fast a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Preset {
    /// For geometry that changes: the radix tree as it is.
    Fast,
    /// Nearly the fastest tree.
    #[default]
    Balanced,
    /// The fastest tree of ours: two binary trees, the better one collapsed, its frames refined.
    Quality,
}

/// How a tree is built. [`Config::preset`] makes the usual ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// What visits cost; the collapse and every choice weigh by it.
    pub costs: Costs,
    /// Builder of the binary tree that is collapsed.
    pub builder: Builder,
    /// A second builder; its tree is taken where its predicted cost is lower.
    pub alternative_builder: Option<Builder>,
    /// Whether nodes may lean.
    pub oriented: bool,
    /// Whether the whole mesh may be turned into a frame of its own before the binary tree is built.
    pub rotate_mesh: bool,
    /// Times that each small subtree's frame is turned about its axes in search of less area.
    pub refine_iterations: u32,
}

impl Config {
    /// The usual settings.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let costs = Costs::default();
        match preset {
            Preset::Fast => Self {
                costs,
                builder: Builder::Lbvh,
                alternative_builder: None,
                oriented: true,
                rotate_mesh: false,
                refine_iterations: 0,
            },
            Preset::Balanced => Self {
                costs,
                builder: Builder::BALANCED,
                alternative_builder: None,
                oriented: true,
                rotate_mesh: true,
                refine_iterations: 0,
            },
            Preset::Quality => Self {
                costs,
                builder: Builder::QUALITY,
                alternative_builder: Some(Builder::TopDown(TopDownConfig::BINNED, None)),
                oriented: true,
                rotate_mesh: true,
                refine_iterations: 5,
            },
        }
    }

    /// The settings as builds take them: see [`Costs`].
    pub(crate) fn usable(&self) -> Self {
        Self { costs: self.costs.usable(self.oriented), ..*self }
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::preset(Preset::default())
    }
}
