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
//! | [`TracedScene`] | BVHs and instances in device memory, for ray batches and for other kernels |
//! | [`build`] | BVH construction on the device, stage by stage |
//! | [`RasterPipeline`], [`Draw`] | raster passes into integer targets |
//!
//! # Guarantees
//!
//! * Everything that the CPU's watertight test hits is hit here. Additional hits lie within [`HIT_ERROR`] of the ray.
//! * Morton codes, sort order and topology are the same integers as on the CPU; volumes enclose their primitives.
//! * Work-groups exchange data between dispatches, or through atomic words that are both data and flag. No work-group waits for
//!   another, and no subgroup size is assumed.
//! * Without an adapter [`Gpu::open`] returns an error. A software driver counts as an adapter.
//!
//! Tested and measured on Mesa's software driver (llvmpipe) only; no hardware GPU has been measured yet. Vulkan, Metal and DX12
//! are enabled in `wgpu`. Requires up to 28 storage buffers per shader stage
//! ([`canted_shaders::MAX_STORAGE_BUFFERS`]), depending on the scene.
#![forbid(unsafe_code)]

mod adapter;
mod buffer;
pub mod build;
mod commands;
mod device;
mod draw_batches;
mod error;
mod kernel;
mod loop_check;
mod memory;
mod raster;
mod trace;

pub use adapter::{AdapterInfo, AdapterKind, Choice, adapters};
pub use buffer::Buffer;
pub use build::{IndexBuffer, MeshBuffers};
pub use canted_shaders::Specialisation;
pub use commands::{AsBinding, Commands, NamedBinding, PassTime};
pub use device::Gpu;
pub use draw_batches::Draw;
pub use error::GpuError;
pub use kernel::Kernel;
pub use loop_check::loop_iterations;
pub use raster::{N_TARGETS, RasterOutput, RasterPipeline};
pub use trace::{
    BufferScene, DeviceHit, DeviceRay, HIT_ERROR, MAX_CONDITION, MAX_COORDINATE, MotionPolynomials, Outcome,
    TracedScene, Traversal,
};
pub use wgpu::{self, Limits};
