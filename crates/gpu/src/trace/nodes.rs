//! The words of nodes, as kernels read them.

use super::layout::Quad;

/// As in `shared/node.wgsl`: the leaf bit, the empty word, the position of the node kind, and the quads of a line.
pub(super) const LEAF: u32 = 0x8000_0000;
pub(super) const EMPTY: u32 = 0x7fff_ffff;
const KIND_SHIFT: u32 = 29;
pub(super) const LINE_QUADS: usize = 4;

/// Whether all nodes below `root` are aligned.
pub(super) fn is_aligned(nodes: &[Quad], root: u32) -> bool {
    let mut is_aligned = true;
    each_node(nodes, root, |word| is_aligned &= word >> KIND_SHIFT == 0);
    is_aligned
}

/// Visits the words of all nodes below `root`, including it.
pub(super) fn each_node(nodes: &[Quad], root: u32, mut visit: impl FnMut(u32)) {
    let mut waiting = vec![root];
    while let Some(word) = waiting.pop() {
        if is_node(word) {
            visit(word);
            waiting.extend((0..8).map(|child| child_word(nodes, word, child)));
        }
    }
}

pub(super) fn is_node(word: u32) -> bool {
    word & LEAF == 0 && word != EMPTY
}

/// The word of a child, as kernels find it.
pub(super) fn child_word(nodes: &[Quad], word: u32, child: u32) -> u32 {
    let row = match word >> KIND_SHIFT {
        0 => 12,
        _ => 30,
    };
    nodes[line(word) * LINE_QUADS + row + child as usize / 4][child as usize % 4]
}

pub(super) fn line(word: u32) -> usize {
    (word & ((1 << KIND_SHIFT) - 1)) as usize
}
