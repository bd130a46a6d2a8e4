//! Sums of the samples of a pixel, and sums over ranges of sample numbers whose bits do not depend on how a range is split.
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

use std::fmt;
use std::ops::{Add, Range};

use crate::compare::REL_MSE_FLOOR;
use crate::srgb::luminance;

/// Sample sums of one pixel in `f64`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Sum of linear RGB, minus that of samples with negative weight.
    pub sum: [f64; 3],
    /// Sum of the squares of linear RGB.
    pub sum_of_squares: [f64; 3],
    /// Samples in the sums.
    pub n_samples: u32,
    /// Samples in the sums with negative weight.
    pub n_negative: u32,
    /// Samples that were dropped because they were not finite.
    pub n_dropped: u32,
}

impl Pixel {
    /// One sample, which is dropped if a channel is not finite.
    #[must_use]
    pub fn of(radiance: [f32; 3]) -> Self {
        if !radiance.iter().all(|x| x.is_finite()) {
            return Self { n_dropped: 1, ..Self::default() };
        }
        // Without negative zeros, which sums would lose or not by the order of their terms.
        let sum = radiance.map(|x| f64::from(x) + 0.0);
        Self { sum, sum_of_squares: sum.map(|x| x * x), n_samples: 1, ..Self::default() }
    }

    /// One sample with a weight of 1 or -1.
    #[must_use]
    pub fn weighted(radiance: [f32; 3], weight: f32) -> Self {
        let sample = Self::of(radiance);
        if weight >= 0.0 {
            return sample;
        }
        Self { sum: sample.sum.map(|x| 0.0 - x), n_negative: sample.n_samples, ..sample }
    }

    /// Samples taken, including dropped ones.
    #[must_use]
    pub fn n_taken(&self) -> u32 {
        self.n_samples + self.n_dropped
    }

    /// Weighted mean of the finite samples; black without samples.
    #[must_use]
    pub fn mean(&self) -> [f64; 3] {
        let weight = self.weight();
        self.sum.map(|sum| sum / weight)
    }

    /// The mean in `f32`.
    #[must_use]
    pub(crate) fn rounded_mean(&self) -> [f32; 3] {
        self.mean().map(|x| x as f32)
    }

    /// Sum of the weights; 1 where the sum is zero.
    pub(crate) fn weight(&self) -> f64 {
        let weight = f64::from(self.n_samples) - 2.0 * f64::from(self.n_negative);
        if weight == 0.0 { 1.0 } else { weight }
    }

    /// Unbiased variance of the mean of independent samples; zero for fewer than two samples.
    ///
    /// It overestimates the variance of stratified samples, and of samples with negative weights, because it treats the sum of
    /// weights as a constant.
    #[must_use]
    pub fn variance_of_mean(&self) -> [f64; 3] {
        if self.n_samples < 2 {
            return [0.0; 3];
        }
        let n = f64::from(self.n_samples);
        let by_weight = (n / self.weight()).powi(2);
        std::array::from_fn(|k| {
            let squares = self.sum_of_squares[k] - self.sum[k] * self.sum[k] / n;
            squares.max(0.0) / (n * (n - 1.0)) * by_weight
        })
    }

    /// Square of the relative standard error of the mean luminance, `s² / (Y² + ε)`, with `ε` = [`REL_MSE_FLOOR`].
    ///
    /// The floor makes the error of pixels darker than a tenth of white absolute. `s` is the weighted sum of the channels'
    /// standard errors, which is an upper bound of that of the luminance (Cauchy-Schwarz). Infinite for fewer than two samples.
    #[must_use]
    pub fn squared_error(&self) -> f64 {
        if self.n_samples < 2 {
            return f64::INFINITY;
        }
        let error = luminance(self.variance_of_mean().map(f64::sqrt));
        let mean = luminance(self.mean());
        error * error / (mean * mean + REL_MSE_FLOOR)
    }
}

impl Add for Pixel {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            sum: std::array::from_fn(|k| self.sum[k] + other.sum[k]),
            sum_of_squares: std::array::from_fn(|k| self.sum_of_squares[k] + other.sum_of_squares[k]),
            n_samples: self.n_samples + other.n_samples,
            n_negative: self.n_negative + other.n_negative,
            n_dropped: self.n_dropped + other.n_dropped,
        }
    }
}

/// AOV sums of one pixel in `f64`, in world space. A sample that misses adds zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guide {
    /// Samples that hit.
    pub n_hits: u32,
    /// Instance and primitive of the first sample that hits.
    pub first: Option<[u32; 2]>,
    /// Distance along the view axis.
    pub depth: f64,
    /// Geometric unit normal, towards the camera.
    pub normal: [f64; 3],
    /// Unit shading normal.
    pub shading_normal: [f64; 3],
    /// Reflectance, linear RGB.
    pub albedo: [f64; 3],
    /// Box and triangle tests of the camera ray, including misses.
    pub tests: [f64; 2],
}

/// `f64` sums of a guide.
const N_SUMS: usize = 12;

impl Guide {
    /// All sums in the order of the fields.
    pub(crate) fn sums(&self) -> [f64; N_SUMS] {
        let mut sums = [0.0; N_SUMS];
        sums[0] = self.depth;
        for (at, part) in [(1, &self.normal[..]), (4, &self.shading_normal), (7, &self.albedo), (10, &self.tests)] {
            sums[at..at + part.len()].copy_from_slice(part);
        }
        sums
    }

    /// The guide with these sums.
    pub(crate) fn from_sums(n_hits: u32, first: Option<[u32; 2]>, sums: [f64; N_SUMS]) -> Self {
        let three = |at: usize| [sums[at], sums[at + 1], sums[at + 2]];
        Self {
            n_hits,
            first,
            depth: sums[0],
            normal: three(1),
            shading_normal: three(4),
            albedo: three(7),
            tests: [sums[10], sums[11]],
        }
    }
}

impl Add for Guide {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (a, b) = (self.sums(), other.sums());
        let sums = std::array::from_fn(|k| a[k] + b[k]);
        Self::from_sums(self.n_hits + other.n_hits, self.first.or(other.first), sums)
    }
}

/// The light of one pixel by how many surfaces scattered it on its way to the camera: sums in `f64` of the samples in [`Pixel::sum`],
/// with their weights, so that the three add up to that sum but for the roundings of single samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Components {
    /// Linear RGB of emission, which no surface scattered, of direct light, which one surface scattered, and of indirect light.
    pub sums: [[f64; 3]; 3],
    /// Linear RGB that the first surface reflects, in the order of [`Aov::FACTORS`](crate::Aov::FACTORS): of the listed lights if nothing
    /// occluded them, and what arrives of it; of the environment likewise. `None` where it is not requested.
    pub first: Option<[[f64; 3]; 4]>,
}

impl Components {
    /// The components of one sample with a weight of 1 or -1. A sample that [`Pixel::weighted`] drops has none.
    #[must_use]
    pub fn weighted(radiance: [[f32; 3]; 3], first: Option<[[f32; 3]; 4]>, weight: f32) -> Self {
        Self { sums: weighted(radiance, weight), first: first.map(|parts| weighted(parts, weight)) }
    }

    /// The parts of the mean of a pixel that has these components, see [`Pixel::mean`].
    #[must_use]
    pub fn mean(&self, pixel: &Pixel) -> Self {
        self.over(pixel.weight())
    }

    /// All sums divided by a number.
    pub(crate) fn over(&self, divisor: f64) -> Self {
        let divided = |part: [f64; 3]| part.map(|x| x / divisor);
        Self { sums: self.sums.map(divided), first: self.first.map(|parts| parts.map(divided)) }
    }

    /// The part of the light at the first surface that arrives, for the sums of all of it; 1 where there is none.
    pub(crate) fn arriving(all: f64, arrives: f64) -> f64 {
        if all == 0.0 { 1.0 } else { arrives / all }
    }

    /// The sums in the order of the fields; what is not requested is zero.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        self.sums.into_iter().chain(self.first.unwrap_or_default()).flatten()
    }

    /// The sums of these numbers; those of the first surface only if they are requested.
    pub(crate) fn from_numbers(mut next: impl FnMut() -> f64, has_first: bool) -> Self {
        let mut three = || std::array::from_fn(|_| next());
        let sums = std::array::from_fn(|_| three());
        Self { sums, first: has_first.then(|| std::array::from_fn(|_| three())) }
    }
}

/// Parts of the light of a sample with a weight of 1 or -1. If one is not finite all count as zero: what is occluded may be infinite in a sample that is kept.
fn weighted<const N: usize>(parts: [[f32; 3]; N], weight: f32) -> [[f64; 3]; N] {
    if !parts.as_flattened().iter().all(|x| x.is_finite()) {
        return [[0.0; 3]; N];
    }
    // Without negative zeros, which sums would lose or not by the order of their terms.
    parts.map(|part| part.map(|x| f64::from(weight) * f64::from(x) + 0.0))
}

/// The sums of two lists of parts.
fn added<const N: usize>(a: [[f64; 3]; N], b: [[f64; 3]; N]) -> [[f64; 3]; N] {
    std::array::from_fn(|part| std::array::from_fn(|k| a[part][k] + b[part][k]))
}

impl Add for Components {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let first = match (self.first, other.first) {
            (Some(a), Some(b)) => Some(added(a, b)),
            (a, b) => a.or(b),
        };
        Self { sums: added(self.sums, other.sums), first }
    }
}

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

    /// Adds the sum of all values of `samples`, which was made elsewhere in the same order, as that of a block, or as the only one.
    pub fn push_sum(&mut self, samples: Range<u32>, sum: T) {
        match Block::of(samples)[..] {
            [block] => self.push(block, sum),
            // It is half of no block.
            _ if self.blocks.is_empty() => self.blocks = vec![(Block { first: 0, len: 0 }, sum)],
            _ => unreachable!("it is the only one"),
        }
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

/// The sums of a range of samples, block by block, so that joined parts have the bits of an undivided render.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    range: Range<u32>,
    /// The blocks of the range.
    blocks: Vec<Block>,
    /// For each pixel, row by row, the sums of each block.
    pixels: Vec<Pixel>,
    /// The same for guides; empty without AOVs.
    guides: Vec<Guide>,
    /// The same for components; empty where none is requested.
    components: Vec<Components>,
}

impl Part {
    /// A part from the sums of all blocks of each pixel; `guides` and `components` may be empty.
    pub(crate) fn new(range: Range<u32>, pixels: Vec<Pixel>, guides: Vec<Guide>, components: Vec<Components>) -> Self {
        let blocks = Block::of(range.clone());
        Self { range, blocks, pixels, guides, components }
    }

    /// The sample numbers.
    #[must_use]
    pub fn range(&self) -> Range<u32> {
        self.range.clone()
    }

    /// The blocks of the range, in order.
    #[must_use]
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// The sums of each pixel's blocks, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = &[Pixel]> {
        self.pixels.chunks(self.blocks.len().max(1))
    }

    /// The guides of each pixel's blocks, row by row; nothing without AOVs.
    pub fn guides(&self) -> impl Iterator<Item = &[Guide]> {
        self.guides.chunks(self.blocks.len().max(1))
    }

    /// The components of each pixel's blocks, row by row; nothing where none is requested.
    pub fn components(&self) -> impl Iterator<Item = &[Components]> {
        self.components.chunks(self.blocks.len().max(1))
    }

    /// Joins parts of one picture, given in any order.
    ///
    /// # Errors
    /// [`JoinError`] if samples overlap or are missing between parts, or there is no part.
    ///
    /// # Panics
    /// If the parts have different numbers of pixels.
    pub fn join(mut parts: Vec<Self>) -> Result<Self, JoinError> {
        parts.sort_by_key(|part| (part.range.start, part.range.end));
        let (Some(first), Some(last)) = (parts.first(), parts.last()) else { return Err(JoinError::Empty) };
        for pair in parts.windows(2) {
            let [before, after] = [pair[0].range(), pair[1].range()];
            if after.start < before.end {
                return Err(JoinError::Overlap { before, after });
            }
            if after.start > before.end {
                return Err(JoinError::Gap { before, after });
            }
        }
        let range = first.range.start..last.range.end;
        assert!(parts.iter().all(|part| part.n_pixels() == first.n_pixels()), "parts of one picture");
        let pixels = joined(&parts, |part| &part.pixels);
        let guides = joined(&parts, |part| &part.guides);
        let components = joined(&parts, |part| &part.components);
        Ok(Self::new(range, pixels, guides, components))
    }

    fn n_pixels(&self) -> usize {
        self.pixels.len() / self.blocks.len().max(1)
    }
}

/// The sums of all blocks of the joined range, pixel by pixel.
fn joined<T: Copy + Default + Add<Output = T>>(parts: &[Part], sums: impl Fn(&Part) -> &Vec<T>) -> Vec<T> {
    let mut joined = Vec::new();
    let mut dyadic = Dyadic::default();
    let n_pixels = parts.iter().map(|part| sums(part).len() / part.blocks.len().max(1)).min().unwrap_or(0);
    for pixel in 0..n_pixels {
        dyadic.clear();
        for part in parts {
            let n = part.blocks.len();
            for (&block, &sum) in part.blocks.iter().zip(&sums(part)[pixel * n..(pixel + 1) * n]) {
                dyadic.push(block, sum);
            }
        }
        joined.extend(dyadic.values());
    }
    joined
}

/// Why parts cannot be joined.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JoinError {
    /// There is no part.
    Empty,
    /// Two parts share samples.
    Overlap {
        /// The range that starts first.
        before: Range<u32>,
        /// The other.
        after: Range<u32>,
    },
    /// Samples between two parts are missing.
    Gap {
        /// The range before.
        before: Range<u32>,
        /// The range after.
        after: Range<u32>,
    },
}

impl fmt::Display for JoinError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(f, "no samples to join"),
            Self::Overlap { before, after } => write!(f, "samples {before:?} and {after:?} overlap"),
            Self::Gap { before, after } => {
                write!(f, "samples {:?} between {before:?} and {after:?} are missing", before.end..after.start)
            }
        }
    }
}

impl std::error::Error for JoinError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_variances_of_few_samples() {
        let pixel = Pixel::default();
        assert_eq!(pixel.mean(), [0.0; 3]);
        assert_eq!(pixel.variance_of_mean(), [0.0; 3]);
        let pixel = Pixel::of([1.0, 2.0, 4.0]);
        assert_eq!(pixel.mean(), [1.0, 2.0, 4.0]);
        assert_eq!(pixel.variance_of_mean(), [0.0; 3]);
        let pixel = pixel + Pixel::of([3.0, 2.0, 8.0]);
        // Two samples a and b: the variance of their mean is ((a - b) / 2)².
        assert_eq!(pixel.mean(), [2.0, 2.0, 6.0]);
        assert_eq!(pixel.variance_of_mean(), [1.0, 0.0, 4.0]);
    }

    #[test]
    fn negative_weights_are_subtracted() {
        let sample = |x: f32, weight: f32| Pixel::weighted([x; 3], weight);
        let pixel = sample(2.0, 1.0) + sample(3.0, 1.0) + sample(1.0, -1.0);
        assert_eq!((pixel.n_samples, pixel.n_negative, pixel.mean()), (3, 1, [4.0; 3]));
        assert_eq!(sample(2.0, -1.0).mean(), [2.0; 3]);
        // The sum of the weights is zero.
        assert_eq!((sample(2.0, -1.0) + sample(2.0, 1.0)).mean(), [0.0; 3]);
        let lost = sample(f32::NAN, -1.0);
        assert_eq!((lost.n_samples, lost.n_negative, lost.n_dropped), (0, 0, 1));
        // Equal samples vary by their weights.
        assert!((sample(1.0, 1.0) + sample(1.0, 1.0) + sample(1.0, -1.0)).squared_error() > 0.0);
    }

    #[test]
    fn sums_made_elsewhere_stay_what_they_are() {
        let mut dyadic = Dyadic::default();
        dyadic.push_sum(0..4, 1.0);
        dyadic.push_sum(4..8, 2.0);
        assert_eq!((dyadic.total(), dyadic.values().count()), (3.0, 1));
        let mut all = Dyadic::default();
        all.push_sum(0..100, 5.0);
        assert_eq!((all.total(), all.values().count()), (5.0, 1));
    }

    #[test]
    fn no_sum_is_a_negative_zero() {
        for (x, weight) in [(0.0, 1.0), (0.0, -1.0), (-0.0, 1.0), (-0.0, -1.0)] {
            assert!(Pixel::weighted([x; 3], weight).sum.iter().all(|x| x.is_sign_positive()));
            let components = Components::weighted([[x; 3]; 3], Some([[x; 3]; 4]), weight);
            assert!(components.numbers().all(f64::is_sign_positive));
        }
    }

    #[test]
    fn parts_that_are_not_finite_count_as_zero() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut parts = [[1.0; 3]; 4];
            parts[3][1] = bad;
            let Components { sums, first } = Components::weighted([[2.0; 3]; 3], Some(parts), -1.0);
            assert_eq!((sums, first), ([[-2.0; 3]; 3], Some([[0.0; 3]; 4])));
            assert_eq!(Components::weighted([parts[0], parts[1], parts[3]], None, 1.0).sums, [[0.0; 3]; 3]);
        }
    }

    #[test]
    fn the_error_of_gray_samples_is_that_of_their_luminance() {
        let pixel = Pixel::of([0.5; 3]) + Pixel::of([1.5; 3]);
        // Mean 1, standard error 1/2; the luminance weights sum to one but for rounding.
        assert!((pixel.squared_error() - 0.25 / (1.0 + REL_MSE_FLOOR)).abs() < 1e-15);
        let black = Pixel::of([0.0; 3]) + Pixel::of([0.0; 3]);
        assert_eq!(black.squared_error(), 0.0);
        assert_eq!(Pixel::of([0.5; 3]).squared_error(), f64::INFINITY, "one sample has no estimate");
    }

    #[test]
    fn long_sums_keep_growing() {
        // An f32 sum of ones stops at 2^24.
        let start = Pixel { sum: [16_777_216.0; 3], n_samples: 16_777_216, ..Pixel::default() };
        let pixel = (0..1000).fold(start, |pixel, _| pixel + Pixel::of([1.0; 3]));
        assert_eq!(pixel.sum, [16_778_216.0; 3]);
        assert_eq!(pixel.mean(), [1.0; 3]);
    }

    #[test]
    fn samples_that_are_not_finite_are_counted_and_dropped() {
        let mut pixel = Pixel::of([0.5; 3]);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            pixel = pixel + Pixel::of([0.25, bad, 0.25]);
        }
        assert_eq!((pixel.n_samples, pixel.n_dropped, pixel.n_taken()), (1, 3, 4));
        assert_eq!(pixel.mean(), [0.5; 3]);
    }

    #[test]
    fn addition_keeps_the_first_hit() {
        let miss = Guide { tests: [4.0, 1.0], ..Guide::default() };
        let hit = |id: u32, x: f64| Guide::from_sums(1, Some([id, id + 1]), std::array::from_fn(|k| x + k as f64));
        let sum = miss + hit(5, 0.0) + hit(7, 100.0);
        assert_eq!((sum.n_hits, sum.first, sum.depth), (2, Some([5, 6]), 100.0));
        assert_eq!([sum.normal, sum.shading_normal], [[102.0, 104.0, 106.0], [108.0, 110.0, 112.0]]);
        assert_eq!((sum.albedo, sum.tests), ([114.0, 116.0, 118.0], [124.0, 123.0]));
    }

    #[test]
    fn components_are_weighted_as_their_pixel() {
        let parts = [[1.0, 0.0, 8.0], [0.0, 2.0, 8.0], [4.0, 0.5, 0.25]];
        let at_first = Some([[4.0; 3], [3.0; 3], [2.0; 3], [0.0; 3]]);
        let sample =
            |weight: f32| (Pixel::weighted([5.0, 2.5, 16.25], weight), Components::weighted(parts, at_first, weight));
        let ((first, of_first), (second, of_second)) = (sample(1.0), sample(-1.0));
        for (pixel, components) in
            [(first, of_first), (second, of_second), (first + first + second, of_first + of_first + of_second)]
        {
            let [emission, direct, indirect] = components.sums;
            // Sums of few bits are exact.
            assert_eq!(std::array::from_fn(|k| emission[k] + direct[k] + indirect[k]), pixel.sum);
            assert_eq!(components.first.map(|[diffuse, ..]| diffuse), Some([4.0 * pixel.weight(); 3]));
        }
        // A dropped sample has none.
        assert_eq!((of_first + Components::default()).first, of_first.first);
    }

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

    /// Two pixels with sums of powers of three, which depend on the order.
    fn part(range: Range<u32>) -> Part {
        let mut pixels = Vec::new();
        for pixel in 0..2 {
            let mut sums = Dyadic::default();
            for sample in range.clone() {
                sums.push_sample(
                    sample,
                    Pixel::of([0.1, 0.7, 3.0_f32.powi(i32::try_from(sample).unwrap_or(0) + pixel)]),
                );
            }
            pixels.extend(sums.values());
        }
        Part::new(range, pixels, Vec::new(), Vec::new())
    }

    #[test]
    fn parts_join_in_any_order() {
        let whole = part(0..20);
        assert_eq!(Part::join(vec![part(0..20)]).unwrap(), whole);
        assert_eq!(Part::join(vec![part(5..20), part(0..5)]).unwrap(), whole);
        assert_eq!(Part::join(vec![part(13..20), part(0..5), part(5..13)]).unwrap(), whole);
        let end = Part::join(vec![part(13..20), part(5..13)]).unwrap();
        assert_eq!(end, part(5..20));
        assert_eq!(Part::join(vec![end, part(0..5)]).unwrap(), whole);
    }

    #[test]
    fn gaps_and_overlaps_are_rejected() {
        assert_eq!(Part::join(Vec::new()), Err(JoinError::Empty));
        let error = Part::join(vec![part(4..9), part(0..5)]).unwrap_err();
        assert_eq!(error.to_string(), "samples 0..5 and 4..9 overlap");
        let error = Part::join(vec![part(0..5), part(0..5)]).unwrap_err();
        assert_eq!(error.to_string(), "samples 0..5 and 0..5 overlap");
        let error = Part::join(vec![part(7..9), part(0..5)]).unwrap_err();
        assert_eq!(error.to_string(), "samples 5..7 between 0..5 and 7..9 are missing");
    }
}
