// Whether each listed ray hits anything.
// use ?traverse
// use shared/invocation/index
// use shared/listed

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// 1 for a hit, 0 for a miss, INCOMPLETE if the traversal ended early without a hit.
@group(1) @binding(1) var<storage, read_write> found: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= listed.n {
        return;
    }
    let index = listed.indices[entry];
    let is_hit = occluded(rays[index]);
    found[index] = select(select(0u, INCOMPLETE, is_incomplete), 1u, is_hit);
}
