//! Wide BVHs lose no hit: `t`, `u`, `v` and primitive have the same bits as in a loop over all triangles.
//!
//! Every preset, with and without oriented nodes, in a local frame of the mesh, with nodes of a single kind, on every available
//! SIMD path, with every kernel; rays through vertices and edges, in face planes, axis-parallel, from inside, from up to 10,000
//! mesh sizes away; coordinates of 1e7, scales from 2^-60 to 2^60; instances; trees of any builder and shape. Not covered here:
//! slices, filters, ordered all-hits queries, refit and files (tests of `canted-wide`), pictures (`threads.rs`).

mod wide {
    mod agree;
    mod build;
    mod closed;
    mod exact;
    mod far;
    mod instances;
    mod sabotage;
    mod setup;
    mod topology;
}
