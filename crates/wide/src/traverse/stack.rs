use std::cell::Cell;

/// Capacity without allocation: enough for 12 levels. The BVH of a scaffold of 58,320 triangles has 7.
const INLINE: usize = Stack::capacity(12);

/// Subtrees to visit later: the bits of the entry above the child word, so that entries are ordered as integers.
///
/// A stack is made for each single ray, so it must be cheap: less than a kilobyte of zeros, where an allocation would take
/// longer (`benches/TRIED.md`). Stacks of deeper BVHs are allocated, and kept for the next query of the thread.
#[derive(Debug)]
pub(crate) struct Stack {
    inline: [u64; INLINE],
    /// Empty, or what is used instead. What its slots hold at first means nothing.
    spilled: Vec<u64>,
}

thread_local! {
    /// The memory of the last stack of a deep BVH.
    static SPARE: Cell<Vec<u64>> = const { Cell::new(Vec::new()) };
}

impl Stack {
    /// Capacity for a BVH of this depth: up to seven siblings wait on each level, and one more subtree on top.
    #[inline(always)]
    pub(crate) fn new(depth: u32) -> Self {
        let capacity = Self::capacity(depth as usize);
        Self { inline: [0; INLINE], spilled: if capacity > INLINE { spare(capacity) } else { Vec::new() } }
    }

    const fn capacity(depth: usize) -> usize {
        7 * depth + 8
    }

    /// All entries, bottom first.
    #[inline(always)]
    pub(crate) fn slots(&mut self) -> &mut [u64] {
        if self.spilled.is_empty() { &mut self.inline } else { &mut self.spilled }
    }
}

/// Memory for `capacity` entries. A query within another finds none to use again, and allocates.
#[cold]
fn spare(capacity: usize) -> Vec<u64> {
    let mut slots = SPARE.try_with(Cell::take).unwrap_or_default();
    if slots.len() < capacity {
        slots.resize(capacity, 0);
    }
    slots
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
            let n = Stack::new(depth).slots().len();
            assert!(n >= 7 * depth as usize + 8, "{n} entries for {depth} levels");
        }
        assert!(Stack::new(12).spilled.is_empty() && !Stack::new(13).spilled.is_empty());
    }

    #[test]
    fn nested_stacks_share_no_memory() {
        let (mut outer, mut inner) = (Stack::new(20), Stack::new(30));
        outer.slots().fill(1);
        inner.slots().fill(2);
        assert!(outer.slots().iter().all(|&slot| slot == 1));
        drop((outer, inner));
        assert!(Stack::new(200).slots().len() >= 1408);
    }
}
