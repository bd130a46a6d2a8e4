use std::fmt;

use canted_obb::{Aabb, PrimId};
use canted_trace::AABB_PAD;

use crate::BoxBih;
use crate::node::{NodeKind, lower_plane, upper_plane};

/// Statistics of a valid BIH.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BihStats {
    /// Nodes with two children.
    pub n_splits: usize,
    /// Nodes with one child.
    pub n_clips: usize,
    /// Leaves.
    pub n_leaves: usize,
    /// Primitives of the largest leaf.
    pub largest_leaf: usize,
    /// Nodes on the longest path from the root to a leaf, the leaf included.
    pub depth: u32,
}

/// A defect of a BIH.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BihFlaw {
    /// A primitive is in no leaf, or in two.
    NotOnce {
        /// The primitive.
        primitive: PrimId,
    },
    /// Leaves and references do not match: each reference is in one leaf, in order.
    WrongReferences {
        /// Index of the leaf.
        node: usize,
    },
    /// A leaf has no primitive.
    EmptyLeaf {
        /// Index of the leaf.
        node: usize,
    },
    /// A child is missing, or starts at another node than its parent says.
    WrongChild {
        /// Index of the parent; the number of nodes if there is no root.
        node: usize,
    },
    /// Nodes that no path reaches.
    Unreached {
        /// Index of the first one.
        node: usize,
    },
    /// A primitive, or its padding, is outside a plane of a node above it, or outside the root's box.
    Escapes {
        /// Index of the node.
        node: usize,
    },
    /// The stored depth is wrong.
    WrongDepth {
        /// The stored depth.
        stated: u32,
        /// The actual depth.
        actual: u32,
    },
    /// A path is longer than [`BoxBih::MAX_DEPTH`].
    TooDeep {
        /// Index of the first node beyond.
        node: usize,
    },
}

impl fmt::Display for BihFlaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotOnce { primitive } => write!(f, "primitive {primitive} is not in exactly one leaf"),
            Self::WrongReferences { node } => write!(f, "leaf {node} does not continue the references"),
            Self::EmptyLeaf { node } => write!(f, "leaf {node} is empty"),
            Self::WrongChild { node } => write!(f, "a child of node {node} is not where it should be"),
            Self::Unreached { node } => write!(f, "node {node} is not reached from the root"),
            Self::Escapes { node } => write!(f, "a primitive below node {node} is outside its planes"),
            Self::WrongDepth { stated, actual } => write!(f, "the stored depth is {stated}, but the depth is {actual}"),
            Self::TooDeep { node } => write!(f, "node {node} is deeper than {}", BoxBih::MAX_DEPTH),
        }
    }
}

impl std::error::Error for BihFlaw {}

/// What is below a node.
#[derive(Clone, Copy)]
struct Content {
    bounds: Aabb,
    /// The node after its subtree.
    end: usize,
    height: u32,
}

/// Checks a BIH over these boxes, which are in the caller's order.
///
/// Every primitive is in one leaf, no child is empty, every plane is at the padded bounds of what is below it or farther
/// out, all nodes are reached once, and the depth is as stated and within [`BoxBih::MAX_DEPTH`].
///
/// ```
/// use canted_bih::{BoxBih, BihConfig, check};
/// use canted_obb::Aabb;
///
/// let boxes = [0.0, 1.0, 5.0].map(|x| Aabb { min: [x, 0.0, 0.0], max: [x + 0.5, 1.0, 1.0] });
/// let bih = BoxBih::build(&boxes, &BihConfig::default())?;
/// assert_eq!(check(&bih, &boxes)?.n_leaves, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The first flaw found.
pub fn check(bih: &BoxBih, boxes: &[Aabb]) -> Result<BihStats, BihFlaw> {
    let mut n_uses = vec![0u32; boxes.len()];
    for primitive in &bih.primitives {
        *n_uses.get_mut(primitive.index()).ok_or(BihFlaw::NotOnce { primitive: *primitive })? += 1;
    }
    if let Some(primitive) = (0u32..).zip(&n_uses).find(|&(_, &n)| n != 1).map(|(i, _)| PrimId(i)) {
        return Err(BihFlaw::NotOnce { primitive });
    }
    let mut checker = Checker { bih, boxes, stats: BihStats::default(), next_reference: 0 };
    let n_nodes = bih.nodes.len();
    if boxes.is_empty() && n_nodes == 0 {
        return Ok(checker.stats);
    }
    let root = checker.subtree(0, n_nodes, BoxBih::MAX_DEPTH)?;
    if root.end < n_nodes {
        return Err(BihFlaw::Unreached { node: root.end });
    }
    if checker.next_reference < boxes.len() {
        return Err(BihFlaw::WrongReferences { node: n_nodes - 1 });
    }
    let pad = pad(&root.bounds);
    let is_inside = |k: usize| {
        bih.padded_bounds.min[k] <= lower_plane(root.bounds.min[k], pad)
            && bih.padded_bounds.max[k] >= upper_plane(root.bounds.max[k], pad)
    };
    if !(0..3).all(is_inside) || !bih.bounds.contains_box(&root.bounds) {
        return Err(BihFlaw::Escapes { node: 0 });
    }
    if bih.depth != root.height {
        return Err(BihFlaw::WrongDepth { stated: bih.depth, actual: root.height });
    }
    Ok(BihStats { depth: root.height, ..checker.stats })
}

struct Checker<'a> {
    bih: &'a BoxBih,
    boxes: &'a [Aabb],
    stats: BihStats,
    /// Where the references of the next leaf start.
    next_reference: usize,
}

impl Checker<'_> {
    /// Checks the subtree at `node`, a child of `parent`. The recursion is as deep as `levels` at most.
    fn subtree(&mut self, node: usize, parent: usize, levels: u32) -> Result<Content, BihFlaw> {
        let stored = *self.bih.nodes.get(node).ok_or(BihFlaw::WrongChild { node: parent })?;
        if levels == 0 {
            return Err(BihFlaw::TooDeep { node });
        }
        let [upper, lower] = stored.planes;
        match stored.kind() {
            NodeKind::Leaf { first, n } => {
                let n = n as usize;
                if n == 0 {
                    return Err(BihFlaw::EmptyLeaf { node });
                }
                if first as usize != self.next_reference {
                    return Err(BihFlaw::WrongReferences { node });
                }
                let positions = self.next_reference..self.next_reference + n;
                let primitives = self.bih.primitives.get(positions).ok_or(BihFlaw::WrongReferences { node })?;
                self.next_reference += n;
                self.stats.n_leaves += 1;
                self.stats.largest_leaf = self.stats.largest_leaf.max(n);
                let bounds = primitives.iter().fold(Aabb::EMPTY, |all, p| all.union(self.boxes[p.index()]));
                Ok(Content { bounds, end: node + 1, height: 1 })
            }
            NodeKind::Clip { axis } => {
                self.stats.n_clips += 1;
                let child = self.subtree(node + 1, node, levels - 1)?;
                if !(is_below(&child.bounds, axis, upper) && is_above(&child.bounds, axis, lower)) {
                    return Err(BihFlaw::Escapes { node });
                }
                Ok(Content { height: child.height + 1, ..child })
            }
            NodeKind::Split { axis, second } => {
                self.stats.n_splits += 1;
                let first = self.subtree(node + 1, node, levels - 1)?;
                if node + second as usize != first.end {
                    return Err(BihFlaw::WrongChild { node });
                }
                let second = self.subtree(first.end, node, levels - 1)?;
                if !(is_below(&first.bounds, axis, upper) && is_above(&second.bounds, axis, lower)) {
                    return Err(BihFlaw::Escapes { node });
                }
                let bounds = first.bounds.union(second.bounds);
                Ok(Content { bounds, end: second.end, height: 1 + first.height.max(second.height) })
            }
        }
    }
}

/// How far planes around this content are from it at least.
fn pad(content: &Aabb) -> f64 {
    f64::from(AABB_PAD) * f64::from(content.reach())
}

fn is_below(content: &Aabb, axis: usize, upper: f32) -> bool {
    upper >= upper_plane(content.max[axis], pad(content))
}

fn is_above(content: &Aabb, axis: usize, lower: f32) -> bool {
    lower <= lower_plane(content.min[axis], pad(content))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::Node;
    use crate::{BihConfig, LeafSize};
    use canted_fixtures::soup;

    /// Random triangles in two clusters, so that there are clip nodes.
    fn boxes(n: u32) -> Vec<Aabb> {
        let mesh = soup(1, n);
        let mut boxes: Vec<Aabb> =
            mesh.triangles.iter().map(|t| Aabb::from_points(t.map(|v| mesh.positions[v as usize]))).collect();
        for aabb in boxes.iter_mut().skip(n as usize / 2) {
            aabb.min[0] += 20.0;
            aabb.max[0] += 20.0;
        }
        boxes
    }

    fn build(boxes: &[Aabb], leaf_size: u32) -> BoxBih {
        BoxBih::build(boxes, &BihConfig { leaf_size: LeafSize::AtMost(leaf_size), ..BihConfig::default() }).unwrap()
    }

    /// The flaw after a change.
    fn flaw(change: impl FnOnce(&mut BoxBih)) -> BihFlaw {
        let boxes = boxes(40);
        let mut bih = build(&boxes, 2);
        check(&bih, &boxes).unwrap();
        change(&mut bih);
        check(&bih, &boxes).unwrap_err()
    }

    /// The first node of a kind.
    fn find(bih: &BoxBih, is_it: impl Fn(NodeKind) -> bool) -> usize {
        bih.nodes.iter().position(|node| is_it(node.kind())).expect("there is one of each kind")
    }

    fn find_leaf(bih: &BoxBih) -> usize {
        find(bih, |kind| matches!(kind, NodeKind::Leaf { .. }))
    }

    fn find_clip(bih: &BoxBih) -> usize {
        find(bih, |kind| matches!(kind, NodeKind::Clip { .. }))
    }

    #[test]
    fn valid_bihs_have_no_flaw() {
        for n in [0, 1, 2, 3, 40, 1000] {
            for leaf_size in [1, 2, 7] {
                let boxes = boxes(n);
                let bih = build(&boxes, leaf_size);
                let stats = check(&bih, &boxes).unwrap();
                assert!(stats.largest_leaf <= leaf_size as usize, "{stats:?}");
                assert_eq!(stats.n_leaves + stats.n_splits + stats.n_clips, bih.n_nodes());
                assert_eq!(stats.n_leaves.saturating_sub(1), stats.n_splits);
                assert_eq!(stats.depth, bih.depth());
            }
        }
    }

    #[test]
    fn primitives_in_two_leaves_or_none_are_detected() {
        let repeated = flaw(|bih| bih.primitives[3] = bih.primitives[4]);
        assert!(matches!(repeated, BihFlaw::NotOnce { .. }), "{repeated}");
        assert_eq!(flaw(|bih| bih.primitives[3] = PrimId(99)), BihFlaw::NotOnce { primitive: PrimId(99) });
        let missing = flaw(|bih| bih.primitives.truncate(39));
        assert!(matches!(missing, BihFlaw::NotOnce { .. }), "{missing}");
    }

    #[test]
    fn leaves_that_do_not_continue_the_references_are_detected() {
        for replacement in [Node::leaf(1, 2), Node::leaf(0, 1000), Node::leaf(0, 1)] {
            let found = flaw(|bih| {
                let leaf = find_leaf(bih);
                bih.nodes[leaf] = replacement;
            });
            assert!(matches!(found, BihFlaw::WrongReferences { .. }), "{found}");
        }
    }

    #[test]
    fn references_in_no_leaf_are_detected() {
        let boxes = boxes(2);
        let mut bih = build(&boxes, 2);
        bih.nodes[0] = Node::leaf(0, 1);
        assert_eq!(check(&bih, &boxes), Err(BihFlaw::WrongReferences { node: 0 }));
    }

    #[test]
    fn empty_leaves_are_detected() {
        let found = flaw(|bih| {
            let leaf = find_leaf(bih);
            bih.nodes[leaf] = Node::leaf(0, 0);
        });
        assert!(matches!(found, BihFlaw::EmptyLeaf { .. }), "{found}");
    }

    #[test]
    fn wrong_and_missing_children_are_detected() {
        for change in [1, u32::MAX] {
            let found = flaw(|bih| {
                let at = find(bih, |kind| matches!(kind, NodeKind::Split { .. }));
                let NodeKind::Split { axis, second } = bih.nodes[at].kind() else { unreachable!("a split was found") };
                bih.nodes[at] = Node::split(axis, second.wrapping_add(change), bih.nodes[at].planes);
            });
            assert!(matches!(found, BihFlaw::WrongChild { .. }), "{found}");
        }
        let found = flaw(|bih| bih.nodes.truncate(bih.nodes.len() - 1));
        assert!(matches!(found, BihFlaw::WrongChild { .. }), "{found}");
        assert_eq!(flaw(|bih| bih.nodes.clear()), BihFlaw::WrongChild { node: 0 });
    }

    #[test]
    fn unreached_nodes_are_detected() {
        let mut n = 0;
        let found = flaw(|bih| {
            n = bih.nodes.len();
            bih.nodes.push(Node::leaf(0, 1));
        });
        assert_eq!(found, BihFlaw::Unreached { node: n });
    }

    /// One step of the least unit is enough.
    #[test]
    fn planes_that_cut_content_are_detected() {
        for plane in [0, 1] {
            for is_clip in [true, false] {
                let mut at = 0;
                let found = flaw(|bih| {
                    at = find(bih, |kind| match kind {
                        NodeKind::Clip { .. } => is_clip,
                        NodeKind::Split { .. } => !is_clip,
                        NodeKind::Leaf { .. } => false,
                    });
                    let planes = &mut bih.nodes[at].planes;
                    planes[plane] = if plane == 0 { planes[0].next_down() } else { planes[1].next_up() };
                });
                assert_eq!(found, BihFlaw::Escapes { node: at }, "plane {plane}, clip node: {is_clip}");
            }
        }
    }

    #[test]
    fn a_root_box_that_cuts_content_is_detected() {
        for k in 0..3 {
            assert_eq!(
                flaw(|bih| bih.padded_bounds.min[k] = bih.padded_bounds.min[k].next_up()),
                BihFlaw::Escapes { node: 0 }
            );
            assert_eq!(
                flaw(|bih| bih.padded_bounds.max[k] = bih.padded_bounds.max[k].next_down()),
                BihFlaw::Escapes { node: 0 }
            );
            assert_eq!(flaw(|bih| bih.bounds.max[k] = bih.bounds.max[k].next_down()), BihFlaw::Escapes { node: 0 });
        }
    }

    #[test]
    fn a_wrong_depth_is_detected() {
        let mut actual = 0;
        let found = flaw(|bih| {
            actual = bih.depth;
            bih.depth += 1;
        });
        assert_eq!(found, BihFlaw::WrongDepth { stated: actual + 1, actual });
    }

    #[test]
    fn excessive_depth_is_detected() {
        let found = flaw(|bih| {
            let clip = find_clip(bih);
            let node = bih.nodes[clip];
            bih.nodes
                .splice(0..0, std::iter::repeat_n(Node::clip(0, [f32::MAX, f32::MIN]), BoxBih::MAX_DEPTH as usize));
            assert!(bih.nodes.contains(&node));
        });
        assert_eq!(found, BihFlaw::TooDeep { node: BoxBih::MAX_DEPTH as usize });
    }
}
