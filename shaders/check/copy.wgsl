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
