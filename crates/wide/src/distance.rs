//! Distance and overlap queries over the nodes that rays traverse.
//!
//! ```text
//! point          -> PointLanes -> lower bounds of eight children -> nearest.rs      nearest point, k nearest, signed distance
//! point          -> upward ray -> exact orientation              -> containment.rs  inside of a closed mesh
//! convex, sphere -> eight children                               -> overlap.rs      all primitives that overlap a region
//! ```
//!
//! # No lost primitive
//! A child is skipped only if its lower bound exceeds what is searched for; so a lower bound must not exceed the distance of
//! anything below. Let u = 2^-24, `S = |p|∞ + ρ∞` with ρ∞ the greatest coordinate below, and `R` the rows of a box
//! `lo <= R·x <= hi`. A point `x` in the box and the query point `p` differ by `v` with `|R·v| >= g` per row, `g` the gaps of `R·p`
//! from the interval. So `|v|² >= |g|² / ‖R‖²`, and `‖R‖² <= ‖R·Rᵀ‖∞ <= L² + s` with `L` the greatest length of a row, at most
//! 1 + 2^-22, and `s` the sum of the rows' absolute products: almost orthogonal rows lose almost nothing, and a loaded file
//! with other rows loses time, not primitives.
//!
//! *Gaps.* Aligned nodes in the identity frame take one rounding of `lo - p`, at most u·S. In a rotated mesh frame `R·p` is
//! computed in f64 and rounded once: √3·u·S more. An oriented node computes `row·p - c` with four roundings of terms whose
//! absolute sum is at most 2·√3·S, and subtracts `h` with two more. [`PointLanes`] subtracts pads of 2 u·S, 4 u·S and 16 u·S.
//! *Squares.* Products, sums, `s` and the quotient take fewer than 16 roundings: [`SHRINK`] is 1 - 2^-19.
//! Distances of primitives are computed in f64 and fall short of the true ones by less than 2^-48·S, which the pads cover,
//! too. What underflows makes a bound smaller; what overflows is replaced by the greatest number.

mod containment;
mod nearest;
mod overlap;
mod point;

pub use nearest::{ClosestPoint, NearestPoint};
pub(crate) use point::PointLanes;

use crate::layout::{Word, WordKind};
use crate::traverse::Stack;
