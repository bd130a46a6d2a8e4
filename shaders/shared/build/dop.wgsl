// Extents of small nodes, computed leaf by leaf and relative to a point of the node. This is cheaper than propagating them and
// gives tighter boxes far from the origin, where pads would dominate.
// use shared/build/enclosure
// use shared/build/tree
// use ?item

const SMALL_NODE_LEAVES: u32 = 8u;

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
/// The item of each leaf.
@group(0) @binding(2) var<storage, read> leaves: array<u32>;

fn is_small(node: Node) -> bool {
    return node.last - node.first < SMALL_NODE_LEAVES;
}

/// Extent of the leaves from `first` to `last`.
fn extent_of_leaves(frame: mat3x3<f32>, origin: vec3<f32>, first: u32, last: u32) -> Extent {
    var extent = extent_of(frame, origin, item_content(leaves[first]));
    for (var leaf = first + 1u; leaf <= last; leaf++) {
        extent = joined_extents(extent, extent_of(frame, origin, item_content(leaves[leaf])));
    }
    return extent;
}

// A fixed frame, the same for all nodes.

struct FixedFrame {
    frame: mat3x3<f32>,
    /// Upper bound of the greatest row sum of |F^T F - 1|.
    skewness: f32,
}

@group(0) @binding(4) var<uniform> fixed_frame: FixedFrame;
