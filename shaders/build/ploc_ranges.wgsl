// Renumbering of a clustered tree, first dispatch.
// Reads: merged pairs, links to parents.
// Writes: the first leaf of each node.
// use shared/build/ploc
// use shared/build/tree/forest

@group(0) @binding(1) var<storage, read> merges: array<Merge>;
@group(0) @binding(2) var<storage, read> links: array<u32>;
@group(0) @binding(3) var<storage, read_write> firsts: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let number = slice_item(id, 64u);
    if number >= slice.end || merges[number].n == 0u {
        return;
    }
    var first = ranges[tree_of(number)].first;
    var link = links[number];
    while link != NONE {
        let parent = link / 2u;
        first += select(0u, merges[parent].n_left, (link & 1u) == 1u);
        link = links[parent];
    }
    firsts[number] = first;
}
