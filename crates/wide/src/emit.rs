//! From a plan to records: first where everything stands, then, on all threads, what it holds.

use canted_lbvh::{Child, ChildKind, Corners, Tree};
use canted_obb::{Aabb, PrimId};
use canted_trace::Slabs;

use crate::Sizes;
use crate::collapse::{Form, Plan};
use crate::layout::{
    HALF_WORDS, Half, Line, MAX_LEAF, NOWHERE, NodeKind, PART_LANES, PARTS, Row, Word, WordKind, node_words,
};
use crate::par;
use crate::share::shared_frame;

/// A wide node before it is written: its place and its children.
#[derive(Clone, Debug)]
struct Draft {
    kind: NodeKind,
    line: usize,
    /// Of a shared node.
    frame: Option<[[f32; 3]; 3]>,
    children: Vec<(Child, Word)>,
}

/// A leaf before it is written: the part of a place that it starts with, and its primitives in leaf order.
#[derive(Clone, Copy, Debug)]
struct LeafDraft {
    first: usize,
    start: u32,
    end: u32,
}

/// What boxes are written from.
pub(crate) struct Source<'a> {
    /// Whether nodes may share one frame among their children.
    pub(crate) share: bool,
    /// Brings the largest extent to about 1.
    pub(crate) scale: f32,
    pub(crate) tree: &'a Tree,
    /// Vertices in leaf order; empty where primitives are not triangles.
    pub(crate) corners: &'a [Corners],
    /// Primitive of each leaf.
    pub(crate) primitives: &'a [PrimId],
    /// Boxes in the mesh's frame, rounded outward: of leaves, and of inner nodes by their number.
    pub(crate) leaf_boxes: &'a [Aabb],
    pub(crate) inner_boxes: &'a [Aabb],
    /// Frames of leaves and inner nodes.
    pub(crate) frames: &'a (dyn Fn(Child) -> [[f32; 3]; 3] + Sync),
}

/// Nodes and leaves as rays walk through them.
#[derive(Clone, Debug)]
pub(crate) struct Records {
    pub(crate) lines: Vec<Line>,
    pub(crate) halves: Vec<Half>,
    pub(crate) root: Word,
    /// Nodes on the longest way from the root to a leaf, the leaf left out.
    pub(crate) depth: u32,
}

impl Records {
    /// Sizes, by a walk over all nodes.
    pub(crate) fn sizes(&self) -> Sizes {
        let mut sizes = Sizes {
            nodes: [0; 3],
            node_bytes: size_of_val(&self.lines[..]),
            block_bytes: size_of_val(&self.halves[..]),
            depth: self.depth,
        };
        let mut open = vec![self.root];
        while let Some(word) = open.pop() {
            if let WordKind::Node(kind, line) = word.kind() {
                sizes.nodes[kind as usize] += 1;
                open.extend_from_slice(node_words(&self.lines, kind, line));
            }
        }
        sizes
    }
}

/// A tree has more records than its references can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooLarge;

/// Half-blocks that hold `n` triangles.
pub(crate) fn n_halves(n: usize) -> usize {
    n.div_ceil(4)
}

/// What leaves hold.
pub(crate) trait LeafForm {
    /// What a leaf takes some of.
    type Place: Copy + Send;
    const UNSET: Self::Place;
    /// Parts of one that words can name.
    const PARTS: usize;
    /// Most primitives of a leaf that takes one part only.
    const IN_PART: usize;

    /// How many of them `n` primitives take.
    fn n_places(n: usize) -> usize;

    /// Writes the primitives of these places in leaf order, from a part of `out` on.
    fn write(source: &Source, places: &[u32], part: usize, out: &mut [Self::Place]);
}

/// Leaves hold half-blocks of triangles.
enum Triangles {}

impl LeafForm for Triangles {
    type Place = Half;
    const UNSET: Half = Half([0; HALF_WORDS]);
    const PARTS: usize = PARTS;
    const IN_PART: usize = PART_LANES;

    fn n_places(n: usize) -> usize {
        n_halves(n)
    }

    fn write(source: &Source, places: &[u32], part: usize, out: &mut [Half]) {
        write_triangles(source, places, part, out);
    }
}

/// Leaves hold numbers of primitives.
pub(crate) enum Numbers {}

impl LeafForm for Numbers {
    type Place = PrimId;
    const UNSET: PrimId = PrimId(0);
    const PARTS: usize = 1;
    const IN_PART: usize = 0;

    fn n_places(n: usize) -> usize {
        n
    }

    fn write(source: &Source, places: &[u32], _: usize, out: &mut [PrimId]) {
        for (out, &place) in out.iter_mut().zip(places) {
            *out = source.primitives[place as usize];
        }
    }
}

/// Writes the wide tree of `plan` over triangles.
pub(crate) fn emit(source: &Source, plan: &Plan) -> Result<Records, TooLarge> {
    let (records, halves) = emit_as::<Triangles>(source, plan)?;
    Ok(Records { halves, ..records })
}

/// Writes the wide tree of `plan`, and apart from it what its leaves hold.
pub(crate) fn emit_as<L: LeafForm>(source: &Source, plan: &Plan) -> Result<(Records, Vec<L::Place>), TooLarge> {
    let (drafts, leaves, root, depth) = layout::<L>(source, plan)?;
    let n_lines = drafts.last().map_or(0, |draft| draft.line + draft.kind.n_lines());
    let n_places = leaves.last().map_or(0, |leaf| leaf.first / L::PARTS + L::n_places(leaf.n(source)));
    let mut lines = vec![Line([0; 16]); n_lines];
    let mut places = vec![L::UNSET; n_places];
    let write_node = |draft: &Draft, out: &mut [Line]| write_node(source, draft, out);
    par::for_pieces(&drafts, &mut lines, |draft| draft.line, write_node);
    // Leaves that share a place are written by one job.
    let together: Vec<&[LeafDraft]> = leaves.chunk_by(|a, b| a.first / L::PARTS == b.first / L::PARTS).collect();
    let write_leaves = |leaves: &&[LeafDraft], out: &mut [L::Place]| {
        for leaf in *leaves {
            let (places, n) = distinct(source, leaf.start, leaf.end);
            L::write(source, &places[..n], leaf.first % L::PARTS, out);
        }
    };
    par::for_pieces(&together, &mut places, |leaves| leaves[0].first / L::PARTS, write_leaves);
    Ok((Records { lines, halves: Vec::new(), root, depth }, places))
}

impl LeafDraft {
    /// Number of different primitives.
    fn n(&self, source: &Source) -> usize {
        distinct(source, self.start, self.end).1
    }
}

/// Places of a leaf's primitives, each primitive once, and their number: references may share one.
fn distinct(source: &Source, start: u32, end: u32) -> ([u32; MAX_LEAF], usize) {
    let mut places = [0; MAX_LEAF];
    let mut n = 0;
    for place in start..end {
        let primitive = source.primitives[place as usize];
        if !places[..n].iter().any(|&p| source.primitives[p as usize] == primitive) {
            places[n] = place;
            n += 1;
        }
    }
    (places, n)
}

pub(crate) fn range(tree: &Tree, child: Child) -> (u32, u32) {
    match child.kind() {
        ChildKind::Leaf(place) => (place, place + 1),
        ChildKind::Inner(id) => {
            let node = &tree.nodes[id.index()];
            (node.first, node.last + 1)
        }
    }
}

/// Places given to leaves so far.
#[derive(Default)]
struct Given {
    n_places: usize,
    /// The second part of a place whose first is taken.
    free: Option<usize>,
}

impl Given {
    /// The part that a leaf of `n` primitives starts with.
    fn next<L: LeafForm>(&mut self, n: usize) -> Result<usize, TooLarge> {
        if let Some(part) = self.free.take_if(|_| n <= L::IN_PART) {
            return Ok(part);
        }
        let first = L::PARTS * self.n_places;
        self.n_places += L::n_places(n);
        if n <= L::IN_PART {
            self.free = Some(first + 1);
        }
        if L::PARTS * self.n_places > Word::MAX_FIRST { Err(TooLarge) } else { Ok(first) }
    }
}

/// Gives every node and leaf its place, depth first, larger children first; leaves are sorted by theirs.
fn layout<L: LeafForm>(source: &Source, plan: &Plan) -> Result<(Vec<Draft>, Vec<LeafDraft>, Word, u32), TooLarge> {
    let (mut drafts, mut leaves): (Vec<Draft>, Vec<LeafDraft>) = (vec![], vec![]);
    let Some(root) = source.tree.root() else { return Ok((drafts, leaves, Word::EMPTY, 0)) };
    let (mut n_lines, mut given, mut deepest) = (0, Given::default(), 0);
    let mut root_word = Word::EMPTY;
    // The subtree, its parent's kind, the slot that waits for its word, and its depth.
    let mut open = vec![(root, NodeKind::Box, None, 0u32)];
    while let Some((child, parent_kind, slot, depth)) = open.pop() {
        let word = match plan.form(child, parent_kind) {
            Form::Leaf => {
                let (start, end) = range(source.tree, child);
                let (_, n) = distinct(source, start, end);
                let first = given.next::<L>(n)?;
                leaves.push(LeafDraft { first, start, end });
                Word::leaf(first, n)
            }
            Form::Node(kind) => {
                let mut children = plan.children(child, kind);
                children.sort_by(|&a, &b| plan.area(b, kind).total_cmp(&plan.area(a, kind)));
                let frame = (kind == NodeKind::Lean && source.share)
                    .then(|| shared_frame(source, plan, child, &children))
                    .flatten();
                let kind = if frame.is_some() { NodeKind::Shared } else { kind };
                let line = n_lines;
                n_lines += kind.n_lines();
                if n_lines > Word::MAX_LINE {
                    return Err(TooLarge);
                }
                let index = drafts.len();
                // The stack gives back the last first.
                open.extend(children.iter().enumerate().rev().map(|(i, &c)| (c, kind, Some((index, i)), depth + 1)));
                deepest = deepest.max(depth + 1);
                let children = children.into_iter().map(|c| (c, Word::EMPTY)).collect();
                drafts.push(Draft { kind, line, frame, children });
                Word::node(kind, line)
            }
        };
        match slot {
            None => root_word = word,
            Some((draft, i)) => drafts[draft].children[i].1 = word,
        }
    }
    leaves.sort_unstable_by_key(|leaf| leaf.first);
    Ok((drafts, leaves, root_word, deepest))
}

fn write_node(source: &Source, draft: &Draft, out: &mut [Line]) {
    let rows: &mut [Row] = bytemuck::cast_slice_mut(out);
    let word_row = match draft.kind {
        NodeKind::Box => {
            write_boxes(&mut rows[..6], |i| {
                let aabb = aligned_box(source, draft.children.get(i)?.0);
                Some((aabb.min, aabb.max))
            });
            6
        }
        NodeKind::Shared => {
            let frame = draft.frame.unwrap_or(canted_obb::Obb::IDENTITY_FRAME);
            for (i, &x) in frame.as_flattened().iter().enumerate() {
                rows[i / 8][i % 8] = x;
            }
            write_boxes(&mut rows[2..8], |i| {
                let slabs = slabs_of(source, draft.children.get(i)?.0, frame);
                Some((slabs.lo, slabs.hi))
            });
            8
        }
        NodeKind::Lean => {
            let slabs = |&(child, _): &(Child, Word)| slabs_of(source, child, (source.frames)(child));
            for i in 0..8 {
                write_slabs(rows, i, draft.children.get(i).map(slabs).as_ref());
            }
            15
        }
    };
    for (i, slot) in rows[word_row].iter_mut().enumerate() {
        let word = draft.children.get(i).map_or(Word::EMPTY, |&(_, word)| word);
        *slot = f32::from_bits(word.0);
    }
}

fn aligned_box(source: &Source, child: Child) -> Aabb {
    match child.kind() {
        ChildKind::Leaf(place) => source.leaf_boxes[place as usize],
        ChildKind::Inner(id) => source.inner_boxes[id.index()],
    }
}

/// Rows lo x, hi x, lo y, hi y, lo z, hi z; slots without a box hold one that no ray enters.
pub(crate) fn write_boxes(rows: &mut [Row], bounds: impl Fn(usize) -> Option<([f32; 3], [f32; 3])>) {
    for i in 0..8 {
        let (lo, hi) = bounds(i).unwrap_or(([NOWHERE; 3], [-NOWHERE; 3]));
        for (k, planes) in rows.chunks_exact_mut(2).enumerate() {
            planes[0][i] = lo[k];
            planes[1][i] = hi[k];
        }
    }
}

/// A box with these rows around all vertices below a child.
fn slabs_of(source: &Source, child: Child, rows: [[f32; 3]; 3]) -> Slabs {
    let (start, end) = range(source.tree, child);
    Slabs::of_points(rows, source.corners[start as usize..end as usize].iter().flatten().copied())
}

/// For each axis a row, a centre and a half-extent; a slot without a box holds one that no ray enters.
pub(crate) fn write_slabs(rows: &mut [Row], i: usize, slabs: Option<&Slabs>) {
    for k in 0..3 {
        let (row, (center, half)) = match slabs {
            Some(slabs) => (slabs.rows[k], middle(slabs.lo[k], slabs.hi[k])),
            None => ([0.0; 3], (0.0, -NOWHERE)),
        };
        for axis in 0..3 {
            rows[5 * k + axis][i] = row[axis];
        }
        rows[5 * k + 3][i] = center;
        rows[5 * k + 4][i] = half;
    }
}

/// An interval by its middle and a half-extent that reaches both ends.
#[expect(clippy::cast_possible_truncation, reason = "the half-extent is taken from the rounded middle, and upward")]
fn middle(lo: f32, hi: f32) -> (f32, f32) {
    let center = (0.5 * (f64::from(lo) + f64::from(hi))) as f32;
    // Differences of f32 are exact in f64 but for a last bit, which the step upward covers.
    let reach = (f64::from(hi) - f64::from(center)).max(f64::from(center) - f64::from(lo)).next_up();
    let half = reach as f32;
    (center, if f64::from(half) < reach { half.next_up() } else { half })
}

fn write_triangles(source: &Source, places: &[u32], part: usize, out: &mut [Half]) {
    let n = places.len();
    let words: &mut [u32] = bytemuck::cast_slice_mut(out);
    for (i, &place) in places.iter().enumerate() {
        // Blocks of eight lie before a last block of four.
        let in_four = i / 8 * 8 + 4 >= n;
        let (block, width) = if in_four { (i / 4 * 40, 4) } else { (i / 8 * 80, 8) };
        let lane = part * PART_LANES + i % width;
        let vertices = source.corners[place as usize].as_flattened();
        for (row, &x) in vertices.iter().enumerate() {
            words[block + row * width + lane] = x.to_bits();
        }
        words[block + 9 * width + lane] = source.primitives[place as usize].0;
    }
}
