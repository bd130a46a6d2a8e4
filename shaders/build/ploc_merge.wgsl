// Clustering, last dispatch of an iteration.
// Reads: clusters, partners, the number of kept clusters before each.
// Writes: the remaining clusters, a node for each merged pair, the clusters of each tree.
// use shared/build/ploc
// use shared/build/tree/forest

@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> partners: array<u32>;
@group(0) @binding(3) var<storage, read> prefixes: array<u32>;
@group(0) @binding(4) var<storage, read> states: array<TreeState>;
@group(0) @binding(5) var<uniform> iteration: Iteration;
@group(0) @binding(6) var<storage, read_write> clusters_out: array<Cluster>;
@group(0) @binding(7) var<storage, read_write> states_out: array<TreeState>;
@group(0) @binding(8) var<storage, read_write> remaining: array<u32>;
/// The most clusters of a tree before each iteration.
@group(0) @binding(9) var<storage, read_write> longest: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> merges: array<Merge>;
/// Nodes by number, then leaves by position: the parent's number times two, plus 1 for a right child.
@group(0) @binding(11) var<storage, read_write> links: array<u32>;

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
    let n = remaining[iteration.number];
    if i >= min(n, slice.end) {
        return;
    }
    let partner = partners[i];
    let is_merged = partner != i && partners[partner] == i;
    let keeps = !(is_merged && partner < i);
    var own = clusters[i];
    let tree = tree_of(own.number);
    if keeps {
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
    let end = prefixes[i] + select(0u, 1u, keeps);
    if i + 1u == n {
        remaining[iteration.number + 1u] = end;
    }
    let state = states[tree];
    if i + 1u == state.end {
        let first = prefixes[state.first];
        let is_forced = is_forced_after(state.end - state.first, end - first, state.is_forced != 0u);
        states_out[tree] = TreeState(first, end, select(0u, 1u, is_forced), 0u);
        atomicMax(&longest[iteration.number + 1u], end - first);
    }
}
