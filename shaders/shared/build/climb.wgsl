// From the leaves up: six numbers a node that join by maximum, each climbing on its own.
// Holds: the word that says who came second is the word that carries the number, so nothing else must be seen with it. 0 says
// that nobody came yet: no number's reach is 0.
// Source: after Karras 2012, whose counter promises nothing of the data beside it.
// use shared/build/node
// use shared/build/ordered

@group(0) @binding(1) var<storage, read> parents: array<u32>;
/// The item of each leaf.
@group(0) @binding(2) var<storage, read> leaves: array<u32>;
/// Six words an inner node: a child's reach, until the second one comes; then bits of the three low ends and the three high ones.
@group(0) @binding(3) var<storage, read_write> ends: array<atomic<u32>>;

fn climb(leaf: u32, own: Reach) {
    var reach = array<u32, 6>(own.low.x, own.low.y, own.low.z, own.high.x, own.high.y, own.high.z);
    var climbing = 63u;
    var node = parents[arrayLength(&parents) / 2u + leaf];
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
