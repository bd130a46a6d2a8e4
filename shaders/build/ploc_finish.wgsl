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
