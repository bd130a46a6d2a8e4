//! The records of a BVH as words, for other devices.

use std::borrow::Cow;

use canted_obb::PrimId;
use canted_obb::vector::{dot, to_f64};
use canted_trace::TriangleTest;
use canted_trace::lanes::lower;

use super::LoadError;
use super::check::{Expected, complete_made};
use crate::build::layout::Units;
use crate::bvh::{PredictedCost, TriangleBvh, WideBvh};
use crate::config::{Baseline, Costs};
use crate::leaf::{Blocks, LeafPrimitive};
use crate::node::checked::Claims;
use crate::node::{
    CacheLine, ChildWord, DecodedWord, Flaw, HALF_BLOCK_WORDS, HalfBlock, LaneWords, LeafLayout, NOWHERE, NodeKind,
    Nodes, Row, node_words, set_word,
};
use crate::simd::AvailablePath;
use crate::traverse::MeshFrame;

/// The records of a BVH as words, for traversal without this crate: by a kernel on another device.
///
/// A word names a leaf or a node. With bit 31 set it is a leaf: bits 26 to 30 hold its number of primitives less one, bits 0 to
/// 25 where they start. Otherwise it is a node: bits 29 and 30 hold its kind in the order of
/// [`NodeKind::ALL`](crate::NodeKind::ALL), or 3 for no child; bits 0 to 28 hold its first line of sixteen words.
///
/// A node is made of rows of eight words, one per child. Aligned nodes, 8 rows: lower and upper bounds along x, y and z of
/// [`RawBvh::frame`], the child words, an unused row. Oriented nodes, 16 rows: for each of three axes its x, y and z,
/// the center and the half-extent along it; then the child words.
///
/// Boxes are those of rays on the CPU: enlarged by the part of the padding that depends on their content. A tracer with pads of its
/// own, relative to [`RawBvh::reach`], may ignore that. They are in object space: those of a BVH whose boxes are relative to a point
/// near a distant mesh are moved back, and rounded outward.
///
/// Leaves of triangles start at half of a block of four: blocks have 40 words, nine coordinates of four triangles and their
/// ids. While more than four triangles of a leaf remain, the next two blocks are one whose rows have eight words. Leaves of
/// other primitives start at an index into [`RawBvh::order`].
#[derive(Clone, Debug)]
pub struct RawBvh<'a> {
    /// Nodes, in lines of sixteen words.
    pub nodes: Cow<'a, [u32]>,
    /// Triangles, in blocks of forty words; empty for other primitives.
    pub blocks: &'a [u32],
    /// Primitives in the order of the leaves; empty for triangles.
    pub order: &'a [PrimId],
    /// The root's word.
    pub root: u32,
    /// Greatest number of nodes from the root to a leaf.
    pub depth: u32,
    /// Rows of the frame that aligned nodes are aligned with.
    pub frame: [[f32; 3]; 3],
    /// Greatest absolute coordinate of any primitive ([`canted_obb::Aabb::reach`]); box tests must allow for rounding relative to it.
    pub reach: f32,
}

impl<P: LeafPrimitive> WideBvh<P> {
    /// The records as words.
    #[must_use]
    pub fn raw(&self) -> RawBvh<'_> {
        let leaves = P::leaf_data(&self.leaves);
        RawBvh {
            nodes: in_object_space(&self.nodes, &self.frame),
            blocks: leaves.blocks,
            order: leaves.order,
            root: self.nodes.root.0,
            depth: self.nodes.depth,
            frame: self.frame.rows,
            reach: self.bounds.reach(),
        }
    }
}

impl TriangleBvh {
    /// The BVH of records that another device made, or of [`WideBvh::raw`]: with the same hierarchy, leaves and axes of boxes. Records may be
    /// anywhere, with others between them. [`RawBvh::depth`] and [`RawBvh::reach`] are not used.
    ///
    /// Each box must hold what is below it, but for a rounding. Boxes are then written anew with the padding of a build, so hits are those of any BVH
    /// over the triangles. The records may be damaged: a BVH that is returned cannot panic, loop or lose a hit. Its predicted costs are
    /// not known ([`PredictedCost::default`]).
    ///
    /// # Errors
    /// The first thing in the records that is not part of a valid BVH over triangles.
    pub fn from_raw(raw: &RawBvh<'_>, test: TriangleTest) -> Result<Self, LoadError> {
        let (mut nodes, halves) = compact(raw)?;
        let Expected { n_primitives, bounds, frame, .. } = complete_made(&mut nodes, &halves, raw.frame, test)?;
        let baseline = Baseline { costs: Costs::default(), built: None, now: None };
        let (leaves, predicted) = (Blocks::new(halves.into(), test), PredictedCost::default());
        Ok(Self { nodes, leaves, frame, bounds, n_primitives, predicted, baseline, path: AvailablePath::detect() })
    }
}

const LAYOUT: &LeafLayout = &LeafLayout::BLOCKS;

/// The records below the root, depth first and without gaps.
fn compact(raw: &RawBvh<'_>) -> Result<(Nodes, Vec<HalfBlock>), Flaw> {
    let (lines, _) = raw.nodes.as_chunks::<16>();
    let n_halves = raw.blocks.len() / HALF_BLOCK_WORDS;
    let mut claimed = Claims::new("line", lines.len());
    let mut claimed_parts = Claims::new(LAYOUT.part_name, LAYOUT.n_parts * n_halves);
    let (mut made, mut halves, mut units) = (vec![], vec![], Units::new(LAYOUT));
    let mut root = ChildWord::EMPTY;
    let mut open = vec![(ChildWord(raw.root), None)];
    while let Some((word, slot)) = open.pop() {
        let new = match word.kind() {
            DecodedWord::Empty if word == ChildWord::EMPTY => word,
            DecodedWord::Empty => return Err(Flaw::Word { word: word.0 }),
            DecodedWord::Leaf { first, n } => {
                let (first, n) = (first as usize, n as usize);
                if n > LAYOUT.in_part && !first.is_multiple_of(LAYOUT.n_parts) {
                    return Err(Flaw::Word { word: word.0 });
                }
                claimed_parts.claim(first, LAYOUT.n_parts_of(n))?;
                let to = units.next(n);
                if to >= ChildWord::MAX_FIRST {
                    return Err(Flaw::Outside { unit: LAYOUT.part_name, at: to, n_units: ChildWord::MAX_FIRST });
                }
                halves.resize(units.n, HalfBlock([0; HALF_BLOCK_WORDS]));
                copy_leaf(raw.blocks, first, n, &mut halves, to);
                ChildWord::leaf(to, n)
            }
            DecodedWord::Node(kind, line) => {
                claimed.claim(line as usize, kind.n_lines())?;
                let to = made.len();
                made.extend(lines[line as usize..line as usize + kind.n_lines()].iter().map(|&line| CacheLine(line)));
                let words = node_words(&made, kind, to as u32);
                // The stack returns the last entry first.
                open.extend(words.iter().enumerate().rev().map(|(i, &word)| (word, Some((kind, to, i)))));
                ChildWord::node(kind, to)
            }
        };
        match slot {
            None => root = new,
            Some((kind, line, i)) => set_word(&mut made, kind, line, i, new),
        }
    }
    let (has_oriented, pieces) = (false, vec![]);
    Ok((Nodes { lines: made.into(), root, depth: 0, has_oriented, pieces, links: None }, halves))
}

/// Copies the triangles of a leaf that starts at part `first` of `blocks` to part `to` of `halves`.
fn copy_leaf(blocks: &[u32], first: usize, n: usize, halves: &mut [HalfBlock], to: usize) {
    let out: &mut [u32] = bytemuck::cast_slice_mut(halves);
    let at = |part: usize| (part / LAYOUT.n_parts * HALF_BLOCK_WORDS, part % LAYOUT.n_parts);
    let [(from_word, from_part), (to_word, to_part)] = [first, to].map(at);
    for i in 0..n {
        let [from, to] = [from_part, to_part].map(|part| LaneWords::of(i, n, part));
        for row in 0..=LaneWords::ID_ROW {
            out[to_word + to.word(row)] = blocks[from_word + from.word(row)];
        }
    }
}

/// The nodes with boxes relative to the origin of object space.
fn in_object_space<'a>(nodes: &'a Nodes, frame: &MeshFrame) -> Cow<'a, [u32]> {
    if frame.reference.is_origin() {
        return Cow::Borrowed(bytemuck::cast_slice(&nodes.lines));
    }
    let reference = to_f64(frame.reference.point());
    let mut lines = nodes.lines.to_vec();
    nodes.each_word(|word| {
        if let DecodedWord::Node(kind, line) = word {
            let node = &mut lines[line as usize..line as usize + kind.n_lines()];
            move_back(kind, reference, &frame.rows, node);
        }
    });
    Cow::Owned(lines.into_iter().flat_map(|CacheLine(words)| words).collect())
}

/// Moves the boxes of a node outward by more than what is rounded.
fn move_back(kind: NodeKind, reference: [f64; 3], frame: &[[f32; 3]; 3], node: &mut [CacheLine]) {
    let rows: &mut [Row] = bytemuck::cast_slice_mut(node);
    #[expect(clippy::needless_range_loop, reason = "a lane of several rows")]
    for i in 0..8 {
        for k in 0..3 {
            match kind {
                NodeKind::Aligned if rows[2 * k][i] < NOWHERE => {
                    let at = dot(to_f64(frame[k]), reference);
                    rows[2 * k][i] = sum_down(rows[2 * k][i], at, reference);
                    rows[2 * k + 1][i] = -sum_down(-rows[2 * k + 1][i], -at, reference);
                }
                NodeKind::Oriented if rows[5 * k + 4][i] > -NOWHERE => {
                    let row = [0, 1, 2].map(|axis| f64::from(rows[5 * k + axis][i]));
                    let (center, half) = (rows[5 * k + 3][i], rows[5 * k + 4][i]);
                    let exact = f64::from(center) + dot(row, reference);
                    let moved = exact as f32;
                    rows[5 * k + 3][i] = moved;
                    let rounding = (f64::from(moved) - exact).abs() + slack(exact, reference);
                    rows[5 * k + 4][i] = -lower(-half, rounding);
                }
                _ => {}
            }
        }
    }
}

/// An f32 not above `plane + at` in real arithmetic.
fn sum_down(plane: f32, at: f64, reference: [f64; 3]) -> f32 {
    lower(plane, -at + slack(f64::from(plane), reference))
}

/// More than the roundings in f64 of a sum and of the projection of the reference point, whose rows are shorter than 2: fewer than 16, of
/// 2^-53 each.
fn slack(sum: f64, reference: [f64; 3]) -> f64 {
    let [x, y, z] = reference.map(f64::abs);
    (sum.abs() + 2.0 * (x + y + z)) / (1_u64 << 49) as f64
}

#[cfg(test)]
mod tests {
    use canted_fixtures as fixtures;

    use super::*;
    use crate::leaf::StoredTriangles;
    use crate::node::LeafLayout;
    use crate::node::checked::Hierarchy;
    use crate::{Config, TriangleBvh};

    /// Every vertex is in all boxes around it, in object space.
    #[test]
    fn boxes_moved_back_contain_their_triangles() {
        let mut n_kinds = [0, 0];
        for mesh in [fixtures::scaffold_of(1, true, 3), fixtures::coplanar_quads(20).off_axis()] {
            let far = mesh.placed(|[x, y, z]| [x + 1e4, y - 3e3, z + 1e2]);
            for config in [Config::default(), Config::default().axis_aligned()] {
                let bvh: TriangleBvh = TriangleBvh::build_with(&far.positions, &far.triangles, config).unwrap();
                assert!(!bvh.frame.reference.is_origin());
                let hierarchy = Hierarchy::of(&bvh.nodes, bvh.leaves.halves.len(), &LeafLayout::BLOCKS).unwrap();
                let corners = StoredTriangles::read(&hierarchy, &bvh.leaves.halves).corners;
                let raw = bvh.raw();
                let lines: &[Row] = bytemuck::cast_slice(&raw.nodes);
                for node in &hierarchy.nodes {
                    n_kinds[node.kind as usize] += 1;
                    let rows = &lines[2 * node.line..2 * (node.line + node.kind.n_lines())];
                    for (i, &slot) in node.slots.iter().enumerate() {
                        for v in corners[hierarchy.places(slot)].iter().flatten() {
                            assert!(contains(node.kind, rows, &raw.frame, i, to_f64(*v)), "{:?} {i}", node.kind);
                        }
                    }
                }
            }
        }
        assert!(n_kinds.iter().all(|&n| n > 8), "{n_kinds:?}");
    }

    /// A BVH of the records of another traces the same hits, also through records that lie apart; its boxes are those of the build.
    #[test]
    fn records_give_their_bvh_again() {
        for mesh in [
            fixtures::scaffold_of(1, true, 3),
            fixtures::coplanar_quads(20).off_axis(),
            fixtures::soup(3, 1),
            fixtures::soup(3, 0),
        ] {
            for config in [Config::default(), Config::default().axis_aligned()] {
                let bvh: TriangleBvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap();
                let raw = bvh.raw();
                let again = TriangleBvh::from_raw(&raw, TriangleTest::Watertight).unwrap();
                assert_eq!((&again.nodes.lines, again.nodes.root), (&bvh.nodes.lines, bvh.nodes.root));
                assert_eq!((&again.leaves.halves, again.n_primitives), (&bvh.leaves.halves, bvh.n_primitives));
                assert_eq!(again.nodes.pieces, bvh.nodes.pieces);
                let apart = spread(&raw);
                let again = TriangleBvh::from_raw(&apart, TriangleTest::Watertight).unwrap();
                assert_eq!((&again.nodes.lines, &again.leaves.halves), (&bvh.nodes.lines, &bvh.leaves.halves));
                // What is loaded may be saved.
                assert!(TriangleBvh::from_bytes(&again.to_bytes()).is_ok());
            }
        }
    }

    /// The same nodes with as much room before each line of a node.
    fn spread<'a>(raw: &RawBvh<'a>) -> RawBvh<'a> {
        let mut nodes = vec![7; 4 * 16];
        nodes.extend_from_slice(&raw.nodes);
        let moved = |word: u32| match ChildWord(word).kind() {
            DecodedWord::Node(kind, line) => ChildWord::node(kind, line as usize + 4).0,
            _ => word,
        };
        let mut open = vec![moved(raw.root)];
        while let Some(word) = open.pop() {
            let DecodedWord::Node(kind, line) = ChildWord(word).kind() else { continue };
            let first = 16 * line as usize + if kind == NodeKind::Aligned { 48 } else { 120 };
            nodes[first..first + 8].iter_mut().for_each(|word| *word = moved(*word));
            open.extend_from_slice(&nodes[first..first + 8]);
        }
        RawBvh { nodes: nodes.into(), root: moved(raw.root), ..raw.clone() }
    }

    #[test]
    fn damaged_records_are_refused() {
        let mesh = fixtures::scaffold_of(1, true, 3);
        let bvh: TriangleBvh = TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap();
        let raw = bvh.raw();
        let root = 16 * (raw.root & 0x1fff_ffff) as usize;
        let word_row = root + if raw.root >> 29 == 0 { 48 } else { 120 };
        let refused = |change: &dyn Fn(&mut Vec<u32>, &mut Vec<u32>)| {
            let (mut nodes, mut blocks) = (raw.nodes.to_vec(), raw.blocks.to_vec());
            change(&mut nodes, &mut blocks);
            let damaged = RawBvh { nodes: nodes.into(), blocks: &blocks, ..raw.clone() };
            TriangleBvh::from_raw(&damaged, TriangleTest::Watertight).unwrap_err().to_string()
        };
        assert!(refused(&|nodes, _| nodes[word_row] = nodes[word_row + 1]).contains("two records"));
        assert!(refused(&|nodes, _| nodes[word_row] = raw.root).contains("two records"));
        assert!(refused(&|nodes, _| nodes[word_row] = 0x1fff_fff0).contains("line 5368"));
        assert!(refused(&|nodes, _| nodes[word_row] = 0x7000_0000).contains("0x70000000"));
        assert!(refused(&|nodes, _| nodes[word_row] = ChildWord::EMPTY.0).contains("is in no leaf"));
        for (row, value) in [(0, 1e9), (0, f32::NAN)] {
            let named = refused(&|nodes, _| nodes[root + row] = value.to_bits());
            assert!(named.contains("box 0 of the node") || named.contains("length"), "{named}");
        }
        assert!(refused(&|_, blocks| blocks[0] = f32::INFINITY.to_bits()).contains("is not finite"));
        // The number of the only triangle of a leaf.
        let one: TriangleBvh = TriangleBvh::build(&mesh.positions, &mesh.triangles[..1]).unwrap();
        let mut blocks = one.raw().blocks.to_vec();
        blocks[36] = u32::MAX - 1;
        let damaged = RawBvh { blocks: &blocks, ..one.raw() };
        let error = TriangleBvh::from_raw(&damaged, TriangleTest::Watertight).unwrap_err();
        assert_eq!(error.to_string(), "primitive 0 is in no leaf");
    }

    /// In f64, whose roundings are far below the pads of the boxes.
    fn contains(kind: NodeKind, rows: &[Row], frame: &[[f32; 3]; 3], i: usize, v: [f64; 3]) -> bool {
        (0..3).all(|k| match kind {
            NodeKind::Aligned => {
                let at = dot(to_f64(frame[k]), v);
                f64::from(rows[2 * k][i]) <= at && at <= f64::from(rows[2 * k + 1][i])
            }
            NodeKind::Oriented => {
                let row = [0, 1, 2].map(|axis| f64::from(rows[5 * k + axis][i]));
                (dot(row, v) - f64::from(rows[5 * k + 3][i])).abs() <= f64::from(rows[5 * k + 4][i])
            }
        })
    }
}
