// Volumes: axis-aligned boxes, from the leaves up.
// Reads: parents, leaves. Writes: the box around what is below each inner node, copies of its items' coordinates.
// Holds: each of the six numbers climbs on its own; the word that says who came second is the word that carries the number, so
// nothing else must be seen with it. 0 says that nobody came yet: no number's reach is 0.
// Source: after Karras 2012, whose counter promises nothing of the data beside it.
// use shared/build/slice
// use shared/build/node
// use ?item

@group(0) @binding(1) var<storage, read> parents: array<u32>;
@group(0) @binding(2) var<storage, read> leaves: array<u32>;
/// Six words an inner node: a child's reach, until the second one comes; then bits of the three low ends and the three high ones.
@group(0) @binding(3) var<storage, read_write> aabbs: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let leaf = slice_item(group, groups, 64u, local);
    if leaf >= slice.end {
        return;
    }
    let own = item_reach(leaves[leaf]);
    var reach = array<u32, 6>(own.low.x, own.low.y, own.low.z, own.high.x, own.high.y, own.high.z);
    var climbing = 63u;
    var node = parents[arrayLength(&parents) / 2u + leaf];
    while node != NONE && climbing != 0u {
        for (var k = 0u; k < 6u; k++) {
            if (climbing & (1u << k)) == 0u {
                continue;
            }
            let sibling = atomicExchange(&aabbs[6u * node + k], reach[k]);
            if sibling == 0u {
                climbing &= ~(1u << k);
            } else {
                reach[k] = max(reach[k], sibling);
                atomicStore(&aabbs[6u * node + k], end_of(reach[k], k));
            }
        }
        node = parents[node];
    }
}
