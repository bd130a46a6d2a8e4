//! The choice of a traversal. Only the stack is used by default; the others are measured alternatives.

use bytemuck::{Pod, Zeroable};

use super::layout::{BvhHeader, Quad};
use super::nodes::{EMPTY, LINE_QUADS, child_word, each_node, is_node, line};

/// How a ray returns to nodes with pending children. All variants find the same hits.
///
/// Only [`Traversal::Stack`] is used for rendering. The others are measured alternatives (`alternatives/traverse.wgsl` for wide BVHs,
/// `alternatives/binary/traverse.wgsl` for binary ones); `benches/TRIED.md` has their timings on a software driver. They have not been
/// measured on hardware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Traversal {
    /// A stack in private memory.
    #[default]
    Stack,
    /// Bits in registers for each level, and links to parents: eight per level and at most sixteen levels in wide BVHs, one per level in
    /// binary ones.
    Bits,
    /// Links to parents, and the child that the ray returns from.
    Links,
}

impl Traversal {
    /// All variants.
    pub const ALL: [Self; 3] = [Self::Stack, Self::Bits, Self::Links];

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stack => "stack",
            Self::Bits => "bits and links",
            Self::Links => "links",
        }
    }

    pub(crate) fn file(self) -> &'static str {
        match self {
            Self::Stack => "shared/traverse/stack",
            Self::Bits => "alternatives/traverse/bits",
            Self::Links => "alternatives/traverse/links",
        }
    }

    /// The same for binary BVHs.
    pub(crate) fn binary_file(self) -> &'static str {
        match self {
            Self::Stack => "shared/binary/traverse/stack",
            Self::Bits => "alternatives/binary/traverse/bits",
            Self::Links => "alternatives/binary/traverse/links",
        }
    }
}

/// Parent of a node, and its index among the children.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ParentLink {
    word: u32,
    child: u32,
}

impl ParentLink {
    /// The link of a root.
    pub(super) const OF_ROOT: Self = Self { word: EMPTY, child: 0 };
}

/// Links of all BVHs, one for each line of nodes.
pub(super) fn links(nodes: &[Quad], bvhs: &[BvhHeader]) -> Vec<ParentLink> {
    let mut links = vec![ParentLink::OF_ROOT; nodes.len().div_ceil(LINE_QUADS)];
    for &BvhHeader { words: [root, first_quad, ..], .. } in bvhs {
        let nodes = &nodes[first_quad as usize..];
        each_node(nodes, root, |word| {
            for child in 0..8 {
                let below = child_word(nodes, word, child);
                if is_node(below) {
                    links[first_quad as usize / LINE_QUADS + line(below)] = ParentLink { word, child };
                }
            }
        });
    }
    links
}
