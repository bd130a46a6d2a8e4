//! Hierarchies of leaning boxes on any GPU that `wgpu` reaches: built, traced and rendered through.
//!
//! Stations are dispatches, named as those of the CPU crates: data crosses work-groups between dispatches, or through atomic
//! words that are both data and token. Nothing waits for another work-group and no size of a subgroup is assumed.
//!
//! ```text
//! Choice -> Gpu -> Kernel (a shader, compiled), Buffer (typed words) -> Work (dispatches in order) -> read back
//! ```
//!
//! Without an adapter [`Gpu::open`] is an error, never a panic; a software driver is an adapter like others, and says so.
#![forbid(unsafe_code)]

mod adapter;
mod buffer;
pub mod build;
mod canary;
mod device;
mod error;
mod kernel;
mod memory;
mod pieces;
mod raster;
mod trace;
mod work;

pub use adapter::{AdapterFacts, AdapterKind, Choice, adapters};
pub use buffer::Buffer;
pub use canary::loop_turns;
pub use canted_shaders::Specialisation;
pub use device::Gpu;
pub use error::GpuError;
pub use kernel::Kernel;
pub use raster::{Draw, Drawn, Raster, TARGETS};
pub use trace::{
    Answer, DeviceHit, DeviceRay, HIT_ERROR, MAX_CONDITION, MOST_REACH, MotionPolynomials, TracedScene, Walk,
};
pub use wgpu::Limits;
pub use work::{AsBinding, Bound, PassTime, Work};
