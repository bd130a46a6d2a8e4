//! Eight lanes of `f32` with the instructions of the machine.
//!
//! Traversal is written once over [`Simd`]; a path is a token that proves that its instructions are available. All paths
//! round each operation as IEEE 754 requires, except [`Simd::mul_add`], which may round once or twice: tests of boxes and distances are padded
//! for both, and filters of rays and triangles do not use it. So hits are the same bits on every path.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod path;
mod scalar;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod simd128;

#[cfg(test)]
mod tests;

use canted_trace::F64x4;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
#[cfg(target_arch = "aarch64")]
pub(crate) use neon::Neon;
pub(crate) use path::AvailablePath;
pub use path::{Loops, SimdPath};
pub(crate) use scalar::Scalar;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub(crate) use simd128::Simd128;

/// Work that runs over lanes; see [`Simd::run`].
pub(crate) trait Task {
    /// The result.
    type Output;

    /// Runs it. Must be `#[inline(always)]`, and so must everything it calls with `simd`, otherwise lanes pass through memory.
    fn on<S: Simd>(self, simd: S) -> Self::Output;
}

/// Eight lanes of `f32`, accessed by a token that proves the instructions they need.
///
/// A mask is the low eight bits of a `u32`, lane 0 lowest.
pub(crate) trait Simd: Copy {
    /// Eight lanes.
    type F: Copy;
    /// Instructions for four lanes of `f64`.
    type Four: F64x4;

    /// Runs `task` with the path's instructions enabled.
    fn run<T: Task>(self, task: T) -> T::Output;
    /// Four lanes of `f64`.
    fn four(self) -> Self::Four;
    /// `x` in every lane.
    fn splat(self, x: f32) -> Self::F;
    /// Lanes from memory.
    fn load(self, x: &[f32; 8]) -> Self::F;
    /// Four lanes from memory; the upper ones are finite.
    fn load_half(self, x: &[f32; 4]) -> Self::F;
    /// Lanes to memory.
    fn store(self, a: Self::F) -> [f32; 8];
    /// `a + b`.
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a - b`.
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a · b`.
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a / b`.
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// The square root; NaN where `a` is below zero.
    fn sqrt(self, a: Self::F) -> Self::F;
    /// `a · b + c`, rounded once or twice.
    fn mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// `a · b - c`, rounded once or twice.
    fn mul_sub(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// `-(a · b) - c`, rounded once or twice.
    fn neg_mul_sub(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// The lesser; `b` of equals, and where one is NaN.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// The greater; `b` of equals, and where one is NaN.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    /// The one whose bits are less as signed integers: the lesser of two of which neither is negative nor -0.0, else one that is. Some processors
    /// take a cycle for it where they take four for [`Simd::min`]. A positive NaN is above infinity, a negative one below all numbers.
    fn min_bits(self, a: Self::F, b: Self::F) -> Self::F;
    /// The one whose bits are greater as signed integers: the greater of two that are not both negative or -0.0.
    fn max_bits(self, a: Self::F, b: Self::F) -> Self::F;
    /// `|a|`.
    fn abs(self, a: Self::F) -> Self::F;
    /// `a` with its sign flipped where `b` is negative.
    fn xor_sign(self, a: Self::F, b: Self::F) -> Self::F;
    /// Lanes of `x` where `a < b`, else those of `y`.
    fn pick(self, a: Self::F, b: Self::F, x: Self::F, y: Self::F) -> Self::F;
    /// The power of two at or below `|a|`, where that is normal and finite.
    fn power_of_two(self, a: Self::F) -> Self::F;
    /// Lane `j` of row `i` becomes lane `i` of row `j`.
    fn transpose(self, rows: [Self::F; 8]) -> [Self::F; 8];
    /// Lane `j < 4` of row `i` becomes lane `i` of row `j`.
    fn transpose_half(self, rows: [Self::F; 8]) -> [Self::F; 4];
    /// Mask of `a < b`.
    fn lt(self, a: Self::F, b: Self::F) -> u32;
    /// Mask of `a <= b`.
    fn le(self, a: Self::F, b: Self::F) -> u32;
    /// Brings the line of the cache that holds this memory nearer, where the path has an instruction for it.
    fn prefetch<T>(self, memory: &T);
}
