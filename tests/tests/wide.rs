//! Wide trees lose no hit: `t`, `u`, `v` and primitive are those of a loop over all triangles, to the bit.
//!
//! Every preset, with nodes that lean and without, in a frame of the mesh's own, with nodes of one kind only, on every
//! path that this machine has, with every kernel; through vertices and edges, in face planes, along axes, from inside,
//! from up to 10,000 sizes away, at coordinates of 1e7, at scales from 2^-60 to 2^60; instances; trees of any builder
//! and any shape. Not covered here: slices, filters and all hits in order (tests of `canted-wide`), pictures
//! (`threads.rs`), moved vertices and files (tests of `canted-wide`).

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
