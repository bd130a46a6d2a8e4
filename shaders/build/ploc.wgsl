// Clustering of the leaves of each tree along the curve: parallel locally-ordered clustering (Meister and Bittner 2018), with all its dispatches.

// part start
// Clustering, before the first iteration.
// Reads: items in the order of the curve.
// Writes: a cluster for each leaf, the clusters of each tree, their number.
// use shared/build/ploc
// use shared/build/tree/forest
// use ?item

@group(0) @binding(1) var<storage, read> leaves: array<u32>;
@group(0) @binding(2) var<storage, read_write> clusters: array<Cluster>;
@group(0) @binding(3) var<storage, read_write> states: array<TreeState>;
/// The number of clusters before each iteration.
@group(0) @binding(4) var<storage, read_write> remaining: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let position = slice_item(id, 64u);
    if position >= slice.end {
        return;
    }
    let reach = item_reach(leaves[position]);
    let low = vec3<u32>(end_of(reach.low.x, 0u), end_of(reach.low.y, 1u), end_of(reach.low.z, 2u));
    let high = vec3<u32>(end_of(reach.high.x, 3u), end_of(reach.high.y, 4u), end_of(reach.high.z, 5u));
    clusters[position] = Cluster(bitcast<vec3<f32>>(low), position, bitcast<vec3<f32>>(high), LEAF | position);
    let tree = tree_of(position);
    let range = ranges[tree];
    if position == range.first {
        states[tree] = TreeState(range.first, range.first + range.count, 0u, 0u);
    }
    if position == 0u {
        remaining[0] = arrayLength(&leaves);
    }
}

// part partners
// Clustering, first dispatch of an iteration.
// Reads: clusters.
// Writes: the partner of each cluster; itself if it has none.
// use shared/build/ploc
// use shared/build/tree/forest

@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> states: array<TreeState>;
@group(0) @binding(3) var<storage, read> remaining: array<u32>;
@group(0) @binding(4) var<uniform> iteration: Iteration;
@group(0) @binding(5) var<storage, read_write> partners: array<u32>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let i = slice_item(id, 64u);
    if i >= min(remaining[iteration.number], slice.end) {
        return;
    }
    let own = clusters[i];
    let state = states[tree_of(own.number)];
    // Positions count within the tree.
    let at = i - state.first;
    let n = state.end - state.first;
    if state.is_forced != 0u {
        partners[i] = state.first + select(at, at ^ 1u, (at ^ 1u) < n);
        return;
    }
    let radius = radius_of(iteration);
    let last = min(at + radius, n - 1u);
    var nearest = NOT_NEAR;
    for (var other = max(at, radius) - radius; other <= last; other++) {
        if other != at {
            nearest = nearer(nearest, Nearness(union_area(own, clusters[state.first + other]), at ^ other));
        }
    }
    partners[i] = select(i, state.first + (at ^ nearest.difference), n > 1u);
}

// part keep
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

// part merge
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

// part states
// Clustering, last dispatch of an iteration, for each tree.
// Reads: which clusters are kept, and the number of kept clusters before each.
// Writes: the clusters of each tree, their number, the most of a tree.
// use shared/build/ploc

@group(0) @binding(1) var<storage, read> kept: array<u32>;
@group(0) @binding(2) var<storage, read> prefixes: array<u32>;
@group(0) @binding(3) var<storage, read> states: array<TreeState>;
@group(0) @binding(4) var<uniform> iteration: Iteration;
@group(0) @binding(5) var<storage, read_write> states_out: array<TreeState>;
/// The number of clusters before each iteration, and the most of a tree.
@group(0) @binding(6) var<storage, read_write> remaining: array<u32>;
@group(0) @binding(7) var<storage, read_write> longest: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let tree = slice_item(id, 64u);
    if tree >= slice.end {
        return;
    }
    let state = states[tree];
    // A tree without items has no clusters.
    if state.first == state.end {
        return;
    }
    let first = prefixes[state.first];
    let end = prefixes[state.end - 1u] + kept[state.end - 1u];
    let is_forced = is_forced_after(state.end - state.first, end - first, state.is_forced != 0u);
    states_out[tree] = TreeState(first, end, select(0u, 1u, is_forced), 0u);
    atomicMax(&longest[iteration.number + 1u], end - first);
    if state.end == remaining[iteration.number] {
        remaining[iteration.number + 1u] = end;
    }
}

// part finish
// Clustering of few clusters: all further iterations, one work-group for each tree.
// Reads: clusters, at most `GROUP` of each tree.
// Writes: nodes.
// use shared/build/ploc
// use shared/build/tree/forest
// use shared/build/scan
// const GROUP

@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> states: array<TreeState>;
@group(0) @binding(3) var<uniform> iteration: Iteration;
@group(0) @binding(4) var<storage, read_write> merges: array<Merge>;
@group(0) @binding(5) var<storage, read_write> links: array<u32>;

/// The clusters, and the leaves below each.
var<workgroup> group_clusters: array<Cluster, GROUP>;
var<workgroup> n_below: array<u32, GROUP>;
var<workgroup> group_partners: array<u32, GROUP>;
var<workgroup> group_state: TreeState;

fn put_link(word: u32, link: u32) {
    let n = arrayLength(&links) / 2u;
    links[select(word, n + (word & ~LEAF), (word & LEAF) != 0u)] = link;
}

/// The partner of cluster `at` of `n`.
fn partner_of(at: u32, n: u32, is_forced: bool, radius: u32) -> u32 {
    if is_forced {
        return select(at, at ^ 1u, (at ^ 1u) < n);
    }
    let own = group_clusters[at];
    let last = min(at + radius, n - 1u);
    var nearest = NOT_NEAR;
    for (var other = max(at, radius) - radius; other <= last; other++) {
        if other != at {
            nearest = nearer(nearest, Nearness(union_area(own, group_clusters[other]), at ^ other));
        }
    }
    return at ^ nearest.difference;
}

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let tree = slice.first + group_index(id);
    let local = id.local;
    if local == 0u {
        // Trees beyond the slice have no clusters.
        var state = TreeState();
        if tree < slice.end && ranges[tree].count > 0u {
            state = states[tree];
        }
        group_state = state;
    }
    let first = workgroupUniformLoad(&group_state).first;
    if local < group_state.end - first {
        let own = clusters[first + local];
        group_clusters[local] = own;
        n_below[local] = 1u;
        if (own.word & LEAF) == 0u {
            n_below[local] = merges[own.word].n;
        }
    }
    var step = iteration;
    loop {
        let state = workgroupUniformLoad(&group_state);
        let n = state.end - state.first;
        if n <= 1u {
            break;
        }
        if local < n {
            group_partners[local] = partner_of(local, n, state.is_forced != 0u, radius_of(step));
        }
        workgroupBarrier();
        var keeps = 0u;
        var own: Cluster;
        var n_leaves = 0u;
        if local < n {
            let partner = group_partners[local];
            let is_merged = partner != local && group_partners[partner] == local;
            keeps = select(1u, 0u, is_merged && partner < local);
            own = group_clusters[local];
            n_leaves = n_below[local];
            if is_merged && keeps == 1u {
                let other = group_clusters[partner];
                merges[other.number] = Merge(own.word, other.word, n_leaves, n_leaves + n_below[partner]);
                n_leaves += n_below[partner];
                put_link(own.word, 2u * other.number);
                put_link(other.word, 2u * other.number + 1u);
                own = Cluster(min(own.low, other.low), own.number, max(own.high, other.high), other.number);
            }
        }
        let scanned = scan_group(local, keeps);
        if keeps == 1u {
            group_clusters[scanned.before] = own;
            n_below[scanned.before] = n_leaves;
        }
        if local == 0u {
            let is_forced = is_forced_after(n, scanned.total, state.is_forced != 0u);
            group_state = TreeState(state.first, state.first + scanned.total, select(0u, 1u, is_forced), 0u);
        }
        step.number += 1u;
    }
    if local == 0u && group_state.end > group_state.first {
        put_link(group_clusters[0].word, NONE);
    }
}

// part ranges
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

// part nodes
// Renumbering of a clustered tree, second dispatch.
// Reads: merged pairs, links to parents, the first leaf of each node.
// Writes: nodes, parents and leaves in the form of the radix tree.
// use shared/build/ploc

@group(0) @binding(1) var<storage, read> merges: array<Merge>;
@group(0) @binding(2) var<storage, read> links: array<u32>;
@group(0) @binding(3) var<storage, read> firsts: array<u32>;
@group(0) @binding(4) var<storage, read> leaves: array<u32>;
@group(0) @binding(5) var<storage, read_write> nodes: array<Node>;
@group(0) @binding(6) var<storage, read_write> parents: array<u32>;
@group(0) @binding(7) var<storage, read_write> leaves_out: array<u32>;

/// Writes the parent of a child whose leaves start at `first`, and its leaf. Returns its number in the tree: `slot`, or the leaf.
fn put_child(word: u32, first: u32, slot: u32, parent: u32) -> u32 {
    if (word & LEAF) != 0u {
        leaves_out[first] = leaves[word & ~LEAF];
        parents[arrayLength(&parents) / 2u + first] = parent;
        return LEAF | first;
    }
    parents[slot] = parent;
    return slot;
}

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let number = slice_item(id, 64u);
    if number >= slice.end {
        return;
    }
    let n_leaves = arrayLength(&links) / 2u;
    if links[n_leaves + number] == NONE {
        // The only leaf of its tree.
        leaves_out[number] = leaves[number];
        parents[n_leaves + number] = NONE;
    }
    let merge = merges[number];
    if merge.n == 0u {
        return;
    }
    let first = firsts[number];
    let link = links[number];
    // A left child has the number of its last leaf, others that of their first.
    let is_left = link != NONE && (link & 1u) == 0u;
    let slot = select(first, first + merge.n - 1u, is_left);
    let split = first + merge.n_left;
    let left = put_child(merge.left, first, split - 1u, slot);
    let right = put_child(merge.right, split, split, slot);
    nodes[slot] = Node(left, right, first, first + merge.n - 1u);
    if link == NONE {
        parents[slot] = NONE;
    }
}
