/// A child of a pair: a leaf, or a pair of either kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(super) struct ChildRef(pub(super) u32);

/// What a [`ChildRef`] refers to.
pub(super) enum ChildRefKind {
    /// The position of a leaf.
    Leaf(u32),
    /// The index of a pair with two axis-aligned boxes.
    Aabbs(u32),
    /// The index of a pair with an oriented box.
    Slabs(u32),
}

impl ChildRef {
    const LEAF: u32 = 1 << 31;
    const SLABS: u32 = 1 << 30;

    pub(super) fn leaf(position: u32) -> Self {
        Self(position | Self::LEAF)
    }

    pub(super) fn aabbs(index: u32) -> Self {
        Self(index)
    }

    pub(super) fn slabs(index: u32) -> Self {
        Self(index | Self::SLABS)
    }

    #[inline(always)]
    pub(super) fn kind(self) -> ChildRefKind {
        if self.0 & Self::LEAF != 0 {
            ChildRefKind::Leaf(self.0 & !Self::LEAF)
        } else if self.0 & Self::SLABS != 0 {
            ChildRefKind::Slabs(self.0 & !Self::SLABS)
        } else {
            ChildRefKind::Aabbs(self.0)
        }
    }
}
