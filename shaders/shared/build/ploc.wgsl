// Clusters of leaves along the Morton curve, which are merged pair by pair into a tree.
//
// # The same tree as on the CPU
// A cluster's partner is the one within the radius whose union with it has the least area; of
// equals the one whose position differs in lower bits. Clusters that are each other's partner are merged, at the position of the
// first. Areas round alike on all devices, so partners are those of `canted_sah`'s `ploc`.
//
// A cluster has the number of its first leaf. A merged cluster keeps the first number; the second becomes that of the new node.
// So nodes have different numbers without a counter.
// Source: Meister and Bittner 2018.
// use shared/build/slice
// use shared/build/tree
// use shared/build/surface

struct Cluster {
    low: vec3<f32>,
    /// The first leaf.
    number: u32,
    high: vec3<f32>,
    /// The subtree: a node's number, or the position of a leaf with the highest bit.
    word: u32,
}

/// The clusters of a tree.
struct TreeState {
    first: u32,
    end: u32,
    /// Whether all neighbors are merged next, because few partners were found.
    is_forced: u32,
    padding: u32,
}

struct Iteration {
    number: u32,
    /// Clusters on each side that are compared.
    radius: u32,
    /// Iterations with `NEAR_RADIUS` instead.
    n_near: u32,
}

/// A node before it is renumbered.
struct Merge {
    left: u32,
    right: u32,
    /// Leaves below the left child, and below both.
    n_left: u32,
    n: u32,
}

const NEAR_RADIUS: u32 = 2u;

/// An iteration that merges fewer than one in this many clusters is slow, unless there are at most `FEW`.
const SLOW: u32 = 16u;
const FEW: u32 = 128u;

/// A measure for pairs of clusters: less is nearer.
struct Nearness {
    area: f32,
    /// In which bits the positions differ.
    difference: u32,
}

const NOT_NEAR = Nearness(3.0e38, 0xffffffffu);

/// The area of the union of two clusters.
fn union_area(a: Cluster, b: Cluster) -> f32 {
    return half_area_of(min(a.low, b.low), max(a.high, b.high));
}

/// The nearer one.
fn nearer(a: Nearness, b: Nearness) -> Nearness {
    if b.area < a.area || (b.area == a.area && b.difference < a.difference) {
        return b;
    }
    return a;
}

fn radius_of(iteration: Iteration) -> u32 {
    return select(iteration.radius, min(iteration.radius, NEAR_RADIUS), iteration.number < iteration.n_near);
}

/// Whether to merge all neighbors after an iteration.
fn is_forced_after(before: u32, after: u32, was_forced: bool) -> bool {
    let n_merged = before - after;
    return n_merged == 0u || (!was_forced && before > FEW && n_merged < before / SLOW);
}
