// Nodes of few leaves, which are measured leaf by leaf: cheaper than numbers that climb from each, and from a point of their own,
// for far from the origin theirs are the boxes that pads would swell most.
// use shared/build/enclosure
// use shared/build/node
// use ?item

const SMALL_NODE_LEAVES: u32 = 8u;

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
/// The item of each leaf.
@group(0) @binding(2) var<storage, read> leaves: array<u32>;

fn is_small(node: Node) -> bool {
    return node.last - node.first < SMALL_NODE_LEAVES;
}

/// The extent of all leaves from `first` to `last`.
fn extent_of_leaves(frame: mat3x3<f32>, origin: vec3<f32>, first: u32, last: u32) -> Extent {
    var extent = extent_of(frame, origin, item_content(leaves[first]));
    for (var leaf = first + 1u; leaf <= last; leaf++) {
        extent = joined_extents(extent, extent_of(frame, origin, item_content(leaves[leaf])));
    }
    return extent;
}
