//! WGSL kernels for BVH construction, ray tracing and rendering, assembled from parts and checked without a device.
//!
//! ```
//! use canted_shaders::{Shader, Variant};
//!
//! let chosen = Variant::none()
//!     .part("traverse", "shared/traverse/wide")
//!     .part("node_kinds", "shared/bvh/node_kinds/any")
//!     .part("level", "shared/level/single")
//!     .part("mask", "shared/mask/none")
//!     .part("count", "shared/count/none")
//!     .number("STACK_SIZE", 16)
//!     .number("MAX_ITERATIONS", 1 << 18);
//! let shader = Shader::new("trace/closest", &chosen)?;
//! assert_eq!(shader.entry("main").unwrap().workgroup_size, [64, 1, 1]);
//! # Ok::<(), canted_shaders::ShaderError>(())
//! ```
//!
//! Use it to run the kernels on your own device, or to include ray traversal in a kernel. `canted-gpu` does the former.
//!
//! | item | purpose |
//! |---|---|
//! | [`Variant`], [`assemble`] | choose the parts of a kernel; its WGSL text |
//! | [`Shader`] | a validated kernel with bindings, work-group size and structure layouts, read by `naga` |
//! | [`traversal_module`], [`ModuleOptions`] | `closest_hit` and `occluded` for a kernel of your own |
//! | [`lint`] | divergent barriers, storage barriers, operations that may produce NaN or infinity |
//! | [`kernels`], [`FILES`] | names and texts of all files |
//! | [`variants`] | variants of a kernel that have every choice, for checks of all kernels |
//!
//! # Files
//!
//! A kernel is a file with the entry point `main`, or with `vertex` and `fragment`. Folders are named after the CPU's stages.
//! `shared/` holds what kernels have in common; a file there may contain several parts, of which a caller chooses one.
//!
//! Shared parts use fixed bind groups, so that they can be combined: 0 for ray tracing, 1 for the picture and its samples, 2 for
//! surfaces, 3 for lights.
#![forbid(unsafe_code)]

mod error;
mod files;
mod lint;
mod module;
mod reflection;
mod source;
mod variants;

pub use error::ShaderError;
pub use files::{FILES, kernels};
pub use lint::lint;
pub use module::{MODULE_BUFFERS, ModuleOptions, TABLE_BYTES, traversal_module};
pub use reflection::{Binding, BindingKind, Entry, Layout, MAX_STORAGE_BUFFERS, Shader, ShaderStage};
pub use source::{Variant, assemble};
pub use variants::variants;
