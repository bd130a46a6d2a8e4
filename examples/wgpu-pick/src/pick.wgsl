// What is under the pointer? ray, Hit, normal_of and closest_hit come from the module that is joined to this text.

struct Pointer {
    eye: vec3<f32>,
    // In units of the picture: -1 to 1, upwards.
    x: f32,
    forward: vec3<f32>,
    y: f32,
}

@group(0) @binding(0) var<uniform> pointer: Pointer;
struct Picked {
    hit: Hit,
    normal: vec3<f32>,
}

@group(0) @binding(1) var<storage, read_write> picked: Picked;

@compute @workgroup_size(1)
fn main() {
    let right = normalize(cross(pointer.forward, vec3<f32>(0.0, 1.0, 0.0)));
    let up = cross(right, pointer.forward);
    let direction = pointer.forward + 0.5 * (pointer.x * right + pointer.y * up);
    picked.hit = closest_hit(ray(pointer.eye, direction, 3e38));
    if picked.hit.instance != NONE {
        picked.normal = normal_of(picked.hit);
    }
}
