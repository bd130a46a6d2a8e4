// Path tracer as streams of rays: kernels that only trace answer the rays of many paths, and these kernels start, shade and end the paths.
//
// ```text
// start -> rays -> trace/certain_closest, ... -> shade -> rays, shadow rays -> ...      bounces + 2 times
//                                                      -> finish, of all paths at once
// ```
//
// A vertex sends its shadow ray and its onward ray at the same time. Light is added in the order of `render/path`, so a sample has the same bits. Paths that go
// on, rays and shadow rays are lists of indices of paths: a dispatch has invocations for those alone. What paths keep is sorted by sample, so `finish` sums
// as `render/path` does.
// use shared/invocation/index
// use shared/path
// use shared/ray

/// By work-group and invocation of `start`.
@group(1) @binding(6) var<storage, read_write> paths: array<Path>;

/// A path whose ray no kernel decided; the host takes its sample.
const CUT: u32 = 3u;

// part queues
// What the next dispatches take: lists in the layout of `shared/undecided`.

struct Queue {
    /// Work-groups of 64 for the listed ones: the arguments of an indirect dispatch.
    x: atomic<u32>,
    y: u32,
    z: u32,
    /// Number of the listed ones.
    n: atomic<u32>,
    /// Indices of paths.
    listed: array<u32>,
}

@group(1) @binding(7) var<storage, read_write> onward_rays: array<Ray>;
@group(1) @binding(8) var<storage, read_write> shadow_rays: array<Ray>;
/// Paths to shade next, paths with an onward ray, and paths with a shadow ray.
@group(1) @binding(14) var<storage, read_write> next_paths: Queue;
@group(1) @binding(15) var<storage, read_write> onward_queue: Queue;
@group(1) @binding(16) var<storage, read_write> shadow_queue: Queue;

/// How many invocations of the work-group list their paths in each queue, then the first place of each.
var<workgroup> n_of_group: array<atomic<u32>, 3>;
var<workgroup> first_of_group: array<u32, 3>;

/// Lists a path and its rays. All invocations of a work-group call it; `is_there` is false for one without a path.
fn send(local: u32, is_there: bool, index: u32, path: Path) {
    let is_going_on = is_there && (path.stage == ONWARD || path.stage == TO_LIGHT);
    let has_shadow_ray = is_going_on && path.stage == TO_LIGHT;
    let has_onward_ray = is_going_on && (!has_shadow_ray || any(path.onward_direction != vec3(0.0)));
    var places = vec3<u32>(0u);
    if is_going_on {
        places.x = atomicAdd(&n_of_group[0], 1u);
    }
    if has_onward_ray {
        places.y = atomicAdd(&n_of_group[1], 1u);
        if has_shadow_ray {
            onward_rays[index] = infinite_ray(path.onward_origin, path.onward_direction);
        } else {
            onward_rays[index] = path.ray;
        }
    }
    if has_shadow_ray {
        places.z = atomicAdd(&n_of_group[2], 1u);
        shadow_rays[index] = path.ray;
    }
    workgroupBarrier();
    if local < 3u {
        first_of_group[local] = reserved(local, atomicLoad(&n_of_group[local]));
    }
    workgroupBarrier();
    if is_going_on {
        next_paths.listed[first_of_group[0] + places.x] = index;
    }
    if has_onward_ray {
        onward_queue.listed[first_of_group[1] + places.y] = index;
    }
    if has_shadow_ray {
        shadow_queue.listed[first_of_group[2] + places.z] = index;
    }
}

/// Reserves `n` places of a queue. Returns the first.
fn reserved(queue: u32, n: u32) -> u32 {
    if n == 0u {
        return 0u;
    }
    switch queue {
        case 0u: {
            let first = atomicAdd(&next_paths.n, n);
            atomicAdd(&next_paths.x, groups_between(first, n));
            next_paths.y = 1u;
            next_paths.z = 1u;
            return first;
        }
        case 1u: {
            let first = atomicAdd(&onward_queue.n, n);
            atomicAdd(&onward_queue.x, groups_between(first, n));
            onward_queue.y = 1u;
            onward_queue.z = 1u;
            return first;
        }
        default: {
            let first = atomicAdd(&shadow_queue.n, n);
            atomicAdd(&shadow_queue.x, groups_between(first, n));
            shadow_queue.y = 1u;
            shadow_queue.z = 1u;
            return first;
        }
    }
}

/// How many work-groups of 64 more it takes for `n` more than `first`.
fn groups_between(first: u32, n: u32) -> u32 {
    return (first + n + 63u) / 64u - (first + 63u) / 64u;
}

// part start
// Starts the path of each sample of the dispatch at the camera.
// use render/stream/queues

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    let one = taken(group, id.local);
    let index = 64u * group + id.local;
    var path: Path;
    if one.is_inside {
        path = path_from(camera_ray(one));
        paths[index] = path;
    }
    send(id.local, one.is_inside, index, path);
}

// part shade
// Advances the listed paths by the answers to their rays.
// use render/stream/queues

/// As `Queue`.
struct Listed {
    x: u32,
    y: u32,
    z: u32,
    n: u32,
    indices: array<u32>,
}

@group(1) @binding(9) var<storage, read> hits: array<Hit>;
/// 1 for shadow rays that hit something, 0 for others, INCOMPLETE for those that no kernel decided.
@group(1) @binding(10) var<storage, read> found: array<u32>;
@group(1) @binding(11) var<storage, read> listed: Listed;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    let is_there = entry < listed.n;
    var path: Path;
    var index = 0u;
    if is_there {
        index = listed.indices[entry];
        path = paths[index];
        advance_by_answers(&path, index);
        paths[index] = path;
    }
    send(id.local, is_there, index, path);
}

fn advance_by_answers(path: ptr<function, Path>, index: u32) {
    if (*path).stage == TO_LIGHT {
        if found[index] == INCOMPLETE {
            (*path).stage = CUT;
            return;
        }
        add_light(path, select((*path).pending, vec3(0.0), found[index] == 1u));
        continue_onward(path);
    }
    if (*path).stage == ONWARD {
        let hit = hits[index];
        if hit.instance == INCOMPLETE {
            (*path).stage = CUT;
            return;
        }
        advance(path, taken(index / 64u, index % 64u), hit);
    }
}

// part finish
// Keeps the light of all paths of the dispatch. `?film` is what is kept.
// use shared/invocation/incomplete
// use ?film

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    let one = taken(group, id.local);
    var radiance = vec3(0.0);
    var n_rays = 0u;
    if one.is_inside {
        let index = 64u * group + id.local;
        radiance = paths[index].radiance;
        n_rays = paths[index].n_rays;
        is_incomplete = paths[index].stage != DONE;
    }
    keep(group, id.local, one, radiance, n_rays);
}
