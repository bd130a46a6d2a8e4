// Ambient occlusion. ray, NONE, closest_hit, surface_of, origin_beside, occluded and is_incomplete come from the module that is joined to this text.

const WIDTH: u32 = 480u;
const HEIGHT: u32 = 270u;
const N_RAYS: u32 = 24u;
const REACH: f32 = 1.5;

@group(0) @binding(0) var<storage, read_write> brightness: array<f32>;

/// A number from 0 to 1 (Jarzynski and Olano 2020, PCG).
fn random(seed: ptr<function, u32>) -> f32 {
    *seed = *seed * 747796405u + 2891336453u;
    let word = ((*seed >> ((*seed >> 28u) + 4u)) ^ *seed) * 277803737u;
    return f32((word >> 22u) ^ word) / 4294967296.0;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= WIDTH || id.y >= HEIGHT {
        return;
    }
    let pixel = id.y * WIDTH + id.x;
    let across = (vec2<f32>(f32(id.x), f32(id.y)) + 0.5) * 2.0 / f32(WIDTH) - vec2<f32>(1.0, f32(HEIGHT) / f32(WIDTH));
    let first = ray(vec3<f32>(0.0, 4.2, 5.5), vec3<f32>(across.x, -0.75 - across.y, -1.0), 3e38);
    let hit = closest_hit(first);
    if hit.instance == NONE {
        brightness[pixel] = 1.0;
        return;
    }
    // On the side that is seen.
    let surface = surface_of(hit, first);
    let normal = select(-surface.normal, surface.normal, surface.is_front);
    let origin = origin_beside(hit, first, normal);
    var seed = pixel * 9781u + 1u;
    var n_open = 0u;
    for (var i = 0u; i < N_RAYS; i++) {
        // A point on the unit sphere plus the normal is distributed as the cosine.
        let z = 1.0 - 2.0 * random(&seed);
        let angle = 6.2831853 * random(&seed);
        let around = sqrt(max(0.0, 1.0 - z * z)) * vec2<f32>(cos(angle), sin(angle));
        let direction = normal + vec3<f32>(around, z) * 0.999;
        n_open += select(1u, 0u, occluded(ray(origin, direction, REACH)));
    }
    brightness[pixel] = select(f32(n_open) / f32(N_RAYS), -1.0, is_incomplete);
}
