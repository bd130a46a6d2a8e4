//! Eight-wide bounding volume hierarchies whose boxes may lean.

mod binary;
mod build;
mod collapse;
mod config;
mod costs;
mod emit;
mod frames;
mod layout;
mod measure;
mod par;
mod simd;
mod traverse;
mod wide;

pub use config::{BinaryTree, Config, Preset};
pub use costs::Costs;
pub use layout::NodeKind;
pub use simd::SimdPath;
pub use traverse::LaneKernel;
pub use wide::{Predicted, Sizes, Wide};
