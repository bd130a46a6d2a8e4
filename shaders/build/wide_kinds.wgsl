// The kind of each wide node but roots, as its size in memory. Without this pass all nodes are aligned.
//
// A node is oriented where that lowers the predicted cost: what its test costs more, for rays that enter its own box, is less than
// what the smaller boxes of its children save. Costs are those of `canted_wide::Costs`.
// Reads: binary tree, aligned and oriented boxes, triangles, which binary nodes are wide ones.
// Writes: sizes of wide nodes by slot.
// use shared/build/wide
// use shared/build/wide_word
// use shared/volumes/item/triangles
// use shared/build/length

@group(0) @binding(3) var<storage, read_write> units: array<u32>;
@group(0) @binding(4) var<storage, read> leaves: array<u32>;
/// Fifteen floats per inner node: center, three axes, half-extents.
@group(0) @binding(5) var<storage, read> obbs: array<f32>;

/// Cost of an oriented node beyond that of an aligned one, which is 1, and of a leaf.
const MORE_FOR_ORIENTED: f32 = 1.2;
const LEAF_COST: f32 = 1.92;

/// Half the surface areas of a child's boxes: aligned, oriented.
fn areas_of(child: u32) -> vec2<f32> {
    if (child & LEAF) != 0u {
        let item = leaves[child & ~LEAF];
        let a = corner(item, 0u);
        let b = corner(item, 1u);
        let c = corner(item, 2u);
        // A flat box in the plane of the triangle, along its longest edge.
        return vec2<f32>(half_area_of(min(min(a, b), c), max(max(a, b), c)), length_of(cross(b - a, c - a)));
    }
    let at = 6u * child;
    let low = vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]);
    let high = vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]);
    let half = vec3<f32>(obbs[15u * child + 12u], obbs[15u * child + 13u], obbs[15u * child + 14u]);
    return vec2<f32>(half_area_of(low, high), 4.0 * (half.x * half.y + half.y * half.z + half.z * half.x));
}

fn kind_of(slot: u32, children: Children) -> u32 {
    // Which box the parent stores is not known here; that of the binary tree is.
    var gain = -MORE_FOR_ORIENTED * areas_of(slot).x;
    for (var child = 0u; child < children.n; child++) {
        let areas = areas_of(children.words[child]);
        gain += (areas.x - areas.y) * select(1.0, LEAF_COST, is_leaf(children.words[child]));
    }
    return select(ALIGNED, ORIENTED, gain > 0.0);
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let slot = slice_item(id, 64u);
    if slot < slice.end && units[slot] != 0u {
        units[slot] = kind_of(slot, children_of(slot));
    }
}
