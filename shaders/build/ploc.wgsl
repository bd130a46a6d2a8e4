// Clustering of the leaves of each tree along the curve: parallel locally-ordered clustering (Meister and Bittner 2018), with all its dispatches.

// part start
// Clustering, before the first iteration.
// Reads: items in the order of the curve.
// Writes: a cluster for each leaf, the clusters of each tree, their number.
// use shared/build/ploc
// use shared/build/ploc/states
// use shared/build/tree/forest
// use ?item

@group(0) @binding(1) var<storage, read> leaves: array<u32>;
@group(0) @binding(2) var<storage, read_write> clusters: array<Cluster>;
@group(0) @binding(4) var<uniform> iteration: Iteration;

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
        put_state(tree, TreeState(range.first, range.first + range.count, 0u));
    }
    if position == 0u {
        atomicStore(&states[remaining_at(iteration)], iteration.n_items);
    }
}

// part partners
// Clustering, first dispatch of an iteration: a work-group for each tile of clusters.
//
// Whether a cluster is merged depends on its partner's partner, so a work-group finds the partners of as many clusters beyond its tile as a
// partner may be away.
// Reads: clusters.
// Writes: the partner of each cluster, itself if it has none, and whether they are merged; the clusters that are kept in each tile; the
// number of merged pairs of each tree.
// use shared/build/ploc
// use shared/build/ploc/states
// use shared/build/ploc/scratch
// use shared/build/tree/forest
// const GROUP

@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read_write> scratch: array<u32>;
@group(0) @binding(4) var<uniform> iteration: Iteration;

/// The clusters of the tile, and as many on each side as there are up to a partner's partner.
var<workgroup> near: array<Cluster, GROUP + 4u * REACH>;
var<workgroup> near_partners: array<u32, GROUP + 2u * REACH>;
var<workgroup> n_kept: atomic<u32>;
/// Merged pairs of the first cluster's tree.
var<workgroup> n_merged: atomic<u32>;

/// The partner of cluster `i`, which is `near[at]`.
fn partner_of(i: u32, at: u32) -> u32 {
    let own = near[at];
    let state = state_of(tree_of(own.number));
    // Positions count within the tree.
    let own_place = i - state.first;
    let n = state.end - state.first;
    if state.is_forced != 0u {
        return state.first + select(own_place, own_place ^ 1u, (own_place ^ 1u) < n);
    }
    let radius = radius_of(iteration);
    let last = min(own_place + radius, n - 1u);
    var nearest = NOT_NEAR;
    for (var other = max(own_place, radius) - radius; other <= last; other++) {
        if other != own_place {
            nearest = nearer(nearest, Nearness(union_area(own, near[at + other - own_place]), own_place ^ other));
        }
    }
    return select(i, state.first + (own_place ^ nearest.difference), n > 1u);
}

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let tile = slice.first + group_index(id);
    let local = id.local;
    let start = tile * GROUP;
    let n = atomicLoad(&states[remaining_at(iteration)]);
    for (var k = local; k < GROUP + 4u * REACH; k += GROUP) {
        let i = start + k - 2u * REACH;
        if start + k >= 2u * REACH && i < n {
            near[k] = clusters[i];
        }
    }
    workgroupBarrier();
    for (var k = local; k < GROUP + 2u * REACH; k += GROUP) {
        let i = start + k - REACH;
        if start + k >= REACH && i < n {
            near_partners[k] = partner_of(i, k + REACH);
        }
    }
    workgroupBarrier();
    let i = start + local;
    if i < n {
        let partner = near_partners[local + REACH];
        let is_merged = partner != i && near_partners[partner + REACH - start] == i;
        let own_tree = tree_of(near[local + 2u * REACH].number);
        if is_merged && partner < i {
            if own_tree == tree_of(near[2u * REACH].number) {
                atomicAdd(&n_merged, 1u);
            } else {
                atomicAdd(&states[merged_at(own_tree)], 1u);
            }
        } else {
            atomicAdd(&n_kept, 1u);
        }
        let is_first = i == state_of(own_tree).first;
        scratch[i] = partner | select(0u, IS_MERGED, is_merged) | select(0u, IS_FIRST, is_first);
    }
    workgroupBarrier();
    if local == 0u && start < n {
        let kept = atomicLoad(&n_kept);
        scratch[iteration.n_items + tile] = kept;
        atomicAdd(&states[block_at(iteration, tile / BLOCK)], kept);
        atomicAdd(&states[merged_at(tree_of(near[2u * REACH].number))], atomicLoad(&n_merged));
    }
}

// part merge
// Clustering, last dispatch of an iteration: a work-group for each tile of clusters.
// Reads: clusters, partners, the number of kept clusters of each tile.
// Writes: the remaining clusters, a node for each merged pair; the clusters of each tree, their number; the work-groups of the next
// iteration: none where no tree has more clusters than a work-group merges alone.
// use shared/build/ploc
// use shared/build/ploc/states
// use shared/build/ploc/scratch
// use shared/build/ploc/nodes
// use shared/build/tree/forest
// use shared/build/scan
// use shared/build/pass
// const GROUP

@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> scratch: array<u32>;
@group(0) @binding(4) var<uniform> iteration: Iteration;
@group(0) @binding(5) var<storage, read_write> clusters_out: array<Cluster>;
@group(0) @binding(8) var<storage, read_write> pass_out: NextPass;

/// Kept clusters before the tile, and in all tiles.
var<workgroup> n_before: atomic<u32>;
var<workgroup> n_all: atomic<u32>;

@compute @workgroup_size(GROUP)
fn main(id: Invocation) {
    let tile = slice.first + group_index(id);
    let local = id.local;
    let start = tile * GROUP;
    let n = atomicLoad(&states[remaining_at(iteration)]);
    let n_tiles = (n + GROUP - 1u) / GROUP;
    let own_block = tile / BLOCK;
    for (var block = local; block * BLOCK < n_tiles; block += GROUP) {
        let kept = atomicLoad(&states[block_at(iteration, block)]);
        atomicAdd(&n_all, kept);
        if block < own_block {
            atomicAdd(&n_before, kept);
        }
    }
    for (var other = own_block * BLOCK + local; other < tile; other += GROUP) {
        atomicAdd(&n_before, scratch[iteration.n_items + other]);
    }
    let i = start + local;
    var partner = 0u;
    var word = 0u;
    var keeps = 0u;
    if i < n {
        word = scratch[i];
        partner = word & PARTNER;
        keeps = select(1u, 0u, (word & IS_MERGED) != 0u && partner < i);
    }
    // The barriers of the scan are for the sums above, too.
    let place = scan_group(local, keeps).before + atomicLoad(&n_before);
    let n_left = atomicLoad(&n_all);
    if keeps == 1u {
        var own = clusters[i];
        if (word & IS_MERGED) != 0u {
            let other = clusters[partner];
            own = merged(own, other, n_below(own.word), n_below(other.word));
        }
        clusters_out[place] = own;
        if (word & IS_FIRST) != 0u {
            put_next_state(tree_of(own.number), place, n_left);
        }
    }
    if tile == 0u && local == 0u {
        atomicStore(&states[remaining_at(iteration) + 1u], n_left);
        atomicStore(&states[done_at()], iteration.number + 1u);
    }
}

/// The clusters of a tree, from `first` on, among `n_left` of all trees.
fn put_next_state(tree: u32, first: u32, n_left: u32) {
    let before = state_of(tree);
    let n_of_before = before.end - before.first;
    let n = n_of_before - atomicLoad(&states[merged_at(tree)]);
    let is_forced = is_forced_after(n_of_before, n, before.is_forced != 0u);
    put_state(tree, TreeState(first, first + n, select(0u, 1u, is_forced)));
    if n > FEW_CLUSTERS {
        let rows = rows_of((n_left + GROUP - 1u) / GROUP);
        atomicMax(&pass_out.groups_x, rows.x);
        atomicMax(&pass_out.groups_y, rows.y);
    }
}

// part finish
// Clustering, all further iterations: one work-group for each tree.
//
// Trees of more clusters than the work-group has invocations stay in device memory, until there are that few.
// Reads: clusters, on the side that the last iteration wrote.
// Writes: nodes.
// use shared/build/ploc
// use shared/build/ploc/states
// use shared/build/ploc/nodes
// use shared/build/tree/forest
// use shared/build/scan
// const GROUP

@group(0) @binding(1) var<storage, read_write> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read_write> scratch: array<u32>;
@group(0) @binding(4) var<uniform> iteration: Iteration;
@group(0) @binding(5) var<storage, read_write> clusters_out: array<Cluster>;

/// The clusters, and the leaves below each.
var<workgroup> group_clusters: array<Cluster, GROUP>;
var<workgroup> group_below: array<u32, GROUP>;
var<workgroup> group_partners: array<u32, GROUP>;
var<workgroup> group_state: TreeState;
/// Iterations so far. Those of even numbers have their clusters in `clusters`, others in `clusters_out`.
var<workgroup> n_done: u32;

fn cluster_at(is_odd: bool, i: u32) -> Cluster {
    if is_odd {
        return clusters_out[i];
    }
    return clusters[i];
}

fn put_cluster(is_odd: bool, i: u32, cluster: Cluster) {
    if is_odd {
        clusters_out[i] = cluster;
    } else {
        clusters[i] = cluster;
    }
}

/// The partner of cluster `at` of many.
fn far_partner_of(state: TreeState, at: u32, is_odd: bool, radius: u32) -> u32 {
    let n = state.end - state.first;
    if state.is_forced != 0u {
        return select(at, at ^ 1u, (at ^ 1u) < n);
    }
    let own = cluster_at(is_odd, state.first + at);
    let last = min(at + radius, n - 1u);
    var nearest = NOT_NEAR;
    for (var other = max(at, radius) - radius; other <= last; other++) {
        if other != at {
            nearest = nearer(nearest, Nearness(union_area(own, cluster_at(is_odd, state.first + other)), at ^ other));
        }
    }
    return at ^ nearest.difference;
}

/// The partner of cluster `at` of few.
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
            state = state_of(tree);
        }
        group_state = state;
        n_done = atomicLoad(&states[done_at()]);
    }
    var step = iteration;
    step.number = workgroupUniformLoad(&n_done);
    loop {
        let state = workgroupUniformLoad(&group_state);
        let n = state.end - state.first;
        if n <= GROUP {
            break;
        }
        let is_odd = (step.number & 1u) == 1u;
        for (var at = local; at < n; at += GROUP) {
            scratch[state.first + at] = far_partner_of(state, at, is_odd, radius_of(step));
        }
        storageBarrier(); // Shared in this work-group.
        var n_kept = 0u;
        for (var tile = 0u; tile < n; tile += GROUP) {
            let at = tile + local;
            var keeps = 0u;
            var own: Cluster;
            if at < n {
                let partner = scratch[state.first + at];
                let is_merged = partner != at && scratch[state.first + partner] == at;
                keeps = select(1u, 0u, is_merged && partner < at);
                if keeps == 1u {
                    own = cluster_at(is_odd, state.first + at);
                    if is_merged {
                        let other = cluster_at(is_odd, state.first + partner);
                        own = merged(own, other, n_below(own.word), n_below(other.word));
                    }
                }
            }
            let scanned = scan_group(local, keeps);
            if keeps == 1u {
                put_cluster(!is_odd, state.first + n_kept + scanned.before, own);
            }
            n_kept += scanned.total;
        }
        storageBarrier(); // Shared in this work-group.
        if local == 0u {
            let is_forced = is_forced_after(n, n_kept, state.is_forced != 0u);
            group_state = TreeState(state.first, state.first + n_kept, select(0u, 1u, is_forced));
        }
        step.number += 1u;
    }
    let few = workgroupUniformLoad(&group_state);
    if local < few.end - few.first {
        let own = cluster_at((step.number & 1u) == 1u, few.first + local);
        group_clusters[local] = own;
        group_below[local] = n_below(own.word);
    }
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
            n_leaves = group_below[local];
            if is_merged && keeps == 1u {
                own = merged(own, group_clusters[partner], n_leaves, group_below[partner]);
                n_leaves += group_below[partner];
            }
        }
        let scanned = scan_group(local, keeps);
        if keeps == 1u {
            group_clusters[scanned.before] = own;
            group_below[scanned.before] = n_leaves;
        }
        if local == 0u {
            let is_forced = is_forced_after(n, scanned.total, state.is_forced != 0u);
            group_state = TreeState(state.first, state.first + scanned.total, select(0u, 1u, is_forced));
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
