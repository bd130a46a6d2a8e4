// Boxes of the nodes, fifteen floats each: center, three axes, half-extents.
// use shared/build/enclosure

@group(0) @binding(5) var<storage, read_write> obbs: array<f32>;

fn part(slot: u32, index: u32) -> vec3<f32> {
    let at = 15u * slot + 3u * index;
    return vec3<f32>(obbs[at], obbs[at + 1u], obbs[at + 2u]);
}

fn put(slot: u32, index: u32, value: vec3<f32>) {
    let at = 15u * slot + 3u * index;
    obbs[at] = value.x;
    obbs[at + 1u] = value.y;
    obbs[at + 2u] = value.z;
}

fn put_box(slot: u32, volume: Box) {
    put(slot, 0u, volume.center);
    put(slot, 1u, volume.frame[0]);
    put(slot, 2u, volume.frame[1]);
    put(slot, 3u, volume.frame[2]);
    put(slot, 4u, volume.half_extents);
}
