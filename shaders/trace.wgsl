// Queries of batches of rays: `?each` is which of the rays a kernel traces.

// part closest
// The closest hit of each ray.
// use ?traverse
// use shared/invocation/index
// use ?each

/// The instance of a hit also encodes a miss and an incomplete traversal.
@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= n_rays() {
        return;
    }
    let index = ray_index(entry);
    if index >= arrayLength(&rays) {
        return;
    }
    var hit = closest_hit(rays[index]);
    if is_incomplete {
        hit.instance = INCOMPLETE;
    }
    hits[index] = hit;
}

// part occluded
// Whether each ray hits anything.
// use ?traverse
// use shared/invocation/index
// use ?each

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// 1 for a hit, 0 for a miss, INCOMPLETE if the traversal ended early without a hit.
@group(1) @binding(1) var<storage, read_write> found: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= n_rays() {
        return;
    }
    let index = ray_index(entry);
    if index >= arrayLength(&rays) {
        return;
    }
    let is_hit = occluded(rays[index]);
    found[index] = select(select(0u, INCOMPLETE, is_incomplete), 1u, is_hit);
}

// part certain_closest
// The triangle that each ray hits first, where f32 decides it, and a list of the other rays. `trace/certain_weights` completes the hits,
// `trace/closest` traces the listed rays.
// use shared/certain
// use shared/undecided/found
// use shared/invocation/index
// use ?each

@group(1) @binding(0) var<storage, read> rays: array<Ray>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= n_rays() {
        return;
    }
    let index = ray_index(entry);
    if index >= arrayLength(&rays) {
        return;
    }
    let is_certain = is_certain_hit(index, false);
    let is_hit = is_certain && best_number != NONE;
    hits[index] = Found(best_at, 0u, 0u, best_number, select(NONE, best_instance, is_hit));
    if !is_certain {
        list(index);
    }
}

// part certain_weights
// `t` and weights of the hits of `trace/certain_closest`, with the bits of the exact kernels. They are apart from the loop, which is shorter so.
// use shared/triangle/records
// use ?weights
// use shared/undecided/found
// use ?level
// use shared/invocation/index
// use ?each

@group(1) @binding(0) var<storage, read> rays: array<Ray>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= n_rays() {
        return;
    }
    let index = ray_index(entry);
    if index >= arrayLength(&rays) || hits[index].instance == NONE {
        return;
    }
    let found = hits[index];
    enter_instance(rays[index], found.instance);
    let hit = placed(completed(index, found));
    let numbers = bitcast<vec3<u32>>(vec3<f32>(hit.t, hit.u, hit.v));
    hits[index] = Found(numbers.x, numbers.y, numbers.z, hit.primitive, hit.instance);
}

// part certain_occluded
// Whether each ray hits anything, where f32 decides it, and a list of the other rays, which `trace/occluded` traces.
// use shared/certain
// use shared/undecided
// use shared/invocation/index
// use ?each

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// 1 for a hit, 0 for a miss.
@group(1) @binding(1) var<storage, read_write> found: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= n_rays() {
        return;
    }
    let index = ray_index(entry);
    if index >= arrayLength(&rays) {
        return;
    }
    let is_certain = is_certain_hit(index, true);
    found[index] = u32(best_number != NONE);
    if !is_certain {
        list(index);
    }
}

// part driver_closest
// The hit that the driver's ray queries find for each ray.
// use shared/driver/queries
// use shared/invocation/index
// use ?each

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= n_rays() {
        return;
    }
    let index = ray_index(entry);
    if index < arrayLength(&rays) {
        hits[index] = driver_closest_hit(rays[index]);
    }
}

// part driver_occluded
// Whether the driver's ray queries find a hit of each ray.
// use shared/driver/queries
// use shared/invocation/index
// use ?each

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// 1 for a hit, 0 for a miss.
@group(1) @binding(1) var<storage, read_write> found: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= n_rays() {
        return;
    }
    let index = ray_index(entry);
    if index < arrayLength(&rays) {
        found[index] = u32(driver_occluded(rays[index]));
    }
}

// choice each/all
// A kernel traces all rays.

fn n_rays() -> u32 {
    return arrayLength(&rays);
}

/// The ray of an entry.
fn ray_index(entry: u32) -> u32 {
    return entry;
}

// choice each/listed
// A kernel traces the rays of a list, such as that of `shared/undecided`.

/// As `Undecided` there.
struct Listed {
    x: u32,
    y: u32,
    z: u32,
    n: u32,
    indices: array<u32>,
}

@group(1) @binding(15) var<storage, read> listed: Listed;

/// A list is as long as its memory, whatever wrote it.
fn n_rays() -> u32 {
    return min(listed.n, arrayLength(&listed.indices));
}

/// The ray of an entry.
fn ray_index(entry: u32) -> u32 {
    return listed.indices[entry];
}
