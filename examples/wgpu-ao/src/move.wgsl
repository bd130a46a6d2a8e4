// Moves the vertices of a sheet: a ring of waves that runs outward.

struct Frame {
    time: f32,
    n: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read_write> positions: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= frame.n * frame.n {
        return;
    }
    let across = vec2<f32>(f32(id.x % frame.n), f32(id.x / frame.n)) / f32(frame.n - 1u) * 8.0 - 4.0;
    let distance = length(across);
    positions[3u * id.x] = across.x;
    positions[3u * id.x + 1u] = 0.55 * sin(5.0 * distance - frame.time) * exp(-0.25 * distance) + 0.1 * cos(9.0 * across.x);
    positions[3u * id.x + 2u] = across.y;
}
