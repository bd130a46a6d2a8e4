// The rays that exact kernels trace.

/// Binding of the list.
struct Undecided {
    /// Work-groups of 64 for the listed ones: the arguments of an indirect dispatch.
    x: atomic<u32>,
    y: u32,
    z: u32,
    /// Number of the listed ones.
    n: atomic<u32>,
    /// Their indices.
    listed: array<u32>,
}

@group(1) @binding(14) var<storage, read_write> undecided: Undecided;

/// Adds a ray.
fn list(index: u32) {
    let entry = atomicAdd(&undecided.n, 1u);
    undecided.listed[entry] = index;
    if (entry & 63u) == 0u {
        atomicAdd(&undecided.x, 1u);
        // One row is enough for as many as a dispatch has.
        undecided.y = 1u;
        undecided.z = 1u;
    }
}

// part found
// What `trace/certain_closest` writes to the buffer of hits, and `trace/certain_weights` replaces by hits.

/// As large as `Hit`: `primitive` and `instance` are final, the first word is the first quad of the triangle.
struct Found {
    at: u32,
    unused_u: u32,
    unused_v: u32,
    primitive: u32,
    instance: u32,
}

@group(1) @binding(1) var<storage, read_write> hits: array<Found>;
