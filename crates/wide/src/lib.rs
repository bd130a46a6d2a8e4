//! Eight-wide bounding volume hierarchies whose boxes may lean.

mod answers;
mod binary;
mod build;
mod collapse;
mod config;
mod costs;
mod crossings;
mod emit;
mod file;
mod frames;
mod layout;
mod measure;
mod par;
mod primitive;
mod primitive_tree;
mod queries;
mod refit;
mod simd;
mod slices;
mod traced;
mod traverse;
mod triangles;
mod wide;

pub use config::{Config, Preset};
pub use costs::Costs;
pub use file::LoadError;
pub use layout::NodeKind;
pub use primitive::{Primitive, PrimitiveHit};
pub use primitive_tree::{PrimitiveError, PrimitiveTree};
pub use refit::{Flaw, Refit, RefitError};
pub use simd::SimdPath;
pub use traverse::LaneKernel;
pub use wide::{Predicted, Sizes, Wide};
