// Clustering, second dispatch of an iteration.
// Reads: partners.
// Writes: 1 for each cluster that keeps its place, 0 for the second of a merged pair.
// use shared/build/ploc

@group(0) @binding(1) var<storage, read> partners: array<u32>;
@group(0) @binding(2) var<storage, read> remaining: array<u32>;
@group(0) @binding(3) var<uniform> iteration: Iteration;
@group(0) @binding(4) var<storage, read_write> kept: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= slice.end {
        return;
    }
    var keeps = 0u;
    if i < remaining[iteration.number] {
        let partner = partners[i];
        keeps = select(1u, 0u, partner < i && partners[partner] == i);
    }
    kept[i] = keeps;
}
