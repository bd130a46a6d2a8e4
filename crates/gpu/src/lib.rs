//! BVH construction, ray tracing and raster passes on the GPU, through `wgpu`.
//!
//! ```no_run
//! use canted_gpu::{Choice, Gpu, Outcome, TracedScene};
//! use canted_trace::{Ray, Watertight};
//! use canted_wide::{Config, TriangleBvh};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let bvh = TriangleBvh::<Watertight>::build(&positions, &[[0, 1, 2]], &Config::default())?;
//! let gpu = Gpu::open(&Choice::Best)?;
//! let scene = TracedScene::single_level(&gpu, &bvh, &[0])?;
//! let hits = scene.closest_hits(&gpu, &[Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])])?;
//! assert!(matches!(hits[0], Outcome::Complete(Some(hit)) if hit.t == 1.0));
//! # Ok(())
//! # }
//! ```
//!
//! Use it for large batches of rays, or to run kernels of your own over the same buffers. A few thousand rays are faster on the
//! CPU, because each batch is uploaded and read back.
//!
//! | type | purpose |
//! |---|---|
//! | [`Gpu`], [`Choice`] | an open device; which adapter to open |
//! | [`Buffer`], [`Kernel`], [`Commands`] | typed buffers, compiled kernels, dispatches |
//! | [`TracedScene`] | BVHs and instances in device memory, built there or uploaded, for ray batches and for kernels of your own |
//! | [`BufferScene`], [`MeshBuffers`] | a BVH over vertex and index buffers of your own, rebuilt and refitted in your command encoder |
//! | [`BufferBvh`] | which BVH: eight-wide or binary, and its boxes |
//! | [`InstancedScene`], [`InstanceBuffer`] | the same with instances, whose transforms are in a buffer of your own |
//! | [`build`] | BVH construction on the device, stage by stage |
//! | [`RasterPipeline`], [`Draw`] | raster passes into integer targets |
//! | [`Traffic`] | counters of uploaded and downloaded bytes, and of dispatches |
//!
//! # Buffers of a scene
//!
//! [`TracedScene::module`] reads these buffers, and [`TracedScene::bind_group`] binds them. [`TracedScene::buffer`] has the buffers
//! themselves, for programs that read them in other ways. All numbers are 32 bits wide, vectors of four are aligned to 16 bytes.
//!
//! | binding | where | content |
//! |---|---|---|
//! | 0 `nodes` | always | nodes of all BVHs, see below |
//! | 1 `corners` | binary BVHs | nine coordinates per triangle, in the order of the meshes |
//! | 1 `triangle_blocks` | wide BVHs | triangles, four at a time: nine rows of four coordinates, and their four numbers |
//! | 2 `bvhs` | always | a `Bvh` for each BVH, the top level first; in an [`InstancedScene`] the last is empty, for instances that are not placed |
//! | 3 `instances` | two levels | an `Instance` for each |
//! | 3 `first_triangles` | one level over several meshes | the number of the first triangle of each |
//! | 4 `instance_order` | two levels | the instance of each item of the top level |
//! | 5 `motions` | two levels with moving instances | a `Motion` for each of these |
//!
//! | structure | bytes | members and their offsets |
//! |---|---|---|
//! | `Bvh` | 64 | `row_x` 0, `row_y` 16, `row_z` 32, `words` 48 |
//! | `Instance` | 160 | `row_x` 0, `row_y` 16, `row_z` 32, `bvh` 48, `exact_rows` 64 |
//! | `Motion` | 224 | `cofactors` 0, `determinant` 144, `x` 160, `y` 176, `z` 192, `shift` 208 |
//! | `Ray` | 32 | `origin` 0, `t_min` 12, `direction` 16, `t_max` 28 |
//! | `Hit` | 20 | `t` 0, `u` 4, `v` 8, `primitive` 12, `instance` 16 |
//!
//! * `Bvh`: rows of the mesh's frame, whose fourth components are the greatest coordinate, the error of hits per coordinate of the origin,
//!   and the constant error; then the root's word, the first quad of its nodes (0 in binary BVHs), the first triangle or the first quad
//!   of its blocks, and whether the frame is rotated.
//! * `Instance`: rows of the linear part of `object_from_world`, whose fourth components are the world position of the object's origin; the
//!   number of its BVH, and of its motion plus one; the rows of `object_from_world` as `f64`, translations last, lower halves first.
//! * A binary node is two children. A child with an axis-aligned box is 32 bytes: lower ends and word, upper ends and zero. One with an
//!   oriented box is 64 bytes: three times an axis and the half-extent along it, then center and word. A word with the highest bit is a leaf,
//!   whose other bits are the number of its triangle in `corners`, or of its item in the top level; other words are numbers of nodes.
//! * A wide node is rows of eight numbers, one per child: 256 bytes with axis-aligned boxes, 512 with oriented ones. Rows and words are those
//!   of [`RawBvh`](canted_wide::RawBvh).
//! * `0x7fffffff` is the root of an empty BVH.
//!
//! # Guarantees
//!
//! * A ray hits the triangles that the CPU's watertight test hits, and no others: where single precision does not decide, integers
//!   repeat the CPU's arithmetic. In an instance that moves, additional hits lie within [`HIT_ERROR`] of the ray. `t` is rounded, so
//!   the closest of two hits may be the other where they differ by less than the bound.
//! * Morton codes, sort order and topology, by radix or by clustering, are the same integers as on the CPU; equal input gives equal words of
//!   wide nodes; volumes enclose their primitives.
//! * Work-groups exchange data between dispatches, or through atomic words that are both data and flag. No work-group waits for
//!   another, and no subgroup size is assumed.
//! * Without an adapter [`Gpu::open`] returns an error. A software driver counts as an adapter.
//!
//! # In browsers
//!
//! The crate compiles for `wasm32-unknown-unknown` and uses WebGPU there. Nothing may block in a browser, so calls that wait for the
//! device have a form that ends in `_async`: [`Gpu::open_async`], [`TracedScene::build_two_level_async`],
//! [`TracedScene::build_wide_two_level_async`], [`TracedScene::closest_hits_async`], [`Gpu::read_async`]. The form without `_async`
//! returns [`GpuError::Blocking`] there where it would have to wait; what is recorded into an encoder does not. Outside of browsers, the
//! futures are ready when they are polled first, and any executor runs them. Errors of the device arrive with a later call. Stages are
//! not timed. The example `browser` is a page that builds and traces the built-in scene.
//!
//! Tested and measured on the software drivers of Mesa (llvmpipe) and, in a browser, of Chromium (SwiftShader) only; no hardware GPU has
//! been measured yet. Vulkan, Metal and DX12 are enabled in `wgpu`, and WebGPU in browsers. Builds and traversal require eight storage buffers
//! per shader stage, the default limit of `wgpu` and WebGPU (nine for [`Traversal::Bits`] and [`Traversal::Links`] with moving instances). Kernels that render require up to 28
//! ([`canted_shaders::MAX_STORAGE_BUFFERS`]), depending on the scene.
#![forbid(unsafe_code)]

mod adapter;
mod buffer;
pub mod build;
mod commands;
mod device;
#[cfg(test)]
mod docs;
mod draw_batches;
mod error;
mod kept;
mod kernel;
mod loop_check;
mod memory;
#[cfg(not(target_family = "wasm"))]
mod patience;
mod raster;
mod trace;
mod traffic;
mod wait;

pub use adapter::{AdapterInfo, AdapterKind, Choice, adapters, adapters_async};
pub use buffer::Buffer;
pub use build::{DeviceInstance, IndexBuffer, InstanceBuffer, MeshBuffers, NOT_PLACED};
pub use canted_lbvh::{Bits, Strategy};
pub use canted_obb::Affine;
pub use canted_shaders::Specialisation;
pub use commands::{AsBinding, Commands, NamedBinding, PassTime};
pub use device::Gpu;
pub use draw_batches::Draw;
pub use error::GpuError;
pub use kernel::Kernel;
pub use loop_check::{loop_iterations, loop_iterations_async};
pub use raster::{N_TARGETS, RasterOutput, RasterPipeline};
pub use trace::{
    BufferBvh, BufferScene, DeviceHit, DeviceRay, HIT_ERROR, InstancedScene, MAX_CONDITION, MAX_COORDINATE,
    MotionPolynomials, Outcome, TracedScene, Traversal,
};
pub use traffic::Traffic;
pub use wgpu::{self, Limits};
