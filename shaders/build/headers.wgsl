// The bounds that the header of each tree holds.
// Reads: axis-aligned boxes of the roots.
// Writes: reach and error of hits. Root and first triangle do not change.
// use shared/build/slice
// use shared/build/ordered
// use shared/build/tree/forest
// use ?item

struct HeaderScale {
    /// Reach over the largest coordinate.
    reach: f32,
    /// Error of hits, relative to the largest coordinate.
    error: f32,
}

@group(0) @binding(1) var<storage, read> aabbs: array<u32>;
/// As `Bvh` of shared/bvh: three rows and words of each tree.
@group(0) @binding(2) var<storage, read_write> headers: array<vec4<f32>>;
@group(0) @binding(3) var<uniform> header_scale: HeaderScale;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let tree = slice_item(id, 64u);
    if tree >= slice.end {
        return;
    }
    let range = ranges[tree];
    var low = vec3<f32>(0.0);
    var high = vec3<f32>(0.0);
    if range.count == 1u {
        let reach = item_reach(range.first);
        low = bitcast<vec3<f32>>(vec3<u32>(end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u)));
        high = bitcast<vec3<f32>>(vec3<u32>(end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u)));
    } else if range.count > 1u {
        let at = 6u * range.first;
        low = bitcast<vec3<f32>>(vec3<u32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]));
        high = bitcast<vec3<f32>>(vec3<u32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]));
    }
    let ends = max(abs(low), abs(high));
    let greatest = max(ends.x, max(ends.y, ends.z));
    headers[4u * tree].w = header_scale.reach * greatest;
    headers[4u * tree + 2u].w = header_scale.error * greatest;
}
