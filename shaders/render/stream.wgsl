// Pictures as streams of rays: kernels that only trace answer the rays of many samples, and these kernels start, shade and keep the samples.
//
// ```text
// start -> rays -> trace/certain_closest, ... -> shade -> rays, shadow rays -> ...      for as many rounds as a sample may need
//                                                      -> rest, of those that need more
// ```
//
// `?integrator` says what a sample does with the answers to its rays. A shadow ray and the onward ray of the same surface are traced at the same time; light is
// added in the order of `render/path` and `render/hybrid`, so a sample has the same bits. Samples that go on, rays and shadow rays are lists of indices:
// a dispatch has invocations for those alone. The states lie in the order of samples. A sample is kept when it is done; until then it is one that
// no kernel finished. Its light in parts is added up where it is kept.
// use shared/invocation/index
// use shared/invocation/incomplete
// use shared/ray
// use ?integrator
// use shared/camera/film

/// By work-group and invocation of `start`.
@group(1) @binding(6) var<storage, read_write> states: array<State>;

/// The stage of a sample with a ray that no kernel decided; the host takes it.
const CUT: u32 = 3u;

/// Keeps a sample if it is done; its light in parts is there.
fn keep_done(state: State, one: PixelSample, index: u32) {
    if state.stage == DONE {
        keep(index / 64u, index % 64u, one, state.radiance, state.n_rays);
        if is_dropped(state.radiance) {
            clear_parts();
        }
    }
}

// choice integrator/path
// Path tracing.
// use shared/path

alias State = Path;

fn state_from(start: CameraRay) -> State {
    return path_from(start);
}

fn start_parts(index: u32) {
    start_components(index);
}

/// Continues with the light in parts that is kept of a sample.
fn resume_parts(index: u32) {
    resume_components(index);
}

/// Makes it zero.
fn clear_parts() {
    clear_components();
}

/// Whether a surface scattered the onward ray.
fn has_scattered(state: State) -> bool {
    return state.n_scattered > 0u;
}

// choice integrator/hybrid
// The hybrid integrator.
// use shared/hybrid

alias State = Gathering;

fn state_from(start: CameraRay) -> State {
    return gathering_from(start);
}

fn start_parts(index: u32) {
    start_components(index);
    start_first_light(index);
}

/// Continues with the light in parts that is kept of a sample.
fn resume_parts(index: u32) {
    resume_components(index);
    resume_first_light(index);
}

/// Makes it zero.
fn clear_parts() {
    clear_components();
    clear_first_light();
}

/// Whether a surface scattered the onward ray.
fn has_scattered(state: State) -> bool {
    return state.n_vertices > 0u;
}

// part queues
// What the next dispatches take: lists in the layout of `shared/undecided`.

struct Queue {
    /// Work-groups of 64 for the listed ones: the arguments of an indirect dispatch.
    x: atomic<u32>,
    y: u32,
    z: u32,
    /// Number of the listed ones.
    n: atomic<u32>,
    /// Indices of samples.
    listed: array<u32>,
}

@group(1) @binding(7) var<storage, read_write> onward_rays: array<Ray>;
@group(1) @binding(8) var<storage, read_write> shadow_rays: array<Ray>;
/// Samples to shade next, samples with an onward ray, and samples with a shadow ray.
@group(1) @binding(14) var<storage, read_write> next_samples: Queue;
@group(1) @binding(15) var<storage, read_write> onward_queue: Queue;
@group(1) @binding(16) var<storage, read_write> shadow_queue: Queue;

/// How many invocations of the work-group list their samples in each queue, then the first place of each.
var<workgroup> n_of_group: array<atomic<u32>, 3>;
var<workgroup> first_of_group: array<u32, 3>;

/// Lists a sample and its rays. All invocations of a work-group call it; `is_there` is false for one without a sample.
fn send(local: u32, is_there: bool, index: u32, state: State) {
    let is_going_on = is_there && (state.stage == ONWARD || state.stage == TO_LIGHT);
    let has_shadow_ray = is_going_on && state.stage == TO_LIGHT;
    let has_onward_ray = is_going_on && (!has_shadow_ray || any(state.onward_direction != vec3(0.0)));
    var places = vec3<u32>(0u);
    if is_going_on {
        places.x = atomicAdd(&n_of_group[0], 1u);
    }
    if has_onward_ray {
        places.y = atomicAdd(&n_of_group[1], 1u);
        if has_shadow_ray {
            onward_rays[index] = infinite_ray(state.onward_origin, state.onward_direction);
        } else {
            onward_rays[index] = state.ray;
        }
    }
    if has_shadow_ray {
        places.z = atomicAdd(&n_of_group[2], 1u);
        shadow_rays[index] = state.ray;
    }
    workgroupBarrier();
    if local < 3u {
        first_of_group[local] = reserved(local, atomicLoad(&n_of_group[local]));
    }
    workgroupBarrier();
    if is_going_on {
        next_samples.listed[first_of_group[0] + places.x] = index;
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
            let first = atomicAdd(&next_samples.n, n);
            atomicAdd(&next_samples.x, groups_between(first, n));
            next_samples.y = 1u;
            next_samples.z = 1u;
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

// part listed
// The samples that a dispatch takes.

/// As `Queue`.
struct Listed {
    x: u32,
    y: u32,
    z: u32,
    n: u32,
    indices: array<u32>,
}

@group(1) @binding(11) var<storage, read> listed: Listed;

// part start
// Starts each sample of the dispatch at the camera.
// use render/stream/queues

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    let one = taken(group, id.local);
    let index = 64u * group + id.local;
    var state: State;
    if one.is_inside {
        state = state_from(camera_ray(one));
        states[index] = state;
        is_incomplete = true;
        keep(group, id.local, one, vec3(0.0), 0u);
        start_parts(index);
    }
    send(id.local, one.is_inside, index, state);
}

// part shade
// Advances the listed samples by the answers to their rays.
// use render/stream/queues
// use render/stream/listed
// use ?time

@group(1) @binding(9) var<storage, read> hits: array<Hit>;
/// 1 for shadow rays that hit something, 0 for others, INCOMPLETE for those that no kernel decided.
@group(1) @binding(10) var<storage, read> found: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    let is_there = entry < listed.n;
    var state: State;
    var index = 0u;
    if is_there {
        index = listed.indices[entry];
        state = states[index];
        let one = taken(index / 64u, index % 64u);
        resume_parts(index);
        advance_by_answers(&state, one, index);
        states[index] = state;
        keep_done(state, one, index);
    }
    send(id.local, is_there, index, state);
}

/// Advances a sample by the answer to its shadow ray, then by that to its onward ray, if they were sent.
fn advance_by_answers(state: ptr<function, State>, one: PixelSample, index: u32) {
    choose_time(one);
    // One call site: compilers inline functions at each call.
    for (var turn = 0u; turn < 2u; turn += 1u) {
        let is_shadow = (*state).stage == TO_LIGHT;
        let is_last = !is_shadow || all((*state).onward_direction == vec3(0.0));
        var hit = hits[index];
        if is_shadow {
            hit = miss();
            hit.instance = select(found[index] - 1u, INCOMPLETE, found[index] == INCOMPLETE);
        }
        if hit.instance == INCOMPLETE {
            (*state).stage = CUT;
            return;
        }
        advance(state, one, hit);
        if is_last || (*state).stage != ONWARD {
            return;
        }
    }
}

// part rest
// The rest of the listed samples: an invocation traces all rays of one, as the kernels of whole samples do. For frames that shall take few dispatches.
// use render/stream/listed
// use shared/facing/scattered
// use shared/hash/ray_key
// use ?traverse
// use ?mask
// use ?time

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= listed.n {
        return;
    }
    let index = listed.indices[entry];
    let one = taken(index / 64u, index % 64u);
    choose_time(one);
    var state = states[index];
    resume_parts(index);
    // The hidden face at which the scattered ray that is traced again ends.
    var hidden = miss();
    ray_sample = one.sample;
    loop {
        ray_key = key_of(state, one);
        let is_scattered = state.stage == ONWARD && has_scattered(state);
        let is_arriving = state.stage == TO_LIGHT || hidden.instance != NONE;
        face_ray(state.ray.direction, is_scattered, is_arriving);
        var hit = traverse(state.ray, is_arriving);
        if is_traced_again(&hit, &hidden, is_scattered) {
            state.n_rays += 1u;
            continue;
        }
        advance(&state, one, hit);
        if state.stage == DONE || is_incomplete {
            break;
        }
    }
    if is_incomplete {
        state.stage = CUT;
    }
    keep_done(state, one, index);
}

// part masked
// Rays of scenes in which not every hit counts: traced exactly, because what a surface lets through needs its textures and the key of the ray.
// `?mask` is which hits count, `?time` the time of rays.
// use render/stream/listed
// use shared/facing
// use shared/hash/ray_key
// use ?traverse
// use ?mask
// use ?time

@group(1) @binding(7) var<storage, read> rays: array<Ray>;

/// Sets what the mask reads for the ray of a sample that is at a stage.
fn prepare(index: u32, stage: u32) -> Ray {
    let one = taken(index / 64u, index % 64u);
    var state = states[index];
    state.stage = stage;
    choose_time(one);
    ray_key = key_of(state, one);
    ray_sample = one.sample;
    return rays[index];
}

// part masked/closest
// The closest hit of each listed onward ray.
// use shared/facing/scattered

@group(1) @binding(9) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= listed.n {
        return;
    }
    let index = listed.indices[entry];
    let ray = prepare(index, ONWARD);
    let is_scattered = has_scattered(states[index]);
    // The hidden face at which a scattered ray that is traced again ends.
    var hidden = miss();
    loop {
        let is_again = hidden.instance != NONE;
        face_ray(ray.direction, is_scattered, is_again);
        var hit = traverse(ray, is_again);
        if is_traced_again(&hit, &hidden, is_scattered) {
            states[index].n_rays += 1u;
            continue;
        }
        if is_incomplete {
            hit.instance = INCOMPLETE;
        }
        hits[index] = hit;
        break;
    }
}

// part masked/occluded
// Whether each listed shadow ray hits anything.

/// 1 for a hit, 0 for a miss, INCOMPLETE if the traversal ended early without a hit.
@group(1) @binding(10) var<storage, read_write> found: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= listed.n {
        return;
    }
    let index = listed.indices[entry];
    let ray = prepare(index, TO_LIGHT);
    face_along(ray.direction, ARRIVING);
    let is_hit = traverse(ray, true).instance != NONE;
    found[index] = select(select(0u, INCOMPLETE, is_incomplete), 1u, is_hit);
}
