//! No lost hit: every BVH returns what a loop over all triangles returns, at any scale and place, for grazing rays and degenerate meshes.

mod binary;
mod degenerate;
mod exact;
mod kinds;
mod watertight;
mod wide;
mod wide_builds;
