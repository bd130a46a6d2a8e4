//! Which primitives the leaves of a binary tree hold.

use std::ops::Range;

/// The primitives of leaves, by their place in leaf order.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Members<'a> {
    /// One for each leaf.
    One,
    /// Several: where each leaf starts, then the number of primitives.
    Groups(&'a [u32]),
}

impl Members<'_> {
    /// Places of the primitives of leaves `first..=last`.
    #[inline]
    pub(crate) fn range(self, first: u32, last: u32) -> Range<u32> {
        match self {
            Self::One => first..last + 1,
            Self::Groups(starts) => starts[first as usize]..starts[last as usize + 1],
        }
    }

    /// Their number.
    #[inline]
    pub(crate) fn n(self, first: u32, last: u32) -> usize {
        let range = self.range(first, last);
        (range.end - range.start) as usize
    }
}
