use canted_trace::lanes::lower;

/// A node of 16 bytes: a leaf, a split node with two children, or a clip node with one.
///
/// The first child follows its parent. The word holds the axis in its lower two bits, 3 for a leaf, and above them the first
/// reference of a leaf.
///
/// Departures from the source: the distance is relative to the node, so that subtrees built on different threads are joined
/// by copying; the first child is written before anything of the second (the source allocates both children at once,
/// which contradicts its own `left = parent + 1`); a node with one child records what the tight-box rule cut off, which the
/// source forgets, so that rays do not see it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(16))]
pub(crate) struct Node {
    word: u32,
    /// Primitives of a leaf; otherwise the distance to the second child, 0 if there is none.
    items: u32,
    /// An upper plane, then a lower plane, both padded. Of a split node: the upper plane of the first child and the lower plane
    /// of the second. Of a clip node: both planes of its child. Zeros in a leaf.
    pub(crate) planes: [f32; 2],
}

const _: () = assert!(size_of::<Node>() == 16, "a node takes 16 bytes");

/// The axis bits of a leaf.
const LEAF: u32 = 3;

/// What a [`Node`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NodeKind {
    /// Two children: the next node, and the one at this distance.
    Split { axis: usize, second: u32 },
    /// One child: the next node.
    Clip { axis: usize },
    /// `n` references from the first.
    Leaf { first: u32, n: u32 },
}

impl Node {
    /// The reference positions fit 30 bits, as at most 2^30 primitives do.
    pub(crate) fn leaf(first: u32, n: u32) -> Self {
        Self { word: first << 2 | LEAF, items: n, planes: [0.0; 2] }
    }

    pub(crate) fn split(axis: usize, second: u32, planes: [f32; 2]) -> Self {
        Self { word: axis as u32, items: second, planes }
    }

    pub(crate) fn clip(axis: usize, planes: [f32; 2]) -> Self {
        Self { word: axis as u32, items: 0, planes }
    }

    #[inline(always)]
    pub(crate) fn kind(self) -> NodeKind {
        let axis = (self.word & 3) as usize;
        if self.word & 3 == LEAF {
            NodeKind::Leaf { first: self.word >> 2, n: self.items }
        } else if self.items == 0 {
            NodeKind::Clip { axis }
        } else {
            NodeKind::Split { axis, second: self.items }
        }
    }
}

/// The stored upper plane for content up to `max`.
#[inline]
pub(crate) fn upper_plane(max: f32, pad: f64) -> f32 {
    -lower(-max, pad)
}

/// The stored lower plane for content from `min`.
#[inline]
pub(crate) fn lower_plane(min: f32, pad: f64) -> f32 {
    lower(min, pad)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_round_trip_at_their_limits() {
        const MAX: u32 = (1 << 30) - 1;
        for axis in 0..3 {
            for second in [2, 3, u32::MAX] {
                assert_eq!(Node::split(axis, second, [0.0; 2]).kind(), NodeKind::Split { axis, second });
            }
            assert_eq!(Node::clip(axis, [0.0; 2]).kind(), NodeKind::Clip { axis });
        }
        for (first, n) in [(0, 1), (MAX, 1), (0, 1 << 30), (7, 2)] {
            assert_eq!(Node::leaf(first, n).kind(), NodeKind::Leaf { first, n });
        }
    }
}
