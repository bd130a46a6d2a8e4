//! The GPU's kernels in WGSL, and what can be known of them without a device.
//!
//! One kernel a file, in folders named as the CPU's stations; what several share lies in `shared/`. A kernel's entry point is
//! `main`; a file with a vertex and a fragment stage has `vertex` and `fragment`. Nothing here names a device: [`Shader`] is text,
//! and the facts that a caller binds buffers and chooses work-groups by, read by `naga` from the text as it will be compiled.
//!
//! ```text
//! files -> source (parts, choices, constants) -> Shader (entries, bindings, work-group, layouts)
//! ```
//!
//! Parts that kernels share bind in groups of their own, so that any of them go together: 0 is what rays are traced through, 1
//! the picture and its samples, 2 the surfaces, 3 the lights. A kernel without them numbers as it likes.
#![forbid(unsafe_code)]

mod error;
mod files;
mod lint;
mod reflection;
mod source;

pub use error::ShaderError;
pub use files::{FILES, kernels};
pub use lint::complaints;
pub use reflection::{Binding, BindingKind, Entry, Layout, MAX_STORAGE_BUFFERS, Shader, Stage};
pub use source::{Specialisation, assemble};
