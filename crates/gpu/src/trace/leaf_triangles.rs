//! The triangles and round segments of wide BVHs as kernels read them: one after another in the order of leaves, three quads each.
//!
//! On the CPU eight lanes test the triangles of a block at once, so its blocks have rows of coordinates. A device tests a triangle in each lane, and
//! reads one with three loads. The word of a leaf there names its first triangle instead of a half of a block.

use canted_obb::PrimId;
use canted_trace::RoundSegment;
use canted_wide::RawBvh;

use super::layout::{EMPTY, LEAF, Quad, WIDTH};
use super::packed::first_word;

/// Words of half a block.
const HALF_WORDS: usize = 40;

/// Rows of a triangle in a block: nine coordinates and its number.
const ROWS: usize = 10;

/// Bits of a leaf word for its first triangle, as in `shared/triangle/records`.
const LEAF_FIRST: u32 = 0x03ff_ffff;

/// Most triangles that the words of leaves can name.
pub(super) const MOST_TRIANGLES: usize = 1 << 26;

/// A triangle: a vertex in each quad, its number in the last word of the first, and whether it is masked in that of the second. A round segment: the ends in two quads, its number as for a
/// triangle, and the radii in the third.
pub(super) type LeafTriangle = [Quad; 3];

/// A BVH as it is uploaded.
pub(super) struct UploadedBvh<'a> {
    /// Nodes, root and bounds. Its blocks are not uploaded.
    pub(super) words: RawBvh<'a>,
    /// Triangles in the order of leaves; none in a top level.
    pub(super) triangles: Vec<LeafTriangle>,
}

impl<'a> UploadedBvh<'a> {
    /// A BVH over instances.
    pub(super) fn over_instances(words: RawBvh<'a>) -> Self {
        Self { words, triangles: vec![] }
    }

    /// A BVH over triangles, whose leaves are numbered anew. `masked` marks triangles by their numbers; those beyond its end are not marked.
    pub(super) fn over_triangles(mut words: RawBvh<'a>, masked: &[bool]) -> Self {
        let blocks = words.blocks;
        let mut triangles = Vec::with_capacity(blocks.len() / ROWS);
        each_leaf(words.nodes.to_mut(), &mut words.root, |leaf| {
            let first = triangles.len();
            triangles.extend((0..size_of(*leaf)).map(|i| {
                let [a, mut b, c] = triangle_of(blocks, *leaf, i);
                b[3] = masked.get(a[3] as usize).copied().unwrap_or(false).into();
                [a, b, c]
            }));
            *leaf = *leaf & !LEAF_FIRST | first as u32 & LEAF_FIRST;
        });
        Self { words, triangles }
    }

    /// A BVH over curves with these records. The leaves name places in the order of the CPU, which is kept.
    pub(super) fn over_curves(words: RawBvh<'a>, records: Vec<LeafTriangle>) -> Self {
        Self { words, triangles: records }
    }

    /// A BVH over round segments. The leaves name places in the order of the CPU, which is kept.
    pub(super) fn over_segments(words: RawBvh<'a>, segments: &[&RoundSegment]) -> Self {
        let record = |id: &PrimId| {
            let RoundSegment { ends, radii: [r, s] } = *segments[id.index()];
            let [[a, b, c], [d, e, f]] = ends.map(|end| end.map(f32::to_bits));
            [[a, b, c, id.0], [d, e, f, 0], [r.to_bits(), s.to_bits(), 0, 0]]
        };
        let triangles = words.order.iter().map(record).collect();
        Self { words, triangles }
    }
}

/// The CPU's blocks of triangles from a device; the words of leaves in `nodes` and `root` are changed to name them. Words that refer to nothing
/// stay, for a check of the whole to report.
pub(super) fn in_blocks(nodes: &mut [u32], root: &mut u32, triangles: &[Quad]) -> Result<Vec<u32>, String> {
    let mut blocks = vec![];
    let mut flaw = None;
    each_leaf(nodes, root, |leaf| {
        let first = 3 * (*leaf & LEAF_FIRST) as usize;
        let Some(own) = triangles.get(first..first + 3 * size_of(*leaf)) else {
            flaw = Some(format!("leaf {leaf:#010x} is beyond the {} triangles", triangles.len() / 3));
            return;
        };
        // A whole number of halves, each of four triangles.
        let start = blocks.len();
        blocks.resize(start + size_of(*leaf).div_ceil(4) * HALF_WORDS, 0);
        let renamed = *leaf & !LEAF_FIRST | (2 * start / HALF_WORDS) as u32 & LEAF_FIRST;
        for (i, [a, b, c]) in own.as_chunks().0.iter().enumerate() {
            let (at, stride) = place(renamed, i);
            let rows = a[..3].iter().chain(&b[..3]).chain(&c[..3]).chain(&a[3..]);
            rows.enumerate().for_each(|(row, word)| blocks[at + row * stride] = *word);
        }
        *leaf = renamed;
    });
    flaw.map_or(Ok(blocks), Err)
}

/// Number of triangles of a leaf.
fn size_of(leaf: u32) -> usize {
    (leaf >> 26 & 31) as usize + 1
}

/// Where triangle `i` of a leaf of the CPU starts in the blocks, and the words from one of its rows to the next. A leaf has blocks of eight, then one
/// of four, of which a leaf of two may use the second half.
fn place(leaf: u32, i: usize) -> (usize, usize) {
    let first = (leaf & LEAF_FIRST) as usize;
    let is_of_eight = i / 8 < (size_of(leaf) + 3) / 8;
    let (lane, stride) = if is_of_eight { (i % 8, 8) } else { (i % 8 + 2 * (first & 1), 4) };
    (first / 2 * HALF_WORDS + i / 8 * 2 * HALF_WORDS + lane, stride)
}

/// Triangle `i` of a leaf of the CPU.
fn triangle_of(blocks: &[u32], leaf: u32, i: usize) -> LeafTriangle {
    let (at, stride) = place(leaf, i);
    let row = |row: usize| blocks[at + row * stride];
    [[row(0), row(1), row(2), row(9)], [row(3), row(4), row(5), 0], [row(6), row(7), row(8), 0]]
}

/// Calls `change` with the word of every leaf below a root. A node that is reached twice or is beyond `nodes` is skipped.
fn each_leaf(nodes: &mut [u32], root: &mut u32, mut change: impl FnMut(&mut u32)) {
    if *root & LEAF != 0 {
        return change(root);
    }
    let mut is_seen = vec![false; nodes.len()];
    let mut waiting = vec![*root];
    while let Some(word) = waiting.pop() {
        let first = first_word(word);
        let Some(children) = nodes.get_mut(first..first + WIDTH) else { continue };
        if std::mem::replace(&mut is_seen[first], true) {
            continue;
        }
        for child in children.iter_mut().filter(|child| **child != EMPTY) {
            if *child & LEAF != 0 { change(child) } else { waiting.push(*child) }
        }
    }
}

#[cfg(test)]
mod tests {
    use canted_wide::{Config, Costs, TriangleBvh};

    use super::super::packed::packed;
    use super::*;

    /// Blocks of the CPU become triangles and blocks again, for leaves of every size.
    #[test]
    fn triangles_of_leaves_are_those_of_the_blocks() {
        let mut sizes = [0; 33];
        for (max_leaf, n) in [(1, 100), (2, 301), (4, 302), (8, 303), (16, 304), (16, 1), (16, 13), (4, 0)] {
            let positions: Vec<[f32; 3]> = (0..3 * n as u32)
                .map(|i| {
                    [1, 7, 49].map(|k| ((i * k).wrapping_mul(2_654_435_761_u32.wrapping_mul(i + 1)) % 1000) as f32)
                })
                .collect();
            let indices: Vec<[u32; 3]> = (0..n as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let costs = Costs { aligned_node: 100.0, oriented_node: 1e6, leaf: 0.1, block: 0.1, max_leaf };
            let bvh = TriangleBvh::build_with(&positions, &indices, Config { costs, ..Config::default() }).unwrap();
            let raw = bvh.raw();
            let uploaded = UploadedBvh::over_triangles(packed(raw.clone()), &[]);
            assert_eq!(uploaded.triangles.len(), n);
            for [a, b, c] in &uploaded.triangles {
                let at = indices[a[3] as usize].map(|vertex| positions[vertex as usize].map(f32::to_bits));
                assert_eq!([a, b, c].map(|quad| [quad[0], quad[1], quad[2]]), at);
            }
            let (mut nodes, mut root) = (uploaded.words.nodes.to_vec(), uploaded.words.root);
            each_leaf(&mut nodes, &mut root, |leaf| sizes[size_of(*leaf)] += 1);
            let quads = uploaded.triangles.as_flattened();
            let blocks = in_blocks(&mut nodes, &mut root, quads).unwrap();
            let back =
                UploadedBvh::over_triangles(RawBvh { nodes: nodes.into(), blocks: &blocks, root, ..raw.clone() }, &[]);
            assert_eq!(back.triangles, uploaded.triangles);
            assert_eq!(back.words.nodes, uploaded.words.nodes);
            // One triangle less than the leaves name.
            if n > 0 {
                let (mut nodes, mut root) = (uploaded.words.nodes.to_vec(), uploaded.words.root);
                let flaw = in_blocks(&mut nodes, &mut root, &quads[..3 * n - 3]).expect_err("a leaf without triangles");
                assert!(flaw.contains("beyond"), "{flaw}");
            }
        }
        assert!([1, 2, 3, 4].iter().all(|&n| sizes[n] > 0) && sizes[5..].iter().sum::<usize>() > 0, "{sizes:?}");
    }

    /// Damaged nodes do not end in a panic or an endless loop.
    #[test]
    fn nodes_that_refer_to_themselves_are_followed_once() {
        let mut nodes = vec![EMPTY; 64];
        nodes[0] = 0;
        nodes[1] = 1000;
        nodes[2] = LEAF;
        let mut root = 0;
        let triangles = [[1, 2, 3, 4], [5, 6, 7, 0], [8, 9, 10, 0]];
        assert_eq!(in_blocks(&mut nodes, &mut root, &triangles).unwrap().len(), HALF_WORDS);
    }
}
