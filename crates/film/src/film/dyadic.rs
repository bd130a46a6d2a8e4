//! Sums over ranges of sample numbers whose bits do not depend on how a range is split.
//!
//! ```text
//! reads   values of consecutive sample numbers, or of blocks of them
//! writes  one value for each block of the range
//! holds   the sum over a block `[k·2^j, (k + 1)·2^j)` is the sum of its two halves, whatever was added before
//! source  binary counters; pairwise summation (Higham 2002, section 4.2)
//! ```
//!
//! A range is split into the fewest such blocks, `O(log n)` of them. Blocks are nested or disjoint, so the blocks of parts of
//! a range are subtrees of the blocks of the range: joining parts makes the same additions, with the same operands in the
//! same order, as summing the range.

use std::ops::{Add, Range};

/// The sample numbers `[first, first + len)`; `len` is a power of two that divides `first`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Block {
    /// Lowest sample number.
    pub first: u32,
    /// Number of samples.
    pub len: u32,
}

impl Block {
    /// Whether `self` and `next` are the halves of a block.
    fn is_completed_by(self, next: Self) -> bool {
        self.len == next.len && self.first & self.len == 0 && self.first + self.len == next.first
    }

    /// The fewest blocks that cover `range`, in order.
    #[must_use]
    pub fn of(range: Range<u32>) -> Vec<Self> {
        let mut blocks = Vec::new();
        let mut first = range.start;
        while first < range.end {
            // The longest block that may start here; every power of two divides zero.
            let aligned = 1 << first.trailing_zeros().min(u32::BITS - 1);
            let len = aligned.min(1 << (range.end - first).ilog2());
            blocks.push(Self { first, len });
            first += len;
        }
        blocks
    }
}

/// Sums of blocks; two halves of a block are added as soon as both are present.
#[derive(Clone, Debug)]
pub struct Dyadic<T> {
    blocks: Vec<(Block, T)>,
}

impl<T> Default for Dyadic<T> {
    fn default() -> Self {
        Self { blocks: Vec::new() }
    }
}

impl<T: Copy + Default + Add<Output = T>> Dyadic<T> {
    /// Adds the value of the next block, as the sum of its two halves.
    pub fn push(&mut self, mut block: Block, mut value: T) {
        while let Some(&(before, sum)) = self.blocks.last()
            && before.is_completed_by(block)
        {
            self.blocks.pop();
            block = Block { first: before.first, len: 2 * block.len };
            value = sum + value;
        }
        self.blocks.push((block, value));
    }

    /// Adds the value of the next sample.
    pub fn push_sample(&mut self, sample: u32, value: T) {
        self.push(Block { first: sample, len: 1 }, value);
    }

    /// The values of the blocks, in order.
    pub(crate) fn values(&self) -> impl Iterator<Item = T> {
        self.blocks.iter().map(|(_, value)| *value)
    }

    /// The sum over all blocks, in order.
    #[must_use]
    pub fn total(&self) -> T {
        total(self.values())
    }

    /// Removes all blocks.
    pub fn clear(&mut self) {
        self.blocks.clear();
    }
}

/// The sum of consecutive values, in order, starting with the first.
pub(crate) fn total<T: Default + Add<Output = T>>(values: impl IntoIterator<Item = T>) -> T {
    values.into_iter().reduce(T::add).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum of a block by definition.
    fn by_halves(block: Block, value: &dyn Fn(u32) -> f64) -> f64 {
        if block.len == 1 {
            return value(block.first);
        }
        let len = block.len / 2;
        by_halves(Block { len, ..block }, value) + by_halves(Block { first: block.first + len, len }, value)
    }

    /// Values of different magnitudes, whose sum depends on the order.
    fn value(sample: u32) -> f64 {
        let hash = sample.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
        f64::from(hash) * 2.0_f64.powi(i32::try_from(hash % 60).unwrap_or(0))
    }

    fn sums(range: Range<u32>) -> Dyadic<f64> {
        let mut sums = Dyadic::default();
        range.for_each(|sample| sums.push_sample(sample, value(sample)));
        sums
    }

    #[test]
    fn blocks_are_aligned_maximal_and_contiguous() {
        for start in 0..70 {
            for end in start..140 {
                let blocks = Block::of(start..end);
                let mut next = start;
                for block in &blocks {
                    assert!(block.len.is_power_of_two() && block.first % block.len == 0, "{block:?}");
                    assert_eq!(block.first, next);
                    next += block.len;
                }
                assert_eq!(next, end.max(start));
                assert!(blocks.windows(2).all(|pair| !pair[0].is_completed_by(pair[1])), "{start}..{end}");
            }
        }
        assert_eq!(Block::of(0..u32::MAX).len(), 32);
        assert_eq!(Block::of(0..1 << 31), [Block { first: 0, len: 1 << 31 }]);
    }

    #[test]
    fn sums_match_the_definition() {
        for range in [0..0, 0..1, 0..32, 3..77, 5..6, 64..127, 1000..1033] {
            let sums = sums(range.clone());
            let expected: Vec<f64> = Block::of(range).into_iter().map(|block| by_halves(block, &value)).collect();
            assert_eq!(sums.values().map(f64::to_bits).collect::<Vec<_>>(), bits(&expected));
        }
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|x| x.to_bits()).collect()
    }

    #[test]
    fn splitting_does_not_change_bits() {
        for [start, end] in [[0, 32], [7, 61], [0, 33]] {
            let whole: Vec<f64> = sums(start..end).values().collect();
            for a in start..=end {
                for b in a..=end {
                    let mut joined = Dyadic::default();
                    for part in [start..a, a..b, b..end] {
                        for (block, sum) in Block::of(part.clone()).into_iter().zip(sums(part).values()) {
                            joined.push(block, sum);
                        }
                    }
                    assert_eq!(bits(&joined.values().collect::<Vec<_>>()), bits(&whole), "{start} {a} {b} {end}");
                }
            }
        }
    }

    #[test]
    fn serial_sums_depend_on_the_split() {
        let serial = |range: Range<u32>| range.map(value).fold(0.0, f64::add);
        assert!((1..32).any(|a| (serial(0..a) + serial(a..32)).to_bits() != serial(0..32).to_bits()));
    }
}
