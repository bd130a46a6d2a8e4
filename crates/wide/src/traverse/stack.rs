/// Capacity without allocation: enough for 12 levels. The BVH of a scaffold of 58,320 triangles has 7.
const INLINE: usize = Stack::capacity(12);

/// Subtrees to visit later: the bits of the entry above the child word, so that entries are ordered as integers.
///
/// A stack is made for each single ray, so it must be cheap: less than a kilobyte of zeros, where an allocation would take
/// longer (`benches/TRIED.md`). Only deeper BVHs allocate.
#[derive(Clone, Debug)]
pub(crate) struct Stack {
    inline: [u64; INLINE],
    spilled: Vec<u64>,
}

impl Stack {
    /// Capacity for a BVH of this depth: up to seven siblings wait on each level, and one more subtree on top.
    #[inline(always)]
    pub(crate) fn new(depth: u32) -> Self {
        let capacity = Self::capacity(depth as usize);
        Self { inline: [0; INLINE], spilled: if capacity > INLINE { vec![0; capacity] } else { Vec::new() } }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deeper_bvhs_get_larger_stacks() {
        for depth in [0, 1, 11, 12, 13, 96, 1000] {
            let n = Stack::new(depth).slots().len();
            assert!(n >= 7 * depth as usize + 8, "{n} entries for {depth} levels");
        }
        assert!(Stack::new(12).spilled.is_empty() && !Stack::new(13).spilled.is_empty());
    }
}
