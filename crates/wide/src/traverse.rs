//! Rays through nodes and leaves.
//!
//! ```text
//! ScaledRay -> RayLanes -> node (aligned, oriented) -> entries and mask -> walk -> leaves
//! ```
//!
//! # No lost hit
//! The promise is that of `canted_trace`'s boxes, in their words: u = 2^-24, `S = |o|∞ + ρ∞` with ρ∞ the greatest
//! coordinate of any vertex, and a hit reported at `t` lies within `e = ERROR·S` of its triangle in each
//! coordinate, so `t·|d|∞ <= S + e`. ERROR is the kernel's: 7 u for the watertight one, which needs 6.1, else `HIT_ERROR`.
//! Other primitives state an error of their own in its place, at most S/8: what it
//! adds in second order, `4.02 u·e`, is within the room left below. Each test enters a box around the triangle, at an
//! entry of at most `t`. Pads are added to the ray, so they grow with far origins by themselves; boxes hold their
//! vertices exactly.
//!
//! *Box nodes, identity frame.* A plane is met as `fl(lo·r + c)` with `r = fl(1/d)`, `c = fl(-o⁺·r)`, `o⁺ = fl(o + δ)`.
//! Let `d > 0`; then it is `(1/d)·(lo·(1 + η) - o⁺ - η'·o⁺)` times `1 + 2.01·η''`, with |η| <= u, and η only where the
//! product is rounded before the sum. As `lo <= o + t·d + e`, it is at most `t` if
//! `δ >= e + u·|lo| + u·|o⁺| + u·|o⁺| + 2.01 u·t·d`, where the third term is the rounding of o⁺; all are at most S but
//! for second order: [`Pads::aligned`] has 6 u where 5.02 are needed. The clamped direction moves the point by 2^-62·S. The
//! upper plane is met later than `t` by the same argument, with `o⁻ = fl(o - δ)`; negative `d` exchanges the planes.
//!
//! *Box nodes, turned frame.* Origin and direction are turned in f64 and rounded once, so along a row, of absolute sum
//! at most √3, the ray at `t` is off by `√3·(u·|o|∞ + u·t·|d|∞) <= √3·2.01 u·S`; all else as before with √3·S for S:
//! [`Pads::turned`].
//!
//! *Lean nodes.* `p = fl(row·o - c)` and `d' = fl(row·d)`: at most four roundings touch a term of `p`, three one of
//! `d'`, so the projected ray is off by `√3·7.02 u·S` at `t`, for `|c| <= √3·ρ∞`. With `a = fl(1/|d'|)` and `q = ±p`
//! the near plane is `fl(-h'·a - fl(q·a))`, `h' = fl(h + pad)`. By the same steps it is at most `t` if the pad exceeds
//! that displacement, `√3·e`, and `u·|p| + u·h' + u·h' + 2.01 u·t·|d'|`, where the second `u·h'` is for a product
//! rounded before its sum: in all `√3·(ERROR + 12.1 u)·S`, [`Pads::lean`] has 14 u. It matters not if `d'` has lost
//! its sign: only the place at `t` enters.
//!
//! Underflow loses a few 2^-149 in position; the smallest normal number is added to every pad. Coordinates up to 2^62
//! and reciprocals up to 2^64 keep every number finite.

mod block;
mod node;
mod ray;
mod stack;
mod walk;

pub use block::LaneKernel;
pub(crate) use block::{Block, RayTriangles};
pub(crate) use ray::{MeshFrame, Pads, RayLanes};
pub(crate) use stack::Stack;
pub(crate) use walk::{Visit, walk};
