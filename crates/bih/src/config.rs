use canted_trace::TriangleTest;

/// How [`Bih::build`](crate::Bih::build) and [`BoxBih::build`](crate::BoxBih::build) build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BihConfig {
    /// Greatest number of primitives in a leaf.
    ///
    /// Only primitives whose boxes have the same center stay together in larger leaves.
    pub leaf_size: LeafSize,
    /// The triangle test of a [`Bih`](crate::Bih).
    pub test: TriangleTest,
    /// Tight-box factor: where the primitives of a node, times this factor, are narrower along the split axis than the
    /// node, a clip node with both planes is inserted and the split is chosen again.
    ///
    /// Infinity turns the rule off. Values below 1, and NaN, act as 1: every empty margin is cut off. Default: 1.3, the value
    /// of the source.
    pub tight_factor: f32,
}

impl BihConfig {
    /// Default of [`BihConfig::tight_factor`].
    pub const TIGHT_FACTOR: f32 = 1.3;

    /// The greatest number of primitives in a leaf of a BIH over `n` primitives, at least 1.
    pub(crate) fn max_leaf(&self, n: usize) -> usize {
        match self.leaf_size {
            LeafSize::Auto => {
                if n < MANY {
                    AUTO_FEW
                } else {
                    AUTO_MANY
                }
            }
            LeafSize::AtMost(n) => (n as usize).max(1),
        }
    }

    /// The tight-box factor, at least 1.
    pub(crate) fn factor(&self) -> f32 {
        // `max` returns the number where the other is NaN.
        self.tight_factor.max(1.0)
    }
}

impl Default for BihConfig {
    fn default() -> Self {
        Self { leaf_size: LeafSize::Auto, test: TriangleTest::default(), tight_factor: Self::TIGHT_FACTOR }
    }
}

/// Greatest number of primitives in a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum LeafSize {
    /// 4 for fewer than 16,384 primitives, otherwise 10.
    ///
    /// Measured on generated scenes of 4,000 and 100,000 triangles: within 8 % of the most rays per second of any size
    /// from 1 to 24. Nodes of a small BIH are in the cache, so that triangle tests cost more than nodes there.
    #[default]
    Auto,
    /// This number; 0 acts as 1.
    AtMost(u32),
}

/// From this number of primitives on, [`LeafSize::Auto`] makes larger leaves.
const MANY: usize = 1 << 14;
const AUTO_FEW: usize = 4;
const AUTO_MANY: usize = 10;
