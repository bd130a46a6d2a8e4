//! Rays through nodes and leaves.
//!
//! ```text
//! ScaledRay -> RayLanes -> node (aligned, oriented) -> entries and mask -> walk -> leaves
//! ```
//!
//! # No lost hit
//! The promise is that of `canted_trace`'s boxes. Let u = 2^-24.
//!
//! *Where coordinates start.* Boxes are relative to a reference point of the BVH, near its primitives, and so is the origin of a ray before it is
//! tested against boxes; leaves test the ray and the primitives as they were given. By the proof at [`canted_trace::ReferencePoint`], what is
//! proven for moved rays, primitives and an ERROR that is larger by u holds for them as they were given. So all that follows is about
//! moved coordinates. It does not matter for the proof which point that is: a build and a refit take one that makes pads small. Primitives
//! whose hits have errors relative to the origin of their space ([`Primitive::IS_LOCAL`](crate::Primitive::IS_LOCAL)) keep that.
//!
//! For a box around a subtree, let ρ∞ be the greatest coordinate of
//! the bounds of the primitives *in this subtree*, its reach, and `S = |o|∞ + ρ∞`. A hit that is reported at `t` lies within
//! `e = ERROR·S`, in each coordinate, of a point `x` of its primitive, so `t·|d|∞ <= S + e`. ERROR is that of the triangle test,
//! 7 u for the watertight one, which needs 6.1, otherwise `HIT_ERROR`, and u for moved coordinates; other primitives state an error of
//! their own, at most 1/8. Each box test enters a box around the primitive, at an entry of at most `t`.
//!
//! *Who carries the padding.* A pad is `c·S` for a constant `c`, so it is split: the build and every refit move the planes of a
//! box outward by `c·ρ∞` ([`BoxPads`]), rounded outward, and the ray adds `c·|o|∞` ([`Pads`]). The padding of a box thus depends
//! on its own content and the ray alone; what is elsewhere in the mesh does not matter, and rays pay nothing for it.
//!
//! *What boxes contain.* Before they are padded, `lo_k <= row_k·x <= hi_k` in real arithmetic for the rows of every box around
//! the primitive, as stored. Of triangles `x` is a convex combination of vertices, whose projections `Slabs` rounds outward.
//! Of other primitives `x` is the point that `ERROR` names: `bounds` and `extent_along` contain it by contract, and so does
//! the intersection of both intervals, which is what boxes are made of. Joins, and the center and half-extent of an
//! interval, are rounded outward. As the interval of the bounds is one of the two, no plane exceeds `√3·ρ∞` but for second
//! order, whatever `extent_along` returns, and no padded plane `(√3 + c)·ρ∞`; this bounds `|c|` and `|lo|` below.
//!
//! *Second order.* Displacements below are sums of terms `u·x` with `x` one of `|lo|`, `|o⁺|`, `t·d`, `h'`. Each exceeds its share of S
//! by at most `(c + u)·S`: `|lo|` and `h'` by the padding of the box, `|o⁺|` by that of the ray, `t·d` by `e <= c·S`. With c - ERROR of
//! at most 25 u and ERROR <= 1/8 that is at most `4.02 u·S/8` and terms of u² for aligned nodes, and `u·S/8` for moved coordinates, times
//! √3 where rows are not those of the identity: within what every pad has to spare, 0.98 u·S for aligned nodes of the identity frame and
//! more than 1.9·√3 u·S for others. So is the rounding of `c·|o|∞` in f32, and that of a
//! padded plane in f64.
//!
//! *Aligned nodes, identity frame.* A plane is crossed at `fl(lo·r + c)` with `r = fl(1/d)`, `c = fl(-o⁺·r)`, `o⁺ = fl(o + δ)`,
//! `lo` the padded plane. Let `d > 0`; then it is `(1/d)·(lo·(1 + η) - o⁺ - η'·o⁺)` times `1 + 2.01·η''`, with |η| <= u, and η only
//! where the product is rounded before the sum. The unpadded plane is at most `o + t·d + e`, so it is at most `t` if both parts
//! of the padding together are at least `e + u·|lo| + u·|o⁺| + u·|o⁺| + 2.01 u·t·d`, where the third term is the rounding of o⁺; all
//! are at most S but for second order, and where `|o⁺|` counts twice, `|lo| + 2·|o⁺| + 2.01·t·d <= 5.02·S`: [`Pads::aligned`] has 6 u.
//! The clamped direction moves the point by 2^-62·S. The upper plane is crossed later than `t` by the same argument, with
//! `o⁻ = fl(o - δ)`; negative `d` exchanges the planes.
//!
//! *Aligned nodes, rotated frame.* Origin and direction are rotated in f64 and rounded once, so along a row, of absolute sum
//! at most √3, the ray at `t` is off by `√3·(u·|o|∞ + u·t·|d|∞) <= √3·2.01 u·S`; all else as before with √3·S for S:
//! [`Pads::rotated`].
//!
//! *Oriented nodes.* `p = fl(row·o - c)` and `d' = fl(row·d)`: at most four roundings touch a term of `p`, three one of
//! `d'`, so the projected ray is off by `√3·7.02 u·S` at `t`, for `|c| <= √3·ρ∞`. With `a = fl(1/|d'|)` and `q = ±p`
//! the near plane is `fl(-h'·a - fl(q·a))`, `h' = fl(h + c·|o|∞)`, `h` the padded half-extent. By the same steps it is at most
//! `t` if both parts of the padding together exceed that displacement, `√3·e`, and
//! `u·|p| + u·h' + u·h' + 2.01 u·t·|d'|`, where the second `u·h'` is for a product rounded before its sum: in all
//! `√3·(ERROR + 12.1 u)·S`, [`Pads::oriented`] has 14 u. The sign of `d'` does not matter, even if rounding has changed it: only
//! the point at `t` enters.
//!
//! *Absolute errors.* A caller's `error` in units of the space ([`Pads::within`]) is carried by the ray; the boxes' part, for an
//! ERROR of at least 0, covers the roundings relative to ρ∞. Where it is a multiple of `|o|∞`, its sum with the ray's part is one relative pad
//! ([`Pads::of_origin`]).
//!
//! Underflow loses a few 2^-149 in position; the smallest normal number is added to every pad of a ray. Coordinates up to
//! 2^62, reference points up to 2^60 and reciprocals up to 2^64 keep every number finite: moved coordinates stay below 1.25·2^62, their
//! differences below 2^64, and their products below 2^128.

mod balls;
mod block;
mod bundle;
mod eight;
mod group;
mod hulls;
mod near;
mod ray;
mod reach;
mod walk;

pub(crate) use balls::numbers_of_ball;
pub(crate) use block::{Block, Blocks, RayTriangles, SHRINK, ThroughTriangles, prefetch_block};
pub(crate) use bundle::Bundle;
pub(crate) use eight::{EightRays, OneOfEight, for_each_of_eight};
pub use eight::{Prepared, PreparedRays};
pub(crate) use group::{BLOCK, ENTRY, GROUP, GroupLeaves, OVERHEAD, RayGroup};
pub(crate) use hulls::numbers;
pub(crate) use ray::{BoxPads, MeshFrame, Pads, RayLanes, RayNumbers, ThroughNodes, TracedRay};
pub(crate) use reach::{RayLine, Reached, VisitLane};
pub(crate) use walk::LeafRange;
pub(crate) use walk::{Visitor, walk};
