// From the meshes of a scene to their trees, and from built trees to what rays traverse.

// part corners
// Vertices of the triangles of meshes that share two buffers, or one, of any layout.
// Reads: layouts, vertices, indices.
// Writes: nine words per triangle; faults.
// Holds: every coordinate written is finite. A triangle with a fault becomes a point, which nothing hits.
// use shared/build/slice

struct MeshLayout {
    /// The mesh's first triangle among the items of the dispatch. Layouts are in its order.
    first_item: u32,
    /// First word of the first vertex, and words from vertex to vertex.
    first_word: u32,
    stride: u32,
    n_vertices: u32,
    /// Number of the first index in the buffer, in units of its size.
    first_index: u32,
    /// Bytes of an index; 0 if vertices are in order.
    index_bytes: u32,
    /// Number of the mesh's first triangle among all.
    first_triangle: u32,
    /// Number of the mesh's first word in `faults`.
    first_fault: u32,
}

@group(0) @binding(1) var<storage, read> mesh_layouts: array<MeshLayout>;
@group(0) @binding(2) var<storage, read> mesh_vertices: array<u32>;
@group(0) @binding(3) var<storage, read> mesh_indices: array<u32>;
@group(0) @binding(4) var<storage, read_write> corners: array<u32>;
/// Two words for each mesh: the complement of its lowest triangle with an index out of range, and of its lowest with a coordinate that is
/// not finite or too large; zero for none.
@group(0) @binding(5) var<storage, read_write> faults: array<atomic<u32>>;

/// Bits of the largest coordinate that kernels support, 1e18.
const MAX_COORDINATE: u32 = 0x5d5e0b6bu;

/// The mesh of an item: the last that does not start behind it.
fn mesh_of(item: u32) -> MeshLayout {
    var low = 0u;
    var n = arrayLength(&mesh_layouts);
    while n > 1u {
        let half = n / 2u;
        if mesh_layouts[low + half].first_item <= item {
            low += half;
            n -= half;
        } else {
            n = half;
        }
    }
    return mesh_layouts[low];
}

/// The vertex of a corner, numbered over all corners of the mesh.
fn index_of(mesh_layout: MeshLayout, corner: u32) -> u32 {
    let at = mesh_layout.first_index + corner;
    switch mesh_layout.index_bytes {
        case 0u: {
            return corner;
        }
        case 2u: {
            return (mesh_indices[at >> 1u] >> ((at & 1u) << 4u)) & 0xffffu;
        }
        default: {
            return mesh_indices[at];
        }
    }
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let item = slice_item(id, 64u);
    if item >= slice.end {
        return;
    }
    let mesh_layout = mesh_of(item);
    let triangle = item - mesh_layout.first_item;
    let number = mesh_layout.first_triangle + triangle;
    var words: array<u32, 9>;
    var is_sound = true;
    for (var k = 0u; k < 3u; k++) {
        let index = index_of(mesh_layout, 3u * triangle + k);
        if index >= mesh_layout.n_vertices {
            atomicMax(&faults[mesh_layout.first_fault], ~triangle);
            is_sound = false;
            continue;
        }
        for (var axis = 0u; axis < 3u; axis++) {
            let word = mesh_vertices[mesh_layout.first_word + mesh_layout.stride * index + axis];
            // As integers, because devices need not compare NaN.
            if (word & 0x7fffffffu) > MAX_COORDINATE {
                atomicMax(&faults[mesh_layout.first_fault + 1u], ~triangle);
                is_sound = false;
            }
            words[3u * k + axis] = word;
        }
    }
    for (var k = 0u; k < 9u; k++) {
        corners[9u * number + k] = select(0u, words[k], is_sound);
    }
}

// part pairs
// The traversed form of binary trees: each inner node holds the volumes of both children and the words that refer to them.
//
// Children are numbered over all levels of a scene: `target_level.first_node` is added to slots. The word of a leaf is its item, with the
// highest bit set.
// Reads: nodes, leaves, volumes, items.
// Writes: pairs.
// use shared/build/slice
// use shared/build/tree
// use ?pair

struct Level {
    /// The number of the first node of the level.
    first_node: u32,
}

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> leaves: array<u32>;
@group(0) @binding(4) var<storage, read_write> pairs: array<vec4<u32>>;
@group(0) @binding(5) var<uniform> target_level: Level;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot >= slice.end {
        return;
    }
    let node = nodes[slot];
    // The last slot of a tree is empty.
    if node.first == node.last {
        return;
    }
    let at = 2u * CHILD_QUADS * (target_level.first_node + slot);
    put(at, node.left);
    put(at + CHILD_QUADS, node.right);
}

/// Writes a child that starts at a quad.
fn put(at: u32, child: u32) {
    if (child & LEAF) != 0u {
        let item = leaves[child & ~LEAF];
        put_item(at, LEAF | item, item);
    } else {
        put_node(at, target_level.first_node + child, child);
    }
}

// part headers
// The bounds that the header of each tree holds, and the box of each mesh, from which its instances get theirs.
// Reads: axis-aligned boxes of the roots.
// Writes: reach and error of hits, root and first triangle do not change; two quads for each tree: the lower ends and 1, or 0 for a mesh
// without triangles, then the upper ends.
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
@group(0) @binding(4) var<storage, read_write> mesh_boxes: array<vec4<f32>>;

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
    mesh_boxes[2u * tree] = vec4<f32>(root.low, select(1.0, 0.0, root.is_empty));
    mesh_boxes[2u * tree + 1u] = vec4<f32>(root.high, 0.0);
}
