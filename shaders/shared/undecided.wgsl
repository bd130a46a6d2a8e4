// The rays that the exact kernels trace.

/// Work-groups of 64 for the listed rays: the arguments of an indirect dispatch.
struct Groups {
    x: atomic<u32>,
    y: u32,
    z: u32,
}

/// The number of listed rays, then their indices.
@group(1) @binding(2) var<storage, read_write> undecided: array<atomic<u32>>;
@group(1) @binding(3) var<storage, read_write> listed_groups: Groups;

/// Adds a ray.
fn list(index: u32) {
    let entry = atomicAdd(&undecided[0], 1u);
    atomicStore(&undecided[entry + 1u], index);
    if (entry & 63u) == 0u {
        atomicAdd(&listed_groups.x, 1u);
        // One row is enough for as many rays as a slice has.
        listed_groups.y = 1u;
        listed_groups.z = 1u;
    }
}

// part found
// What `trace/certain_closest` writes to the buffer of hits, and `trace/certain_weights` replaces by hits.

/// As large as `Hit`: `primitive` and `instance` are final, the others are the first word of the triangle, the stride of its rows, and nothing.
struct Found {
    at: u32,
    stride: u32,
    unused: u32,
    primitive: u32,
    instance: u32,
}

@group(1) @binding(1) var<storage, read_write> hits: array<Found>;
