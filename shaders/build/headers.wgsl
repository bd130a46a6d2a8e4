// The bounds that the header of each tree holds.
// Reads: axis-aligned boxes of the roots.
// Writes: reach and error of hits. Root and first triangle do not change.
// use shared/build/slice
// use shared/build/root

struct HeaderScale {
    /// Reach over the largest coordinate.
    reach: f32,
    /// Error of hits, relative to the largest coordinate.
    error: f32,
    /// The header of the first tree.
    first_header: u32,
}

/// As `Bvh` of shared/bvh: three rows and words of each tree.
@group(0) @binding(2) var<storage, read_write> headers: array<vec4<f32>>;
@group(0) @binding(3) var<uniform> header_scale: HeaderScale;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let tree = slice_item(id, 64u);
    if tree >= slice.end {
        return;
    }
    let root = root_of(tree);
    let ends = max(abs(root.low), abs(root.high));
    let greatest = max(ends.x, max(ends.y, ends.z));
    let at = 4u * (header_scale.first_header + tree);
    headers[at].w = header_scale.reach * greatest;
    headers[at + 2u].w = header_scale.error * greatest;
}
