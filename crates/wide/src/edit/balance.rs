//! A subtree with short paths, where a path has become too long.

use super::tree::Tree;
use crate::leaf::Primitive;
use crate::node::{ALIGNED_LINES, ChildWord, Content, DecodedWord, NO_NODE, NodeKind};

/// A leaf and what its box depends on.
type Leaf = (ChildWord, Content);

impl<P: Primitive> Tree<'_, P> {
    /// Balances subtrees above a node, which `depth` nodes lead to, until the path is short enough; returns its greatest length then.
    ///
    /// Where a path is longer than log₂ of the number of leaves, some node has more than half of those of the node above. A balanced one has an
    /// eighth, so that it takes as many changes as a constant part of its leaves until it is balanced again.
    pub(super) fn balance(&mut self, mut node: u32, mut depth: u32) -> u32 {
        // Nodes that lead to `node` itself.
        let mut level = depth;
        let mut n_leaves = self.n_leaves(node);
        while depth > self.links.most_depth() {
            let parent = self.links.nodes[node as usize].parent;
            if parent == NO_NODE {
                return depth;
            }
            level -= 1;
            let n_of_parent = self.n_leaves(parent);
            if 2 * n_leaves > n_of_parent {
                depth = level + self.rebuild(parent) - 1;
            }
            (node, n_leaves) = (parent, n_of_parent);
        }
        depth
    }

    fn n_leaves(&self, node: u32) -> usize {
        let (mut n, mut open) = (0, vec![node]);
        while let Some(node) = open.pop() {
            for word in self.words(node) {
                match word.kind() {
                    DecodedWord::Empty => {}
                    DecodedWord::Leaf { .. } => n += 1,
                    DecodedWord::Node(_, line) => open.push(line / ALIGNED_LINES as u32),
                }
            }
        }
        n
    }

    /// Distributes the leaves below a node anew; returns its height. Its content stays.
    fn rebuild(&mut self, node: u32) -> u32 {
        let (mut leaves, mut open) = (vec![], vec![node]);
        while let Some(below) = open.pop() {
            self.align(below);
            for (slot, word) in self.words(below).into_iter().enumerate() {
                match word.kind() {
                    DecodedWord::Empty => continue,
                    DecodedWord::Leaf { .. } => leaves.push((word, self.content(word))),
                    DecodedWord::Node(_, line) => open.push(line / ALIGNED_LINES as u32),
                }
                // An oriented child finds its word until it is aligned.
                if matches!(word.kind(), DecodedWord::Leaf { .. }) {
                    self.clear(below, slot);
                }
            }
        }
        self.free_below(node);
        self.fill(node, &mut leaves)
    }

    /// Frees all nodes below a node, which have no leaves.
    fn free_below(&mut self, node: u32) {
        let mut open = vec![node];
        while let Some(above) = open.pop() {
            for (slot, word) in self.words(above).into_iter().enumerate() {
                if let DecodedWord::Node(_, line) = word.kind() {
                    open.push(line / ALIGNED_LINES as u32);
                    self.clear(above, slot);
                }
            }
            if above != node {
                self.free_node(above);
            }
        }
    }

    /// Fills an empty node; returns its height, at most log₈ of the number of leaves, rounded up.
    fn fill(&mut self, node: u32, leaves: &mut [Leaf]) -> u32 {
        let (mut height, mut all) = (1, Content::EMPTY);
        for (slot, group) in groups(leaves).into_iter().enumerate() {
            let (word, content) = match group {
                [leaf] => *leaf,
                group => {
                    let child = self.new_node();
                    height = height.max(1 + self.fill(child, group));
                    let word = ChildWord::node(NodeKind::Aligned, child as usize * ALIGNED_LINES);
                    (word, self.content(word))
                }
            };
            self.set(node, slot, word, &content);
            all = all.union(content);
        }
        self.links.nodes[node as usize].content = all;
        height
    }
}

/// Up to eight groups: halves of halves of halves, each along the axis on which the centers spread most.
fn groups(leaves: &mut [Leaf]) -> Vec<&mut [Leaf]> {
    if leaves.len() <= 8 {
        return leaves.chunks_mut(1).collect();
    }
    let mut groups = vec![leaves];
    for _ in 0..3 {
        groups = groups.into_iter().flat_map(halves).collect();
    }
    groups
}

fn halves(leaves: &mut [Leaf]) -> [&mut [Leaf]; 2] {
    let center = |leaf: &Leaf| leaf.1.aligned.center();
    let spread = |k: usize| {
        let ends = leaves.iter().map(|leaf| center(leaf)[k]);
        ends.clone().fold(f64::MIN, f64::max) - ends.fold(f64::MAX, f64::min)
    };
    let spreads = [0, 1, 2].map(spread);
    let axis = (1..3).fold(0, |best, k| if spreads[k] > spreads[best] { k } else { best });
    let middle = leaves.len() / 2;
    leaves.select_nth_unstable_by(middle, |a, b| center(a)[axis].total_cmp(&center(b)[axis]));
    leaves.split_at_mut(middle).into()
}

#[cfg(test)]
mod tests {
    use canted_obb::Aabb;

    use super::*;

    #[test]
    fn groups_are_of_equal_size_and_apart() {
        let at = |x: f32| Aabb { min: [x, 0.0, 0.0], max: [x + 0.5, 1.0, 1.0] };
        let leaf = |i: u16| {
            let aabb = at(f32::from(i * 37 % 101));
            (ChildWord::leaf(usize::from(i), 1), Content { bounds: aabb, aligned: aabb, reach: 0.0 })
        };
        let mut leaves: Vec<Leaf> = (0..101).map(leaf).collect();
        let groups = groups(&mut leaves);
        assert_eq!(groups.len(), 8);
        assert!(groups.iter().all(|group| (12..=13).contains(&group.len())));
        let around = |group: &&mut [Leaf]| group.iter().fold(Aabb::EMPTY, |all, leaf| all.union(leaf.1.aligned));
        let boxes: Vec<Aabb> = groups.iter().map(around).collect();
        assert!(boxes.windows(2).all(|pair| pair[0].max[0] < pair[1].min[0]));
    }
}
