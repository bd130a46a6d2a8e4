// Which subtrees of a binary tree become the children of a wide node.
//
// The child with the largest box is replaced by its two children until there are eight, or only leaves. A subtree of at most
// `MAX_LEAF` items is a leaf.
// Holds: areas round alike, so that the choice is the same on every device.
// Source: Wald, Benthin and Boulos 2008.
// use shared/build/slice
// use shared/build/tree
// use shared/build/surface
// const MAX_LEAF

const WIDTH: u32 = 8u;

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
/// The box of each inner node: three minima, three maxima.
@group(0) @binding(2) var<storage, read> aabbs: array<f32>;

/// Children as in `Node`.
struct Children {
    words: array<u32, WIDTH>,
    n: u32,
}

/// Whether a child is a leaf of the wide BVH.
fn is_leaf(child: u32) -> bool {
    if (child & LEAF) != 0u {
        return true;
    }
    return nodes[child].last - nodes[child].first < MAX_LEAF;
}

/// Half the surface area of a child's box; negative for a leaf.
fn area_to_open(child: u32) -> f32 {
    if is_leaf(child) {
        return -1.0;
    }
    let at = 6u * child;
    return half_area_of(vec3<f32>(aabbs[at], aabbs[at + 1u], aabbs[at + 2u]), vec3<f32>(aabbs[at + 3u], aabbs[at + 4u], aabbs[at + 5u]));
}

/// The children of the wide node over inner node `slot`.
fn children_of(slot: u32) -> Children {
    var children: Children;
    var areas: array<f32, WIDTH>;
    children.words[0] = nodes[slot].left;
    children.words[1] = nodes[slot].right;
    areas[0] = area_to_open(children.words[0]);
    areas[1] = area_to_open(children.words[1]);
    children.n = 2u;
    while children.n < WIDTH {
        var largest = 0u;
        for (var child = 1u; child < children.n; child++) {
            largest = select(largest, child, areas[child] > areas[largest]);
        }
        if areas[largest] < 0.0 {
            break;
        }
        let opened = nodes[children.words[largest]];
        children.words[largest] = opened.left;
        areas[largest] = area_to_open(opened.left);
        children.words[children.n] = opened.right;
        areas[children.n] = area_to_open(opened.right);
        children.n += 1u;
    }
    return children;
}
