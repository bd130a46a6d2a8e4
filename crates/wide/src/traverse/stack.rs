/// Places that need no allocation: enough for trees of 12 levels. A scaffold of 58,320 triangles has 7.
const INLINE: usize = Stack::places(12);

/// Subtrees to come back to: the entry's bits above the child word, so that order is order of integers.
///
/// A stack is made for each single ray, so it must cost little: less than a kilobyte of zeros, where memory of its own would take
/// longer (`benches/TRIED.md`). Only trees of more levels ask for that.
#[derive(Clone, Debug)]
pub(crate) struct Stack {
    inline: [u64; INLINE],
    spilled: Vec<u64>,
}

impl Stack {
    /// Room for a tree of this depth: up to seven siblings wait on each level, and one subtree more on top.
    #[inline(always)]
    pub(crate) fn new(depth: u32) -> Self {
        let places = Self::places(depth as usize);
        Self { inline: [0; INLINE], spilled: if places > INLINE { vec![0; places] } else { Vec::new() } }
    }

    const fn places(depth: usize) -> usize {
        7 * depth + 8
    }

    /// All places, bottom first.
    #[inline(always)]
    pub(crate) fn slots(&mut self) -> &mut [u64] {
        if self.spilled.is_empty() { &mut self.inline } else { &mut self.spilled }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deeper_trees_get_more_places() {
        for depth in [0, 1, 11, 12, 13, 96, 1000] {
            let n = Stack::new(depth).slots().len();
            assert!(n >= 7 * depth as usize + 8, "{n} places for {depth} levels");
        }
        assert!(Stack::new(12).spilled.is_empty() && !Stack::new(13).spilled.is_empty());
    }
}
