//! Bodies against bodies: touching pairs, distances, self-intersections and casts, over the BVHs that rays are traced with.
//!
//! ```
//! use canted_collide::{Pose, distance, overlaps};
//! use canted_wide::TriangleBvh;
//!
//! let triangle = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
//! let above = Pose::translation([0.0, 0.0, 2.0]);
//! assert!(overlaps(&triangle, Pose::IDENTITY, &triangle, Pose::IDENTITY));
//! assert!(!overlaps(&triangle, Pose::IDENTITY, &triangle, above));
//! let nearest = distance(&triangle, Pose::IDENTITY, &triangle, above, f64::INFINITY).expect("both have triangles");
//! assert_eq!((nearest.distance, nearest.points[1][2]), (2.0, 2.0));
//! # Ok::<(), canted_lbvh::GeometryError>(())
//! ```
//!
//! | item | purpose |
//! | --- | --- |
//! | [`overlaps`], [`pairs`], [`each_pair`] | whether two bodies touch, and which primitives do |
//! | [`distance`], [`closest_pairs`], [`pairs_within`] | how far apart they are, and where |
//! | [`first_pair`], [`count_pairs`] | the lowest pair of touching primitives, and how many there are |
//! | [`instance_pairs`], [`Contacts`], [`closest_instance_pairs`] | which instances of a scene touch, from frame to frame, and which are nearest |
//! | [`touches`], [`touching`], [`first_touching`], [`count_touching`], [`each_touching`] | which primitives of a scene a body or a single shape touches |
//! | [`self_intersections`] | which primitives of one body touch that are not neighbors |
//! | [`cast`], [`cast_at_instances`] | when a body that moves first touches another one, or a scene |
//! | [`cast_sphere`] | when a sphere that moves along a ray first touches a mesh, in closed form |
//! | [`Body`], [`Shape`] | what they are about: a `WideBvh` of triangles, spheres, boxes or your own shapes, or a single shape |
//! | [`Pose`] | where a body is: any affine map |
//!
//! # Guarantees
//! * **No pair is lost, and none invented.** Answers are those of a loop over all pairs of primitives. Boxes of nodes are separated only by gaps that exceed a proven
//!   error bound; whether two triangles touch is decided exactly, of degenerate and coplanar ones too.
//! * **Determinism.** The same input gives the same answer, whatever the BVHs are built with.
//! * **Everything has an answer.** Empty bodies touch nothing and are infinitely far away; degenerate triangles are segments and points.
//!
//! # How it works
//! ```text
//! body, pose -> frame (once) -> pairs of nodes -> gaps of a box and eight boxes -> leaves -> shapes -> touch, closest
//! ```
//! Of two nodes the larger is opened; its eight boxes, aligned or oriented, are compared with the box of the other along the axes of the
//! separating-axis test.
#![forbid(unsafe_code)]

mod body;
mod boxes;
mod cast;
mod closest;
mod pose;
mod query;
mod scene;
mod shape;
mod sweep;
mod touch;
mod walk;

pub use body::Body;
pub use cast::{SphereContact, cast_sphere};
pub use pose::Pose;
pub use query::{
    Distance, PrimitivePair, closest_pairs, count_pairs, distance, each_pair, first_pair, overlaps, pairs,
    pairs_within, self_intersections,
};
pub use scene::{
    ContactChanges, Contacts, InstanceDistance, InstancePair, closest_instance_pairs, count_touching, each_touching,
    first_touching, instance_pairs, touches, touching,
};
pub use shape::{Capsule, Hull, Segment, Shape};
pub use sweep::{Contact, cast, cast_at_instances};
