//! Hierarchies of leaning boxes on any GPU that `wgpu` reaches: built, traced and rendered through.
//!
//! Stations are dispatches, named as those of the CPU crates: data crosses work-groups between dispatches, or through atomic
//! words that are both data and token. Nothing waits for another work-group and no size of a subgroup is assumed.
//!
//! ```text
//! Choice -> Gpu -> Kernel (a shader, compiled), Buffer (typed words) -> Commands (dispatches in order) -> read back
//! ```
//!
//! Without an adapter [`Gpu::open`] is an error, never a panic; a software driver is an adapter like others, and says so.
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
pub use canted_shaders::Specialisation;
pub use commands::{AsBinding, Commands, NamedBinding, PassTime};
pub use device::Gpu;
pub use error::GpuError;
pub use kernel::Kernel;
pub use loop_check::loop_iterations;
pub use raster::{Draw, N_TARGETS, RasterOutput, RasterPipeline};
pub use trace::{
    DeviceHit, DeviceRay, HIT_ERROR, MAX_CONDITION, MAX_COORDINATE, MotionPolynomials, Outcome, TracedScene, Traversal,
};
pub use wgpu::Limits;
