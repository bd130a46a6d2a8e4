// Path tracing split into three kernels (wavefront): a measured alternative to render/path. `benches/TRIED.md` has the timings.
// Paths are stored between kernels, indexed by work-group and pixel of their sample.
// use shared/path

@group(1) @binding(5) var<storage, read_write> paths: array<Path>;
/// Indices of the active paths, and their number.
@group(1) @binding(6) var<storage, read> active_paths: array<u32>;
@group(1) @binding(7) var<storage, read> n_active: array<u32>;
/// Hits of their rays, in the same order.
@group(1) @binding(8) var<storage, read_write> hits: array<Hit>;

// part queue
// Compacted indices of the paths that continue.

@group(1) @binding(9) var<storage, read_write> next_active: array<u32>;
@group(1) @binding(10) var<storage, read_write> n_next_active: array<atomic<u32>>;

var<workgroup> n_of_group: atomic<u32>;
var<workgroup> first_of_group: u32;

/// Appends `path_index` if `is_active`. Must be called by all invocations of a work-group.
fn enqueue(is_active: bool, path_index: u32, local: u32) {
    var at = 0u;
    if is_active {
        at = atomicAdd(&n_of_group, 1u);
    }
    workgroupBarrier();
    if local == 0u {
        first_of_group = atomicAdd(&n_next_active[0], atomicLoad(&n_of_group));
    }
    workgroupBarrier();
    if is_active {
        next_active[first_of_group + at] = path_index;
    }
}
