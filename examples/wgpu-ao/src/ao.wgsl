// Ambient occlusion. Ray, NONE, closest_hit, occluded and is_incomplete come from the module that is joined to this text.

const WIDTH: u32 = 480u;
const HEIGHT: u32 = 270u;
const N_RAYS: u32 = 24u;
const REACH: f32 = 1.5;
/// Greatest absolute coordinate of the sheet.
const W: f32 = 4.0;

@group(0) @binding(0) var<storage, read> positions: array<f32>;
@group(0) @binding(1) var<storage, read> indices: array<u32>;
@group(0) @binding(2) var<storage, read_write> brightness: array<f32>;

fn vertex(i: u32) -> vec3<f32> {
    return vec3<f32>(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
}

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
    let hit = closest_hit(Ray(vec3<f32>(0.0, 4.2, 5.5), 0.0, vec3<f32>(across.x, -0.75 - across.y, -1.0), 3e38));
    if hit.instance == NONE {
        brightness[pixel] = 1.0;
        return;
    }
    let a = vertex(indices[3u * hit.primitive]);
    let b = vertex(indices[3u * hit.primitive + 1u]);
    let c = vertex(indices[3u * hit.primitive + 2u]);
    var normal = normalize(cross(b - a, c - a));
    if normal.y < 0.0 {
        normal = -normal;
    }
    let origin = a + hit.u * (b - a) + hit.v * (c - a) + 5e-5 * W * normal;
    var seed = pixel * 9781u + 1u;
    var n_open = 0u;
    for (var i = 0u; i < N_RAYS; i++) {
        // A point on the unit sphere plus the normal is distributed as the cosine.
        let z = 1.0 - 2.0 * random(&seed);
        let angle = 6.2831853 * random(&seed);
        let around = sqrt(max(0.0, 1.0 - z * z)) * vec2<f32>(cos(angle), sin(angle));
        let direction = normal + vec3<f32>(around, z) * 0.999;
        n_open += select(1u, 0u, occluded(Ray(origin, 0.0, direction, REACH)));
    }
    brightness[pixel] = select(f32(n_open) / f32(N_RAYS), -1.0, is_incomplete);
}
