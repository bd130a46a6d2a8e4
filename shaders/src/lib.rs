//! WGSL kernels for BVH construction, ray tracing and rendering, assembled from parts and checked without a device.
//!
//! ```
//! use canted_shaders::choice::{Count, Each, Level, Mask, NodeKinds, Traverse};
//! use canted_shaders::{Number, Shader, Variant, wgsl};
//!
//! let chosen = Variant::none()
//!     .with(Traverse::Wide)
//!     .with(NodeKinds::Any)
//!     .with(Level::Single)
//!     .with(Mask::None)
//!     .with(Count::None)
//!     .with(Each::All)
//!     .number(Number::StackSize, 16)
//!     .number(Number::MaxIterations, 1 << 18);
//! let shader = Shader::new(wgsl::trace::CLOSEST, &chosen)?;
//! assert_eq!(shader.entry("main").unwrap().workgroup_size, [64, 1, 1]);
//! # Ok::<(), canted_shaders::ShaderError>(())
//! ```
//!
//! Use it to run the kernels on your own device, or to include ray traversal in a kernel. `canted-gpu` does the former.
//!
//! | item | purpose |
//! |---|---|
//! | [`wgsl`], [`choice`] | names of kernels as constants; an enum for each slot of kernels |
//! | [`Variant`], [`assemble`] | choose the parts of a kernel; its WGSL text |
//! | [`Shader`] | a validated kernel with bindings, work-group size and structure layouts, read by `naga` |
//! | [`traversal_module`], [`driver_module`], [`ModuleOptions`] | `closest_hit` and `occluded` for a kernel of your own |
//! | [`lint`] | divergent barriers, storage barriers, operations that may produce NaN or infinity |
//! | [`kernels`], [`FILES`] | names of all kernels; texts of all files |
//! | [`variants`] | variants of a kernel that have every choice, for checks of all kernels |
//!
//! # Files
//!
//! A kernel is a part of a file, or a file, with the entry point `main`, or with `vertex` and `fragment`. Folders are named after the CPU's stages.
//! `shared/` holds what kernels have in common; a file there may contain several parts, of which a caller chooses one. A build script reads the folders and
//! writes [`wgsl`] and [`choice`], and checks that what a file uses is there.
//!
//! Shared parts use fixed bind groups, so that they can be combined: 0 for ray tracing, 1 for the picture and its samples, 2 for
//! surfaces, 3 for lights.
#![forbid(unsafe_code)]

mod error;
mod files;
mod lint;
mod module;
mod reflection;
mod sections;
mod source;
mod variants;

pub use error::ShaderError;
pub use files::{Choice, FILES, Number, Override, ShaderName, choice, kernels, wgsl};
pub use lint::lint;
pub use module::{MODULE_BUFFERS, ModuleOptions, TABLE_BYTES, driver_module, traversal_module};
pub use reflection::{Binding, BindingKind, Entry, Layout, MAX_STORAGE_BUFFERS, Shader, ShaderStage};
pub use source::{Variant, assemble};
pub use variants::variants;
