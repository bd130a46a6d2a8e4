/// How long a tree is improved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReinsertConfig {
    /// Most rounds of search and reinsertion.
    pub iterations: u32,
    /// Share of all nodes and leaves, those of largest area, searched a better place in the first round; round `i`
    /// searches `1 / (2i + 1)` of it. At most 1.
    pub fraction: f32,
    /// Rounds end with the first whose gain is below this part of the sum of areas.
    pub min_gain: f32,
}

impl ReinsertConfig {
    /// For trees that are traced once or twice.
    pub const FAST: Self = Self { iterations: 4, fraction: 0.05, min_gain: 1e-3 };

    /// Most of the gain.
    pub const BALANCED: Self = Self { iterations: 12, fraction: 0.1, min_gain: 1e-3 };

    /// Nearly all of the gain: what every subtree and more rounds would bring besides stands in `benches/TRIED.md`.
    pub const QUALITY: Self = Self { iterations: 8, fraction: 0.5, min_gain: 1e-3 };
}

impl Default for ReinsertConfig {
    fn default() -> Self {
        Self::BALANCED
    }
}
