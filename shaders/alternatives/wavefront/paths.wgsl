// Paths that wait for their rays, between kernels: each has the place of its sample, by work-group and pixel.
// use shared/path

@group(1) @binding(5) var<storage, read_write> paths: array<Path>;
/// Places of the paths that are on their way, and how many they are.
@group(1) @binding(6) var<storage, read> active_paths: array<u32>;
@group(1) @binding(7) var<storage, read> n_active: array<u32>;
/// What their rays met, in the same order.
@group(1) @binding(8) var<storage, read_write> hits: array<Hit>;
