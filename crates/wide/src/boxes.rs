//! The boxes of all nodes and leaves, to look at.

use canted_obb::Obb;

use crate::bvh::WideBvh;
use crate::layout::{ALIGNED_LINES, NodeKind, ORIENTED_LINES, Row, Word, WordKind, node_words, rows};
use crate::leaf::LeafPrimitive;

impl<P: LeafPrimitive> WideBvh<P> {
    /// Calls `visit` with the box of each node and leaf, object space: the box, its level, 0 for the root, and whether it is a leaf.
    /// Parents come before their children.
    ///
    /// Boxes are those that rays are tested with, up to rounding: with the part of the padding that depends on their content.
    pub fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        if self.n_primitives == 0 {
            return;
        }
        let mut open = vec![(self.nodes.root, self.bounds(), 0)];
        while let Some((word, obb, level)) = open.pop() {
            match word.kind() {
                WordKind::Empty => {}
                WordKind::Leaf { .. } => visit(obb, level, true),
                WordKind::Node(kind, line) => {
                    visit(obb, level, false);
                    let words = node_words(&self.nodes.lines, kind, line).iter().enumerate().rev();
                    let children = words.filter(|(_, word)| **word != Word::EMPTY);
                    open.extend(children.filter_map(|(i, &w)| Some((w, self.child_box(kind, line, i)?, level + 1))));
                }
            }
        }
    }

    /// The box in a slot of a node.
    fn child_box(&self, kind: NodeKind, line: u32, i: usize) -> Option<Obb> {
        let lane = |row: &Row| row[i];
        let relative = match kind {
            NodeKind::Aligned => {
                let node: &[Row; 8] = rows::<ALIGNED_LINES, 8>(&self.nodes.lines, line);
                let [lower, upper] = [0, 1].map(|side| std::array::from_fn(|k| lane(&node[2 * k + side])));
                Obb::from_slabs(self.frame.rows, lower, upper)
            }
            NodeKind::Oriented => {
                let node: &[Row; 16] = rows::<ORIENTED_LINES, 16>(&self.nodes.lines, line);
                let axes = std::array::from_fn(|a| std::array::from_fn(|k| lane(&node[5 * a + k])));
                let planes =
                    |sign: f32| std::array::from_fn(|a| lane(&node[5 * a + 3]) + sign * lane(&node[5 * a + 4]));
                Obb::from_slabs(axes, planes(-1.0), planes(1.0))
            }
        };
        Some(self.frame.reference.given_box(relative?))
    }
}
