//! Reproducible random numbers.

/// A linear congruential generator with Knuth's constants, of which only the high bits are used.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// An integer from 0 to `n - 1`.
    pub(crate) fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from((self.0 >> 33) % u64::from(n)).unwrap_or(0)
    }

    /// An integer from `-n` to `n`.
    pub(crate) fn around_zero(&mut self, n: u32) -> i32 {
        i32::try_from(self.below(2 * n + 1)).unwrap_or(0) - i32::try_from(n).unwrap_or(0)
    }

    /// A point whose coordinates are integers from `-n` to `n`.
    pub(crate) fn point(&mut self, n: u32) -> [i32; 3] {
        std::array::from_fn(|_| self.around_zero(n))
    }
}
