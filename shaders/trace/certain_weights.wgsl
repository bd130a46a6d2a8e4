// `t` and weights of the hits of `trace/certain_closest`, with the bits of the exact kernels. They are apart from the loop, which is shorter so.
// use shared/triangle/records
// use ?weights
// use shared/undecided/found
// use ?level
// use shared/invocation/index

@group(1) @binding(0) var<storage, read> rays: array<Ray>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let index = invocation(id, 64u);
    if index >= arrayLength(&rays) || hits[index].instance == NONE {
        return;
    }
    let found = hits[index];
    enter_instance(rays[index], found.instance);
    let hit = placed(completed(index, found));
    let numbers = bitcast<vec3<u32>>(vec3<f32>(hit.t, hit.u, hit.v));
    hits[index] = Found(numbers.x, numbers.y, numbers.z, hit.primitive, hit.instance);
}
