//! Eight-wide bounding volume hierarchies whose boxes may lean.

mod frames;
