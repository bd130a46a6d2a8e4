//! Rays through instances, compared with a loop over all instances and all triangles.

mod directions;
mod distance;
mod distant;
mod kinds;
mod local;
mod oracle;
mod slices;
