/// Greatest number of nodes above a leaf.
pub(crate) const MAX_DEPTH: u32 = 64;

/// A node of 8 bytes: a plane, or a leaf.
///
/// Nodes are stored depth first: the lower child of a node follows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub(crate) struct Node {
    /// Bits of the plane's coordinate; of a leaf, the position of its first reference, or [`EMPTY`].
    value: u32,
    /// Two bits for the axis, or 3 for a leaf; above, the number of the upper child, or of the leaf.
    link: u32,
}

/// Where an empty leaf has its first reference.
const EMPTY: u32 = u32::MAX;

/// Axis of a leaf.
const LEAF: u32 = 3;

/// What a [`Node`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum NodeKind {
    /// The plane where `axis` has the coordinate `plane`. The lower cell is the next node.
    Inner { axis: usize, plane: f32, upper: u32 },
    /// A cell with references from `first` on, if it has any; leaves are numbered depth first.
    Leaf { first: Option<u32>, number: u32 },
}

impl Node {
    /// A plane; `upper` is set later.
    pub(crate) fn inner(axis: usize, plane: f32) -> Self {
        Self { value: plane.to_bits(), link: axis as u32 }
    }

    pub(crate) fn leaf(first: Option<u32>) -> Self {
        Self { value: first.unwrap_or(EMPTY), link: LEAF }
    }

    /// With the number of the upper child, or of the leaf.
    pub(crate) fn with_number(self, number: u32) -> Self {
        Self { value: self.value, link: self.link & 3 | number << 2 }
    }

    /// The same in a longer array: `nodes` and `references` precede it.
    pub(crate) fn shifted(self, nodes: u32, references: u32) -> Self {
        match self.kind() {
            NodeKind::Inner { upper, .. } => self.with_number(upper + nodes),
            NodeKind::Leaf { first, number } => Self::leaf(first.map(|first| first + references)).with_number(number),
        }
    }

    #[inline(always)]
    pub(crate) fn kind(self) -> NodeKind {
        match self.link & 3 {
            LEAF => NodeKind::Leaf { first: (self.value != EMPTY).then_some(self.value), number: self.link >> 2 },
            axis => NodeKind::Inner { axis: axis as usize, plane: f32::from_bits(self.value), upper: self.link >> 2 },
        }
    }
}

/// A triangle in a leaf. The last one of a leaf is marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct Reference(u32);

impl Reference {
    const LAST: u32 = 1 << 31;

    pub(crate) fn new(triangle: u32, is_last: bool) -> Self {
        Self(triangle | if is_last { Self::LAST } else { 0 })
    }

    #[inline(always)]
    pub(crate) fn triangle(self) -> u32 {
        self.0 & !Self::LAST
    }

    #[inline(always)]
    pub(crate) fn is_last(self) -> bool {
        self.0 & Self::LAST != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_take_eight_bytes_and_return_what_they_were_given() {
        assert_eq!((size_of::<Node>(), size_of::<Reference>()), (8, 4));
        for (axis, plane, upper) in [(0, -0.5, 1), (1, 1e30, (1 << 30) - 1), (2, -f32::MIN_POSITIVE, 77)] {
            let node = Node::inner(axis, plane).with_number(upper);
            assert_eq!(node.kind(), NodeKind::Inner { axis, plane, upper });
            assert_eq!(node.shifted(0, 5).kind(), NodeKind::Inner { axis, plane, upper });
        }
        for first in [None, Some(0), Some((1 << 31) - 1)] {
            assert_eq!(Node::leaf(first).with_number(9).kind(), NodeKind::Leaf { first, number: 9 });
        }
        assert_eq!(Node::leaf(Some(3)).shifted(7, 5).kind(), NodeKind::Leaf { first: Some(8), number: 0 });
        let last = Reference::new((1 << 30) - 1, true);
        assert_eq!((last.triangle(), last.is_last(), Reference::new(4, false).is_last()), ((1 << 30) - 1, true, false));
    }
}
