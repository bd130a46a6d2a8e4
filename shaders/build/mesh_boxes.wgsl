// The box of each mesh, from which its instances get theirs.
// Reads: axis-aligned boxes of the roots.
// Writes: two quads for each tree: the lower ends and 1, or 0 for a mesh without triangles; then the upper ends.
// use shared/build/slice
// use shared/build/root

@group(0) @binding(2) var<storage, read_write> mesh_boxes: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let tree = slice_item(id, 64u);
    if tree >= slice.end {
        return;
    }
    let root = root_of(tree);
    mesh_boxes[2u * tree] = vec4<f32>(root.low, select(1.0, 0.0, root.is_empty));
    mesh_boxes[2u * tree + 1u] = vec4<f32>(root.high, 0.0);
}
