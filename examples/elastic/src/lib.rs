//! An elastic body that is simulated without a mesh of tetrahedra, and carries a triangle mesh.
//!
//! ```text
//! mesh -> phyxels (lattice) -> grid (Morton codes, sort, hash) -> neighbors -> Body
//! Body -> forces -> leapfrog, floor -> displacements -> Surface -> mesh -> BVH: refit or rebuild -> picture
//! ```
//!
//! The body is a set of points with mass, *phyxels*. Each one fits a displacement gradient to the phyxels within its radius of
//! action by moving least squares, and the stress of that gradient pulls at them. The vertices of the mesh are *surfels*: they
//! follow the phyxels around and exert no force. Source: Müller, Keiser, Nealen, Pauly, Gross and Alexa, "Point based animation of
//! elastic, plastic and melting objects", 2004; departures are stated where they are made.
//!
//! The body does not collide with itself, and neither breaks nor flows.
//!
//! Units are meters, kilograms and seconds; y is up. All arithmetic of the simulation is `f64`, on all threads, and each
//! phyxel adds its forces in the same order, so that a sequence has the same bits on every run.
//!
//! ```
//! use elastic::{Body, Material};
//!
//! let corners: Vec<[f32; 3]> = (0..27_u8).map(|i| [i % 3, i / 3 % 3, i / 9].map(|k| 0.1 * f32::from(k))).collect();
//! let mut body = Body::new(&corners, 0.001, &Material::RUBBER)?;
//! let step = 0.5 * body.stable_step();
//! for _ in 0..10 {
//!     body.step(step, [0.0, -9.81, 0.0], None)?;
//! }
//! assert!((body.momentum()[1] + 9.81 * 10.0 * step * body.mass()).abs() < 1e-12, "it falls freely");
//! # Ok::<(), elastic::BodyError>(())
//! ```
#![forbid(unsafe_code)]

mod body;
mod neighbors;
mod simulation;

pub use body::{Body, BodyError, Floor, Material};
pub use neighbors::Grid;
pub use simulation::{Simulation, Surface, TriangleMesh, lattice_inside, normals, torus};
