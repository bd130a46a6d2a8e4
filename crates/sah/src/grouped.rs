//! Trees over groups: boxes -> runs of neighbors -> { bins, codes } -> tree whose leaves hold several primitives.
//!
//! Meshes list neighbors one after the other: the triangles of a quad, of a strip, of a row of a grid. A run whose box is
//! small is one reference, so that there are fewer references to sort into bins and to move.

use canted_lbvh::{Child, Node, NodeId, Sorted, Task, Tree, stages::stage};
use canted_obb::{Aabb, PrimId};

use crate::{
    ReinsertConfig, Split, TopDownConfig, curve, par,
    reference::{Bounds, Reference, unit_scale},
    reinsert,
    top_down::{Span, split},
};

/// Where [`grouped()`] splits primitives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupSplit {
    /// Between bins, at least SAH cost.
    Binned {
        /// Bins per axis, 2 to 64.
        bins: u32,
    },
    /// Where the Morton codes of box centers differ in the highest bit: several times faster, with more area.
    Morton,
}

/// How [`grouped()`] builds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupConfig {
    /// Where primitives are split.
    pub split: GroupSplit,
    /// Maximum number of primitives of a group, at least 1.
    pub max_group: u32,
    /// Consecutive primitives that stay together where their common box is small, at most; a power of two, 1 for none.
    pub max_run: u32,
    /// Reinsertion of groups and of subtrees above them; `None` for none.
    pub improvement: Option<ReinsertConfig>,
}

impl GroupConfig {
    /// A tree over Morton codes, for geometry that is built again for each frame.
    pub const DYNAMIC: Self = Self { split: GroupSplit::Morton, max_group: 8, max_run: 2, improvement: None };

    /// Few bins, groups that fill a block of eight; moving those takes a tenth of a build and saves up to 30 % of visits.
    pub const FAST: Self = Self {
        split: GroupSplit::Binned { bins: 16 },
        max_group: 8,
        max_run: 2,
        improvement: Some(ReinsertConfig::BALANCED),
    };

    /// Groups of two, which keep rectangles together.
    pub const BALANCED: Self = Self { split: GroupSplit::Binned { bins: 32 }, max_group: 2, max_run: 2, ..Self::FAST };

    /// The least cost.
    pub const QUALITY: Self = Self { improvement: Some(ReinsertConfig::QUALITY), ..Self::BALANCED };
}

/// A binary tree whose leaves are groups of primitives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Groups {
    /// The primitives in leaf order.
    pub primitives: Vec<PrimId>,
    /// Where each leaf starts in `primitives`, then the number of primitives.
    pub starts: Vec<u32>,
    /// The box around each group, in leaf order.
    pub boxes: Vec<Aabb>,
}

/// Builds a tree from the root down that stops at groups of primitives: several times faster than one with a primitive per
/// leaf.
///
/// Reads: a finite box for each primitive; an array that is given by value is freed as early as possible. Writes: a tree whose leaf `i` refers to group `i`, and the groups. Holds: as for
/// [`crate::top_down()`], with binned splits, or as for a radix tree.
/// Source: Wald 2007, with parallel subtrees; Karras 2012 for splits by Morton codes.
#[must_use]
pub fn grouped(boxes: impl AsRef<[Aabb]>, config: &GroupConfig) -> (Tree, Groups) {
    let (tree, groups) = stage("splitting", || divided(boxes.as_ref(), config));
    // Boxes that are handed over are freed before groups move.
    drop(boxes);
    improved(tree, groups, config.improvement.as_ref())
}

/// The tree and its groups before any is moved.
fn divided(boxes: &[Aabb], config: &GroupConfig) -> (Tree, Groups) {
    let n = boxes.len();
    if n == 0 {
        let tree = Tree { nodes: vec![], leaves: vec![], bottom_up: vec![], tasks: vec![], depth: 0 };
        return (tree, Groups { primitives: vec![], starts: vec![0], boxes: vec![] });
    }
    let scale = unit_scale(boxes).unwrap_or(1.0);
    let max_group = config.max_group.max(1);
    let references = runs(boxes, scale, config.max_run.min(max_group));
    let max_part = MAX_PART.max(references.len().div_ceil(256));
    let builder = Builder { boxes, max_group, max_part };
    // References are freed before parts are joined, and parts before groups move: each takes as much memory as a BVH.
    assemble(builder.parts(references, config.split), n)
}

impl Builder<'_> {
    /// The parts of the tree over these runs.
    fn parts(&self, mut references: Vec<Reference>, split: GroupSplit) -> Parts {
        match split {
            GroupSplit::Binned { bins } => {
                let mut scratch = par::filled(references.len(), references[0]);
                let split = Split::Binned { bins, sweep_threshold: 0 };
                let config = TopDownConfig { split, ..TopDownConfig::BINNED };
                let span = Span { references: &mut references, scratch: &mut scratch };
                self.divide(Binned { span, config: &config }, 1, false)
            }
            GroupSplit::Morton => {
                let (references, codes) = along_curve(references);
                self.divide(Coded { references: &references, codes: &codes }, 1, false)
            }
        }
    }
}

/// Moves groups where that saves area; renumbers them in leaf order.
fn improved(tree: Tree, groups: Groups, config: Option<&ReinsertConfig>) -> (Tree, Groups) {
    let Some(config) = config else { return (tree, groups) };
    let tree = reinsert(&tree, &groups.boxes, config);
    stage("reinsertion: new groups", || reordered(tree, groups))
}

/// Groups in the order of the leaves of a tree, whose leaves are renumbered by that.
fn reordered(mut tree: Tree, groups: Groups) -> (Tree, Groups) {
    let mut moved = Groups {
        primitives: par::filled(groups.primitives.len(), PrimId(0)),
        starts: vec![0; groups.starts.len()],
        boxes: par::map(&tree.leaves, CHUNK, |group| groups.boxes[group.index()]),
    };
    let mut end = 0;
    for (leaf, start) in tree.leaves.iter().zip(&mut moved.starts[1..]) {
        let (from, to) = (groups.starts[leaf.index()], groups.starts[leaf.index() + 1]);
        end += to - from;
        *start = end;
    }
    let starts: Vec<(usize, PrimId)> =
        moved.starts.iter().map(|&start| start as usize).zip(tree.leaves.iter().copied()).collect();
    par::for_pieces(
        &starts,
        &mut moved.primitives,
        |&(start, _)| start,
        |&(_, group), out| {
            let from = groups.starts[group.index()] as usize;
            out.copy_from_slice(&groups.primitives[from..from + out.len()]);
        },
    );
    for (leaf, i) in tree.leaves.iter_mut().zip(0..) {
        *leaf = PrimId(i);
    }
    (tree, moved)
}

impl Groups {
    /// Number of groups.
    #[must_use]
    pub fn n_groups(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }
}

/// Boxes or groups per job.
const CHUNK: usize = 1 << 13;

/// Maximum number of primitives of a part; larger meshes have larger parts.
const MAX_PART: usize = 1 << 12;

/// An inner node over groups or parts `first..=last`, the left child over those up to `split`.
#[derive(Clone, Copy)]
struct Raw {
    first: u32,
    split: u32,
    last: u32,
    is_left: bool,
}

impl Raw {
    /// The node and its number, with groups numbered from `base` on; `ends[i]` is the last group of item `i`.
    fn node(&self, first: u32, split: u32, last: u32) -> (NodeId, Node) {
        let id = NodeId(if self.is_left { last } else { first });
        let left = if first == split { Child::leaf(first) } else { Child::inner(NodeId(split)) };
        let right = if split + 1 == last { Child::leaf(last) } else { Child::inner(NodeId(split + 1)) };
        (id, Node { left, right, first, last })
    }
}

/// A subtree that one thread builds: primitives, boxes and sizes of its groups in leaf order, nodes over its groups, children before
/// parents.
#[derive(Default)]
struct Part {
    primitives: Vec<PrimId>,
    boxes: Vec<Aabb>,
    sizes: Vec<u32>,
    nodes: Vec<Raw>,
    height: u32,
}

impl Part {
    /// Frees what arrays have grown beyond: together as much as all parts take.
    fn shrink(&mut self) {
        self.primitives.shrink_to_fit();
        self.boxes.shrink_to_fit();
        self.sizes.shrink_to_fit();
        self.nodes.shrink_to_fit();
    }
}

/// Parts in leaf order, nodes over them, children before parents, and the height of the whole.
struct Parts {
    parts: Vec<Part>,
    nodes: Vec<Raw>,
    height: u32,
}

struct Builder<'a> {
    /// Of all primitives.
    boxes: &'a [Aabb],
    max_group: u32,
    max_part: usize,
}

impl Builder<'_> {
    /// Splits until parts are small, and builds those in parallel.
    fn divide<S: Divide>(&self, span: S, depth: u32, is_left: bool) -> Parts {
        let n = span.references().len();
        if n <= self.max_part {
            let mut part = Part { primitives: Vec::with_capacity(2 * n), ..Part::default() };
            part.height = self.part(span, depth, is_left, &mut part);
            part.shrink();
            let height = part.height;
            return Parts { parts: vec![part], nodes: vec![], height };
        }
        let [left, right] = span.divided(depth);
        let (mut left, mut right) =
            par::join(|| self.divide(left, depth + 1, true), || self.divide(right, depth + 1, false));
        let [n_left, n_right] = [&left, &right].map(|side| index(side.parts.len()));
        left.parts.append(&mut right.parts);
        let shifted = |node: &Raw| Raw {
            first: node.first + n_left,
            split: node.split + n_left,
            last: node.last + n_left,
            ..*node
        };
        left.nodes.extend(right.nodes.iter().map(shifted));
        left.nodes.push(Raw { first: 0, split: n_left - 1, last: n_left + n_right - 1, is_left });
        Parts { height: 1 + left.height.max(right.height), ..left }
    }

    /// Builds a subtree on one thread; returns its height in nodes, the group included.
    fn part<S: Divide>(&self, span: S, depth: u32, is_left: bool, part: &mut Part) -> u32 {
        if self.is_group(span.references()) {
            let before = part.primitives.len();
            let mut around = Aabb::EMPTY;
            for run in span.references() {
                let members = run.primitive()..run.primitive() + run.n();
                around = members.clone().fold(around, |all, i| all.union(self.boxes[i as usize]));
                part.primitives.extend(members.map(PrimId));
            }
            part.sizes.push(index(part.primitives.len() - before));
            part.boxes.push(around);
            return 1;
        }
        let first = index(part.sizes.len());
        let [left, right] = span.divided(depth);
        let left = self.part(left, depth + 1, true, part);
        let split = index(part.sizes.len()) - 1;
        let right = self.part(right, depth + 1, false, part);
        let last = index(part.sizes.len()) - 1;
        part.nodes.push(Raw { first, split, last, is_left });
        1 + left.max(right)
    }

    /// Whether runs have no more primitives than a group.
    fn is_group(&self, runs: &[Reference]) -> bool {
        runs.len() <= self.max_group as usize && runs.iter().map(Reference::n).sum::<u32>() <= self.max_group
    }
}

fn index(n: usize) -> u32 {
    n as u32
}

/// The tree over the groups of all parts, and the groups, of `n` primitives.
fn assemble(Parts { parts, nodes: above, height }: Parts, n: usize) -> (Tree, Groups) {
    let n_groups: usize = parts.iter().map(|part| part.sizes.len()).sum();
    let unset = Node { left: Child::leaf(0), right: Child::leaf(0), first: 0, last: 0 };
    let mut nodes = vec![unset; n_groups];
    let mut bottom_up = vec![NodeId(0); n_groups - 1];
    let mut starts = vec![0; n_groups + 1];
    let mut primitives = par::filled(n, PrimId(0));
    let mut boxes = par::filled(n_groups, Aabb::EMPTY);
    let (mut nodes_left, mut order_left, mut starts_left) = (&mut nodes[..], &mut bottom_up[..], &mut starts[1..]);
    let (mut primitives_left, mut boxes_left) = (&mut primitives[..], &mut boxes[..]);
    let (mut jobs, mut tasks, mut ends) = (vec![], vec![], vec![]);
    let (mut base, mut n_done, mut start) = (0, 0, 0);
    for part in &parts {
        let n = part.sizes.len();
        let (own_nodes, rest) = nodes_left.split_at_mut(n);
        let (own_order, order_rest) = order_left.split_at_mut(n - 1);
        let (own_starts, starts_rest) = starts_left.split_at_mut(n);
        let (own_primitives, primitives_rest) = primitives_left.split_at_mut(part.primitives.len());
        let (own_boxes, boxes_rest) = boxes_left.split_at_mut(n);
        (primitives_left, boxes_left) = (primitives_rest, boxes_rest);
        (nodes_left, order_left, starts_left) = (rest, order_rest, starts_rest);
        tasks.push(Task { leaves: base..base + index(n), nodes: n_done..n_done + n - 1 });
        jobs.push((part, base, start, own_nodes, own_order, own_starts, own_primitives, own_boxes));
        (base, n_done) = (base + index(n), n_done + n - 1);
        start += index(part.primitives.len());
        ends.push(base);
    }
    for (raw, slot) in above.iter().zip(order_left) {
        // Bounds between parts are bounds between groups.
        let first = raw.first.checked_sub(1).map_or(0, |before| ends[before as usize]);
        *slot = raw.node(first, ends[raw.split as usize] - 1, ends[raw.last as usize] - 1).0;
    }
    par::for_jobs(jobs, |(part, base, mut start, nodes, order, starts, primitives, boxes)| {
        primitives.copy_from_slice(&part.primitives);
        boxes.copy_from_slice(&part.boxes);
        for (raw, slot) in part.nodes.iter().zip(order) {
            let (id, node) = raw.node(base + raw.first, base + raw.split, base + raw.last);
            nodes[(id.0 - base) as usize] = node;
            *slot = id;
        }
        for (size, slot) in part.sizes.iter().zip(starts) {
            start += size;
            *slot = start;
        }
    });
    for raw in &above {
        let first = raw.first.checked_sub(1).map_or(0, |before| ends[before as usize]);
        let (id, node) = raw.node(first, ends[raw.split as usize] - 1, ends[raw.last as usize] - 1);
        nodes[id.index()] = node;
    }
    nodes.pop();
    let leaves = (0..index(n_groups)).map(PrimId).collect();
    (Tree { nodes, leaves, bottom_up, tasks, depth: height }, Groups { primitives, starts, boxes })
}

/// Primitives of one job. Runs end where jobs end, whatever the number of threads.
const PRIMITIVES_PER_JOB: usize = 1 << 13;

/// Area of the common box of a run, relative to the sum of those of its parts, at most. At 1, a leaf that holds both parts costs
/// rays no more than two leaves; less keeps the halves of a slanted quad apart, whose boxes hardly overlap (`benches/TRIED.md`).
const MAX_AREA: f32 = 0.75;

/// One reference for each run of at most `max_run` primitives, with boxes in units of `1 / scale`.
///
/// Neighboring runs are joined, pairs first, then pairs of pairs, where the area of their common box is small enough.
pub(crate) fn runs(boxes: &[Aabb], scale: f32, max_run: u32) -> Vec<Reference> {
    let of = |first: usize, boxes: &[Aabb]| -> Vec<Reference> {
        let single = |(i, aabb): (usize, &Aabb)| Reference::new(index(first + i), aabb, scale);
        let mut runs: Vec<Reference> = boxes.iter().enumerate().map(single).collect();
        let mut limit = 2;
        while limit <= max_run {
            join_neighbors(&mut runs, limit);
            limit *= 2;
        }
        runs.shrink_to_fit();
        runs
    };
    let parts = par::map_chunks(boxes, PRIMITIVES_PER_JOB, of);
    let n = parts.iter().map(Vec::len).sum();
    let Some(&first) = parts.first().and_then(|part| part.first()) else { return vec![] };
    let mut all = par::filled(n, first);
    let mut jobs = Vec::with_capacity(parts.len());
    let mut rest = &mut all[..];
    for part in &parts {
        let (own, after) = std::mem::take(&mut rest).split_at_mut(part.len());
        jobs.push((part, own));
        rest = after;
    }
    par::for_jobs(jobs, |(part, own)| own.copy_from_slice(part));
    all
}

/// Joins each run with the next where both are small and have at most `limit` primitives, from left to right.
fn join_neighbors(runs: &mut Vec<Reference>, limit: u32) {
    let (mut read, mut written) = (0, 0);
    while read < runs.len() {
        let run = runs[read];
        read += 1;
        runs[written] = run;
        if let Some(next) = runs.get(read)
            && run.n() + next.n() <= limit
            && pays(run.bounds(), next.bounds())
        {
            runs[written] = run.joined(next);
            read += 1;
        }
        written += 1;
    }
    runs.truncate(written);
}

/// Whether the common box is small enough; boxes without area are never joined.
fn pays(a: &Bounds, b: &Bounds) -> bool {
    let sum = a.half_area() + b.half_area();
    sum > 0.0 && a.union(b).half_area() <= MAX_AREA * sum
}

/// References per job.
const REFERENCES_PER_JOB: usize = 1 << 13;

/// The runs of a node.
pub(crate) trait Divide: Sized + Send {
    fn references(&self) -> &[Reference];

    /// Those of both children of the node, which is at `depth`; at least two runs, and each child has one.
    fn divided(self, depth: u32) -> [Self; 2];
}

/// Divided between bins.
pub(crate) struct Binned<'a> {
    pub(crate) span: Span<'a>,
    pub(crate) config: &'a TopDownConfig,
}

impl Divide for Binned<'_> {
    fn references(&self) -> &[Reference] {
        self.span.references
    }

    fn divided(self, depth: u32) -> [Self; 2] {
        let Self { mut span, config } = self;
        let n_left = split(&mut span, config, depth);
        span.at(n_left).map(|span| Self { span, config })
    }
}

/// Divided where sorted codes differ in the highest bit; equal codes in halves. So the depth is that of a radix tree.
#[derive(Clone, Copy)]
pub(crate) struct Coded<'a> {
    pub(crate) references: &'a [Reference],
    pub(crate) codes: &'a [u64],
}

impl Divide for Coded<'_> {
    fn references(&self) -> &[Reference] {
        self.references
    }

    fn divided(self, _: u32) -> [Self; 2] {
        let (first, last) = (self.codes[0], self.codes[self.codes.len() - 1]);
        let n_left = match (first ^ last).checked_ilog2() {
            None => self.codes.len().div_ceil(2),
            Some(bit) => self.codes.partition_point(|code| code >> bit & 1 == 0),
        };
        let (left, right) = self.references.split_at(n_left);
        let (left_codes, right_codes) = self.codes.split_at(n_left);
        [Self { references: left, codes: left_codes }, Self { references: right, codes: right_codes }]
    }
}

/// The runs along a Morton curve, with the codes of their centers.
pub(crate) fn along_curve(references: Vec<Reference>) -> (Vec<Reference>, Vec<u64>) {
    let boxes = par::map(&references, REFERENCES_PER_JOB, Reference::aabb);
    let parts = par::map_chunks(&boxes, REFERENCES_PER_JOB, |_, boxes| around(boxes));
    let (Sorted { codes, leaves }, _) = curve::along_curve(&boxes, &around(&parts));
    (par::map(&leaves, REFERENCES_PER_JOB, |leaf| references[leaf.index()]), codes)
}

fn around(boxes: &[Aabb]) -> Aabb {
    boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(x: f32, y: f32) -> Aabb {
        Aabb { min: [x, y, 0.0], max: [x + 1.0, y + 1.0, 0.5] }
    }

    fn lengths(boxes: &[Aabb], max_run: u32) -> Vec<u32> {
        runs(boxes, 1.0, max_run).iter().map(Reference::n).collect()
    }

    #[test]
    fn equal_neighbors_are_joined_and_distant_ones_are_not() {
        let boxes = [cell(0.0, 0.0), cell(0.0, 0.0), cell(9.0, 0.0), cell(1.0, 0.0), cell(1.0, 0.0), cell(1.0, 0.0)];
        assert_eq!(lengths(&boxes, 1), [1; 6]);
        assert_eq!(lengths(&boxes, 2), [2, 1, 2, 1]);
        assert_eq!(lengths(&boxes, 4), [2, 1, 3]);
        let joined = runs(&boxes, 1.0, 4);
        assert_eq!(joined.iter().map(Reference::primitive).collect::<Vec<_>>(), [0, 2, 3]);
        assert_eq!(joined[2].aabb(), cell(1.0, 0.0));
    }

    /// Every primitive once, in order, in a run around it, also where jobs end.
    #[test]
    fn runs_partition_the_primitives() {
        let mut state = 3u64;
        let boxes: Vec<Aabb> = (0..3 * PRIMITIVES_PER_JOB + 5)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let at = |shift: u32| f32::from(u8::try_from(state >> shift & 3).unwrap());
                // Points and segments among them.
                Aabb { min: [at(40), -0.0, at(44)], max: [at(40) + at(48), 0.0, at(44) + at(52)] }
            })
            .collect();
        for max_run in [1, 2, 8] {
            let mut next = 0;
            for run in runs(&boxes, 1.0, max_run) {
                assert!(run.primitive() == next && (1..=max_run).contains(&run.n()));
                next += run.n();
                let members = run.primitive() as usize..next as usize;
                assert_eq!(run.aabb(), around(&boxes[members]), "{max_run}");
            }
            assert_eq!(next as usize, boxes.len());
        }
        let lines: Vec<Aabb> = (0..8u8).map(|i| Aabb { min: [f32::from(i), 0.0, 0.0], max: [9.0, 0.0, 0.0] }).collect();
        assert_eq!(lengths(&lines, 8), [1; 8], "boxes without area");
    }

    fn around(boxes: &[Aabb]) -> Aabb {
        boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb))
    }
}
