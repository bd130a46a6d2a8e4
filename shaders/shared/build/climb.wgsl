// From the leaves up: six numbers a node that join by maximum, each climbing on its own.
// Holds: the word that says who came second is the word that carries the number, so nothing else must be seen with it. 0 says
// that nobody came yet: no number's reach is 0.
// Source: after Karras 2012, whose counter promises nothing of the data beside it.
// use shared/build/tree
// use shared/build/ordered

/// Parents of inner nodes by slot, then of leaves by position.
@group(0) @binding(6) var<storage, read> parents: array<u32>;
/// Six words an inner node: a child's reach, until the second one comes; then bits of the three low ends and the three high ones.
@group(0) @binding(3) var<storage, read_write> ends: array<atomic<u32>>;

fn parent_of_leaf(leaf: u32) -> u32 {
    return parents[arrayLength(&parents) / 2u + leaf];
}

/// Carries what is below a child of `parent` up from there.
fn climb(parent: u32, own: Reach) {
    var reach = array<u32, 6>(own.low.x, own.low.y, own.low.z, own.high.x, own.high.y, own.high.z);
    var climbing = 63u;
    var node = parent;
    while node != NONE && climbing != 0u {
        for (var k = 0u; k < 6u; k++) {
            if (climbing & (1u << k)) == 0u {
                continue;
            }
            let sibling = atomicExchange(&ends[6u * node + k], reach[k]);
            if sibling == 0u {
                climbing &= ~(1u << k);
            } else {
                reach[k] = max(reach[k], sibling);
                atomicStore(&ends[6u * node + k], end_of(reach[k], k));
            }
        }
        node = parents[node];
    }
}
