//! No lost hit: every BVH returns what a loop over all triangles returns, at any scale and place, for grazing rays and degenerate meshes.

mod degenerate;
mod kinds;
mod structures;
mod watertight;
mod wide;
mod wide_builds;
