use canted_sah::{PlocConfig, ReinsertConfig};

use crate::Costs;

/// How much is spent on a build for how fast a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Preset {
    /// For geometry that changes: the radix tree as it is.
    Fast,
    /// Nearly the fastest tree.
    #[default]
    Balanced,
    /// The fastest tree known: two binary trees, the better one collapsed.
    Quality,
}

/// How a tree is built. [`Config::preset`] makes the usual ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// What visits cost; the collapse and every choice weigh by it.
    pub costs: Costs,
    /// The binary tree that is collapsed.
    pub binary: BinaryTree,
    /// Whether nodes may lean.
    pub lean: bool,
    /// Whether the whole mesh may be turned into a frame of its own before the binary tree is built.
    pub turn: bool,
    /// Times that each small subtree's frame is turned about its axes in search of less area.
    pub rounds: u32,
}

/// How the binary tree is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BinaryTree {
    /// The radix tree over Morton codes.
    Radix,
    /// Neighbours along the curve joined by area, then subtrees reinserted.
    Ploc(PlocConfig, Option<ReinsertConfig>),
    /// That, and one split top-down in bins: the one of less predicted cost.
    Better(PlocConfig, ReinsertConfig),
}

impl Config {
    /// The usual settings.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let (costs, ploc) = (Costs::default(), PlocConfig::default());
        match preset {
            Preset::Fast => Self { costs, binary: BinaryTree::Radix, lean: true, turn: false, rounds: 0 },
            Preset::Balanced => Self {
                costs,
                binary: BinaryTree::Ploc(ploc, Some(ReinsertConfig::FAST)),
                lean: true,
                turn: true,
                rounds: 0,
            },
            Preset::Quality => Self {
                costs,
                binary: BinaryTree::Better(ploc, ReinsertConfig::BALANCED),
                lean: true,
                turn: true,
                rounds: 5,
            },
        }
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::preset(Preset::default())
    }
}
