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
    pub rival: Option<Builder>,
    /// Whether nodes may lean.
    pub lean: bool,
    /// Whether a leaning node may have one frame for all its children where that is cheaper.
    pub share: bool,
    /// Whether the whole mesh may be turned into a frame of its own before the binary tree is built.
    pub turn: bool,
    /// Times that each small subtree's frame is turned about its axes in search of less area.
    pub rounds: u32,
}

impl Config {
    /// The usual settings.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let costs = Costs::default();
        match preset {
            Preset::Fast => {
                Self { costs, builder: Builder::Lbvh, rival: None, lean: true, share: false, turn: false, rounds: 0 }
            }
            Preset::Balanced => {
                Self { costs, builder: Builder::BALANCED, rival: None, lean: true, share: false, turn: true, rounds: 0 }
            }
            Preset::Quality => Self {
                costs,
                builder: Builder::QUALITY,
                rival: Some(Builder::TopDown(TopDownConfig::BINNED, None)),
                lean: true,
                share: false,
                turn: true,
                rounds: 5,
            },
        }
    }

    /// The settings as builds take them: see [`Costs`].
    pub(crate) fn usable(&self) -> Self {
        Self { costs: self.costs.usable(self.lean), ..*self }
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::preset(Preset::default())
    }
}
