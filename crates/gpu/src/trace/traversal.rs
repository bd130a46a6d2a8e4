//! What kernels need to know of the nodes of trees: how rays find their way back up, and which kinds there are.

use bytemuck::{Pod, Zeroable};

use super::layout::{BvhHeader, Quad};

/// How a ray finds its way back to nodes whose children wait. Each finds the same hits.
///
/// `benches/TRIED.md` has what the others cost beside the stack, on a software driver; on hardware that is not measured yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Traversal {
    /// A stack in the invocation's own memory: what is used.
    #[default]
    Stack,
    /// Eight bits a level in registers, and links up; sixteen levels at most.
    Bits,
    /// Links up, and the key of the child that the ray comes from.
    Links,
}

impl Traversal {
    /// Every walk.
    pub const ALL: [Self; 3] = [Self::Stack, Self::Bits, Self::Links];

    /// As tables call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stack => "stack",
            Self::Bits => "bits and links",
            Self::Links => "links",
        }
    }

    pub(super) fn file(self) -> &'static str {
        match self {
            Self::Stack => "shared/traverse/stack",
            Self::Bits => "alternatives/traverse/bits",
            Self::Links => "alternatives/traverse/links",
        }
    }
}

/// A node's parent, and which of its children it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ParentLink {
    word: u32,
    child: u32,
}

impl ParentLink {
    /// The parent of a root.
    pub(super) const NOWHERE: Self = Self { word: EMPTY, child: 0 };
}

/// As in `shared/node.wgsl`: a bit of leaves, the word that names nothing, where a node's kind stands, and the quads of a line.
const LEAF: u32 = 0x8000_0000;
const EMPTY: u32 = 0x7fff_ffff;
const KIND_SHIFT: u32 = 29;
const LINE_QUADS: usize = 4;

/// Links of all trees, one for each line of nodes.
pub(super) fn links(nodes: &[Quad], trees: &[BvhHeader]) -> Vec<ParentLink> {
    let mut links = vec![ParentLink::NOWHERE; nodes.len().div_ceil(LINE_QUADS)];
    for &BvhHeader { words: [root, first_quad, ..], .. } in trees {
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

/// Whether all nodes of a tree stand along the axes, with no frame of their own.
pub(super) fn is_aligned(nodes: &[Quad], root: u32) -> bool {
    let mut is_aligned = true;
    each_node(nodes, root, |word| is_aligned &= word >> KIND_SHIFT == 0);
    is_aligned
}

/// Visits the words of all nodes below and with `root`.
fn each_node(nodes: &[Quad], root: u32, mut visit: impl FnMut(u32)) {
    let mut waiting = vec![root];
    while let Some(word) = waiting.pop() {
        if is_node(word) {
            visit(word);
            waiting.extend((0..8).map(|child| child_word(nodes, word, child)));
        }
    }
}

fn is_node(word: u32) -> bool {
    word & LEAF == 0 && word != EMPTY
}

/// The word of a child, as kernels find it.
fn child_word(nodes: &[Quad], word: u32, child: u32) -> u32 {
    let row = match word >> KIND_SHIFT {
        0 => 12,
        _ => 30,
    };
    nodes[line(word) * LINE_QUADS + row + child as usize / 4][child as usize % 4]
}

fn line(word: u32) -> usize {
    (word & ((1 << KIND_SHIFT) - 1)) as usize
}
