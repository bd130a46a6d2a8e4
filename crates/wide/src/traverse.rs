//! Rays through nodes and leaves.
//!
//! ```text
//! ScaledRay -> RayLanes -> node (aligned, oriented) -> entries and mask -> walk -> leaves
//! ```
//!
//! # No lost hit
//! The promise is that of `canted_trace`'s boxes. Let u = 2^-24, and `S = |o|∞ + ρ∞` with ρ∞ the greatest coordinate of any
//! primitive's bounds. A hit that is reported at `t` lies within `e = ERROR·S`, in each coordinate, of a point `x` of its
//! primitive, so `t·|d|∞ <= S + e`. ERROR is that of the triangle test, 7 u for the watertight one, which needs 6.1, otherwise
//! `HIT_ERROR`; other primitives state an error of their own, at most 1/8: what it adds in second order, `4.02 u·e`, is
//! within the slack below. Each box test enters a box around the primitive, at an entry of at most `t`. Pads are added to the
//! ray, so they grow with far origins.
//!
//! *What boxes contain.* For the rows of every box around the primitive, `lo_k <= row_k·x <= hi_k` in real arithmetic, for
//! the rows as stored. Of triangles `x` is a convex combination of vertices, whose projections `Slabs` rounds outward. Of
//! other primitives `x` is the point that `ERROR` names: `bounds` and `extent_along` contain it by contract, and so does
//! the intersection of both intervals, which is what boxes are made of. Joins, and the center and half-extent of an
//! interval, are rounded outward. As the interval of the bounds is one of the two, no stored plane exceeds `√3·ρ∞` but for
//! second order, whatever `extent_along` returns; this bounds `|c|` and `|lo|` below.
//!
//! *Aligned nodes, identity frame.* A plane is crossed at `fl(lo·r + c)` with `r = fl(1/d)`, `c = fl(-o⁺·r)`, `o⁺ = fl(o + δ)`.
//! Let `d > 0`; then it is `(1/d)·(lo·(1 + η) - o⁺ - η'·o⁺)` times `1 + 2.01·η''`, with |η| <= u, and η only where the
//! product is rounded before the sum. As `lo <= o + t·d + e`, it is at most `t` if
//! `δ >= e + u·|lo| + u·|o⁺| + u·|o⁺| + 2.01 u·t·d`, where the third term is the rounding of o⁺; all are at most S but
//! for second order: [`Pads::aligned`] has 6 u where 5.02 are needed. The clamped direction moves the point by 2^-62·S. The
//! upper plane is crossed later than `t` by the same argument, with `o⁻ = fl(o - δ)`; negative `d` exchanges the planes.
//!
//! *Aligned nodes, rotated frame.* Origin and direction are rotated in f64 and rounded once, so along a row, of absolute sum
//! at most √3, the ray at `t` is off by `√3·(u·|o|∞ + u·t·|d|∞) <= √3·2.01 u·S`; all else as before with √3·S for S:
//! [`Pads::rotated`].
//!
//! *Oriented nodes.* `p = fl(row·o - c)` and `d' = fl(row·d)`: at most four roundings touch a term of `p`, three one of
//! `d'`, so the projected ray is off by `√3·7.02 u·S` at `t`, for `|c| <= √3·ρ∞`. With `a = fl(1/|d'|)` and `q = ±p`
//! the near plane is `fl(-h'·a - fl(q·a))`, `h' = fl(h + pad)`. By the same steps it is at most `t` if the pad exceeds
//! that displacement, `√3·e`, and `u·|p| + u·h' + u·h' + 2.01 u·t·|d'|`, where the second `u·h'` is for a product
//! rounded before its sum: in all `√3·(ERROR + 12.1 u)·S`, [`Pads::oriented`] has 14 u. The sign of `d'` does not matter,
//! even if rounding has changed it: only the point at `t` enters.
//!
//! Underflow loses a few 2^-149 in position; the smallest normal number is added to every pad. Coordinates up to 2^62
//! and reciprocals up to 2^64 keep every number finite.

mod block;
mod eight;
mod node;
mod ray;
mod stack;
mod walk;

pub use block::LaneKernel;
pub(crate) use block::{Block, RayTriangles};
pub(crate) use eight::EightRays;
pub(crate) use ray::{MeshFrame, Pads, RayLanes, RayNumbers, TracedRay};
pub(crate) use stack::Stack;
pub(crate) use walk::{Visitor, walk};
