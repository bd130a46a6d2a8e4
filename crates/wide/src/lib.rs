//! Eight-wide bounding volume hierarchies whose boxes may lean.


mod build;
mod collapse;
mod costs;
mod emit;
mod frames;
mod layout;
mod par;
mod simd;
mod traverse;
mod wide;

pub use build::Config;
pub use costs::Costs;
pub use layout::NodeKind;
pub use simd::SimdPath;
pub use traverse::LaneKernel;
pub use wide::{Sizes, Wide};
