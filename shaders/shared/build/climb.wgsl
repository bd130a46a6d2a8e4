// Bottom-up maximum of six numbers per node, each propagated separately.
// Holds: the atomic word that identifies the second child also carries the number, so no other memory must be visible with it.
// 0 means that no child has arrived; no number maps to 0.
// Source: after Karras 2012, whose counter gives no guarantee about other memory.
// use shared/build/tree
// use shared/build/ordered

/// Parents of inner nodes by slot, followed by parents of leaves by position.
@group(0) @binding(6) var<storage, read> parents: array<u32>;
/// Six words per inner node: the number of the first child until the second arrives, then the bits of the three minima and
/// three maxima.
@group(0) @binding(3) var<storage, read_write> ends: array<atomic<u32>>;

fn parent_of_leaf(leaf: u32) -> u32 {
    return parents[arrayLength(&parents) / 2u + leaf];
}

/// Propagates the bounds of a child of `parent` upwards.
fn climb(parent: u32, own: Reach) {
    var reach = array<u32, 6>(own.low.x, own.low.y, own.low.z, own.high.x, own.high.y, own.high.z);
    var climbing = 63u;
    var node = parent;
    for (var step = 0u; step < MAX_HEIGHT && node != NONE && climbing != 0u; step++) {
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
