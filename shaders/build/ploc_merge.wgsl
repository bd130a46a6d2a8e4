// Clustering, fourth dispatch of an iteration, after prefix sums.
// Reads: clusters, partners, the number of kept clusters before each.
// Writes: the remaining clusters, a node for each merged pair.
// use shared/build/ploc

@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> partners: array<u32>;
@group(0) @binding(3) var<storage, read> prefixes: array<u32>;
@group(0) @binding(4) var<storage, read> remaining: array<u32>;
@group(0) @binding(5) var<uniform> iteration: Iteration;
@group(0) @binding(6) var<storage, read_write> clusters_out: array<Cluster>;
@group(0) @binding(7) var<storage, read_write> merges: array<Merge>;
/// Nodes by number, then leaves by position: the parent's number times two, plus 1 for a right child.
@group(0) @binding(8) var<storage, read_write> links: array<u32>;

fn n_below(word: u32) -> u32 {
    if (word & LEAF) != 0u {
        return 1u;
    }
    return merges[word].n;
}

fn put_link(word: u32, link: u32) {
    let n = arrayLength(&links) / 2u;
    links[select(word, n + (word & ~LEAF), (word & LEAF) != 0u)] = link;
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= min(remaining[iteration.number], slice.end) {
        return;
    }
    let partner = partners[i];
    let is_merged = partner != i && partners[partner] == i;
    if is_merged && partner < i {
        return;
    }
    var own = clusters[i];
    if is_merged {
        let other = clusters[partner];
        let n_left = n_below(own.word);
        merges[other.number] = Merge(own.word, other.word, n_left, n_left + n_below(other.word));
        put_link(own.word, 2u * other.number);
        put_link(other.word, 2u * other.number + 1u);
        own = Cluster(min(own.low, other.low), own.number, max(own.high, other.high), other.number);
    }
    clusters_out[prefixes[i]] = own;
}
