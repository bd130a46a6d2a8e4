use std::cell::Cell;

/// Capacity without allocation: enough for 12 levels. The BVH of a scaffold of 58,320 triangles has 7.
const INLINE: usize = Stack::capacity(12);

/// Subtrees to visit later: the bits of the entry above the child word, so that entries are ordered as integers.
///
/// A stack is made for each single ray, so it must be cheap: less than a kilobyte of zeros, where an allocation would take
/// longer (`benches/TRIED.md`); it is used where it was made, since a copy costs more than the zeros. Memory for deeper BVHs is
/// allocated, and kept for the next query of the thread.
#[doc(hidden)]
#[derive(Debug)]
pub struct Stack {
    inline: [u64; INLINE],
    /// Empty, or what deep BVHs use instead. What its slots hold at first means nothing.
    spilled: Vec<u64>,
}

thread_local! {
    /// The memory of the last stack of a deep BVH.
    static SPARE: Cell<Vec<u64>> = const { Cell::new(Vec::new()) };
}

impl Default for Stack {
    #[inline(always)]
    fn default() -> Self {
        Self::new()
    }
}

impl Stack {
    /// An empty stack.
    #[inline(always)]
    #[must_use]
    pub const fn new() -> Self {
        Self { inline: [0; INLINE], spilled: Vec::new() }
    }

    const fn capacity(depth: usize) -> usize {
        7 * depth + 8
    }

    /// All entries for a BVH of this depth, bottom first: up to seven siblings wait on each level, and one more subtree on top.
    #[inline(always)]
    pub(crate) fn slots(&mut self, depth: u32) -> &mut [u64] {
        let capacity = Self::capacity(depth as usize);
        if capacity <= INLINE {
            return &mut self.inline;
        }
        if self.spilled.len() < capacity {
            self.spill(capacity);
        }
        &mut self.spilled
    }

    #[cold]
    fn spill(&mut self, capacity: usize) {
        if self.spilled.is_empty() {
            self.spilled = SPARE.try_with(Cell::take).unwrap_or_default();
        }
        // A query within another finds none to use again, and allocates.
        if self.spilled.len() < capacity {
            self.spilled.resize(capacity, 0);
        }
    }
}

impl Drop for Stack {
    #[inline(always)]
    fn drop(&mut self) {
        if !self.spilled.is_empty() {
            keep(std::mem::take(&mut self.spilled));
        }
    }
}

#[cold]
fn keep(slots: Vec<u64>) {
    // An error only while the thread ends.
    let _ = SPARE.try_with(|spare| spare.set(slots));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deeper_bvhs_get_larger_stacks() {
        for depth in [0, 1, 11, 12, 13, 96, 1000, 13] {
            let n = Stack::new().slots(depth).len();
            assert!(n >= 7 * depth as usize + 8, "{n} entries for {depth} levels");
        }
        let mut stack = Stack::new();
        for (depth, is_inline) in [(12, true), (13, false), (300, false), (12, false)] {
            assert!(stack.slots(depth).len() >= 7 * depth as usize + 8);
            assert_eq!(stack.spilled.is_empty(), is_inline);
        }
    }

    #[test]
    fn nested_stacks_share_no_memory() {
        let (mut outer, mut inner) = (Stack::new(), Stack::new());
        outer.slots(20).fill(1);
        inner.slots(30).fill(2);
        assert!(outer.slots(20).iter().all(|&slot| slot == 1));
        drop((outer, inner));
        assert!(Stack::new().slots(200).len() >= 1408);
    }
}
