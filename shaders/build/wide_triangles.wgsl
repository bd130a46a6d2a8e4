// Triangles of wide BVHs, in the layout of shared/triangle/records.
// Reads: items.
// Writes: vertices and number of the triangle of each leaf position.
// Holds: coordinates are copies, but for triangles without area, which nothing hits. A leaf names the position of its first triangle.
// use shared/build/slice
// use shared/build/tree/forest
// use shared/exact/flat

@group(0) @binding(3) var<storage, read> leaves: array<u32>;
@group(0) @binding(4) var<storage, read_write> wide_triangles: array<vec4<u32>>;
/// Nine words per triangle.
@group(1) @binding(0) var<storage, read> corners: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let position = slice_item(id, 64u);
    if position >= slice.end {
        return;
    }
    let item = leaves[position];
    var words: array<u32, 9>;
    for (var row = 0u; row < 9u; row++) {
        words[row] = corners[9u * item + row];
    }
    words = flat_as_edge(words);
    let number = item - ranges[tree_of(item)].first;
    wide_triangles[3u * position] = vec4<u32>(words[0], words[1], words[2], number);
    wide_triangles[3u * position + 1u] = vec4<u32>(words[3], words[4], words[5], 0u);
    wide_triangles[3u * position + 2u] = vec4<u32>(words[6], words[7], words[8], 0u);
}
