// The closest hit of each listed ray.
// use ?traverse
// use shared/invocation/index
// use shared/listed

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
/// The instance of a hit also encodes a miss and an incomplete traversal.
@group(1) @binding(1) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let entry = invocation(id, 64u);
    if entry >= listed.n {
        return;
    }
    let index = listed.indices[entry];
    var hit = closest_hit(rays[index]);
    if is_incomplete {
        hit.instance = INCOMPLETE;
    }
    hits[index] = hit;
}
