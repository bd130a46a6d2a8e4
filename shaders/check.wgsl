// Functions of other files alone, to compare them with their twins on the CPU.

// part bsdf
// Evaluates and samples the BSDF of one material, to compare with the CPU.
// use shared/invocation/index
// use ?bsdf

struct Query {
    base_color: vec3<f32>,
    metallic: f32,
    roughness: f32,
    specular: f32,
    transmission: f32,
    ior: f32,
    outgoing: vec3<f32>,
    choice: f32,
    incident: vec3<f32>,
    /// 1: thin-walled, 2: inside.
    flags: u32,
    square: vec2<f32>,
}

struct Answer {
    value: vec3<f32>,
    density: f32,
    incident: vec3<f32>,
    sampled_density: f32,
    weight: vec3<f32>,
    /// 1: found, 2: delta, 4: transmitted, 8: only delta lobes.
    flags: u32,
    compression: f32,
}

@group(0) @binding(0) var<storage, read> queries: array<Query>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&answers) {
        return;
    }
    let q = queries[index];
    let bsdf = Bsdf(
        q.base_color, q.metallic, q.roughness, q.specular, q.transmission, q.ior, (q.flags & 1u) != 0u, (q.flags & 2u) != 0u,
    );
    let evaluated = evaluate_bsdf(bsdf, q.outgoing, q.incident);
    let sampled = sample_bsdf(bsdf, q.outgoing, q.square, q.choice);
    let flags = select(0u, 1u, sampled.is_found) | select(0u, 2u, sampled.is_delta)
        | select(0u, 4u, sampled.is_transmitted) | select(0u, 8u, is_delta_only(bsdf));
    answers[index] = Answer(
        evaluated.value, evaluated.density, sampled.incident, sampled.density, sampled.weight, flags, compression_of(bsdf),
    );
}

// part copy
// Copies a buffer, sixteen bytes for each invocation. Its time gives the bandwidth that expected times are computed from.
// use shared/invocation/index

@group(0) @binding(0) var<storage, read> copied_from: array<vec4<u32>>;
@group(0) @binding(1) var<storage, read_write> copied_to: array<vec4<u32>>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index < min(arrayLength(&copied_from), arrayLength(&copied_to)) {
        copied_to[index] = copied_from[index];
    }
}

// part hair
// Evaluates and samples the BSDF of hair, to compare with the CPU.
// use shared/invocation/index
// use shared/hair

struct Query {
    absorption: vec3<f32>,
    roughness: f32,
    roughness_around: f32,
    tilt_rad: f32,
    ior: f32,
    choice: f32,
    outgoing: vec3<f32>,
    incident: vec3<f32>,
    square: vec2<f32>,
}

struct Answer {
    value: vec3<f32>,
    density: f32,
    incident: vec3<f32>,
    sampled_density: f32,
    weight: vec3<f32>,
    /// 1: found, 4: transmitted.
    flags: u32,
}

@group(0) @binding(0) var<storage, read> queries: array<Query>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&answers) {
        return;
    }
    let q = queries[index];
    fiber = Fiber(q.absorption, q.roughness, q.roughness_around, q.tilt_rad, q.ior, true);
    let evaluated = evaluate_hair(q.outgoing, q.incident);
    let sampled = sample_hair(q.outgoing, q.square, q.choice);
    let flags = select(0u, 1u, sampled.is_found) | select(0u, 4u, sampled.is_transmitted);
    answers[index] = Answer(evaluated.value, evaluated.density, sampled.incident, sampled.density, sampled.weight, flags);
}

// part incoming
// Evaluates `incoming_light` and the densities of shape lights, to compare with the CPU.
// use shared/invocation/index
// use shared/light/list

struct Query {
    at: vec3<f32>,
    light: u32,
    square: vec2<f32>,
}

struct Answer {
    incoming: IncomingLight,
    /// Density of the sampled direction.
    density: f32,
}

@group(0) @binding(0) var<storage, read> lights: array<ListLight>;
@group(0) @binding(1) var<storage, read> queries: array<Query>;
@group(0) @binding(2) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&answers) {
        return;
    }
    let query = queries[index];
    let light = lights[query.light];
    let incoming = incoming_light(light, query.at, query.square);
    answers[index] = Answer(incoming, light_density(light, query.at, incoming.to_light));
}

// part light
// Samples the lights of a scene and evaluates densities, to compare with the CPU.
// use shared/invocation/index
// use shared/light/sampler
// use ?sky

struct Query {
    position: vec3<f32>,
    choice: f32,
    normal: vec3<f32>,
    transmits: u32,
    square: vec2<f32>,
    /// What the direction hits: 0 the sky, 1 a shape light, 2 a triangle. Then its number or instance, and its primitive.
    kind: u32,
    number: u32,
    to_light: vec3<f32>,
    primitive: u32,
    shading_normal: vec3<f32>,
}

struct Answer {
    to_light: vec3<f32>,
    density: f32,
    radiance: vec3<f32>,
    shadow_ray: u32,
    position: vec3<f32>,
    shape_light: u32,
    is_emission: u32,
    /// Density of the direction of the query.
    density_there: f32,
}

@group(0) @binding(0) var<storage, read> queries: array<Query>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&answers) {
        return;
    }
    let q = queries[index];
    let receiver = Receiver(q.position, q.transmits != 0u, q.normal, q.shading_normal);
    let light = sample_light(receiver, q.choice, q.square);
    var density = sky_light_density(receiver, q.to_light);
    if q.kind == 1u {
        density = shape_light_density(receiver, q.number, q.to_light);
    } else if q.kind == 2u {
        density = surface_light_density(receiver, q.number, q.primitive, q.to_light);
    }
    let found = light.incoming;
    answers[index] = Answer(
        found.to_light, found.density, found.radiance, found.shadow_ray, found.position, light.shape_light, u32(light.is_emission), density,
    );
}

// part loops
// Counts the iterations of a loop. Some drivers end long loops early without an error.
// use shared/invocation/index

@group(0) @binding(0) var<uniform> wanted: vec4<u32>;
@group(0) @binding(1) var<storage, read_write> counted: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&counted) {
        return;
    }
    // The step depends on memory, so that the compiler cannot remove the loop.
    var iterations = 0u;
    loop {
        if iterations >= wanted.x {
            break;
        }
        iterations += 1u + (wanted.y & iterations);
    }
    counted[index] = iterations;
}

// part moving
// Closest hits of rays with individual times, to compare with the CPU.
// use shared/invocation/index
// use shared/time/ray_time
// use ?traverse

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read> times: array<f32>;
@group(1) @binding(2) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index < arrayLength(&rays) {
        ray_time = times[index];
        var hit = closest_hit(rays[index]);
        // As in trace/closest.
        if is_incomplete {
            hit.instance = INCOMPLETE;
        }
        hits[index] = hit;
    }
}

// part node
// The box test of one node, without the traversal around it, to measure its accuracy and cost.
//
// Each ray tests one BVH that consists of a single node; ray indices wrap around the BVHs.
// use shared/invocation/index
// use shared/bvh/node

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// Key of the box that each ray enters first.
@group(1) @binding(1) var<storage, read_write> entries: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&rays) {
        return;
    }
    let ray = rays[index];
    // BVH 0 is the top level, which is empty here.
    let bvh = 1u + index % (arrayLength(&bvhs) - 1u);
    let root = enter_bvh(bvh, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), 0u);
    var first = vec4<u32>(MISSED);
    if root != EMPTY {
        let farthest = scaled_t(ray.t_max);
        first = min(enter(root, 0u, farthest), enter(root, 1u, farthest));
    }
    entries[index] = min(min(first.x, first.y), min(first.z, first.w));
}

// part sampler
// Evaluates the sampler, to compare with the CPU.
// use shared/invocation/index
// use shared/sampler

struct Query {
    pixel: u32,
    sample: u32,
    dimension: u32,
    seed: u32,
    columns: u32,
    rows: u32,
}

struct Answer {
    pair: vec2<f32>,
    single: f32,
    bits: u32,
}

@group(0) @binding(0) var<storage, read> queries: array<Query>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&queries) {
        return;
    }
    let query = queries[index];
    let sampler = Sampler(query.seed, query.columns, query.rows, query.columns * query.rows);
    answers[index] = Answer(
        pair(sampler, query.pixel, query.sample, query.dimension),
        single(sampler, query.pixel, query.sample, query.dimension),
        bits(sampler, query.pixel, query.sample, query.dimension),
    );
}

// part triangle
// The test of one triangle, without the traversal around it, to measure its accuracy and cost.
//
// Each ray tests one BVH that consists of a single leaf; ray indices wrap around the BVHs.
// use shared/invocation/index
// use shared/bvh/node
// use shared/triangle/leaf/records

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&rays) {
        return;
    }
    let ray = rays[index];
    world_ray = ray;
    // BVH 0 is the top level, which is empty here.
    let bvh = 1u + index % (arrayLength(&bvhs) - 1u);
    let root = enter_bvh(bvh, ray.origin, ray.direction, ray.t_min, vec2<f32>(0.0), NONE);
    prepare_triangles(greatest(ray.origin) + bvhs[bvh].row_x.w);
    best = Hit(ray.t_max, 0.0, 0.0, NONE, NONE);
    t_max = scaled_t(ray.t_max);
    if root != EMPTY {
        triangle_leaf(root);
    }
    hits[index] = best;
}
