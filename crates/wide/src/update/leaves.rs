//! Leaves before and after a motion: blocks of triangles, and primitives of the caller.

use canted_lbvh::Corners;
use canted_obb::round::{down, up};
use canted_obb::{Aabb, PrimId, flat_as_edge};
use canted_trace::ReferencePoint;

use super::extremes::{Extremes, REACH};
use super::rotation::EdgeProducts;
use super::subtree::{LeafSlots, LeafStates};
use super::vertices::{LANES, Vertices};
use crate::build::item::{self, Item};
use crate::leaf::{Placed, Primitives};
use crate::node::{Content, HALF_BLOCK_WORDS, HalfBlock, LaneWords, PART_LANES, PARTS};
use crate::simd::{AvailablePath, Simd, Task};
use crate::traverse::MeshFrame;

/// Triangles of a mesh that has moved. Every index is valid.
pub(super) struct MovedTriangles<'a> {
    pub(super) positions: &'a [[f32; 3]],
    pub(super) triangles: &'a [[u32; 3]],
    /// Before and after the motion.
    pub(super) frames: [MeshFrame; 2],
    pub(super) path: AvailablePath,
}

impl MovedTriangles<'_> {
    /// The leaves before the motion.
    pub(super) fn before(&self, units: &[HalfBlock], leaves: &[LeafSlots], states: &mut LeafStates<Vertices>) {
        self.path.run(Stored { words: bytemuck::cast_slice(units), frame: &self.frames[0], leaves, states });
    }

    /// The leaves after the motion, which are written.
    pub(super) fn after(&self, units: &mut [HalfBlock], leaves: &[LeafSlots], states: &mut LeafStates<Vertices>) {
        self.path.run(Moved { triangles: self, words: bytemuck::cast_slice_mut(units), leaves, states });
    }
}

/// Reads leaves as they are.
struct Stored<'a> {
    words: &'a [u32],
    frame: &'a MeshFrame,
    leaves: &'a [LeafSlots],
    states: &'a mut LeafStates<Vertices>,
}

impl Task for Stored<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(mut self, simd: S) {
        let mut batch = Batch::new();
        while batch.take(&mut self.leaves) {
            read(&batch.blocks, self.words, &mut batch.rows);
            batch.measure(simd);
            batch.keep_corners(self.states, self.frame);
            batch.add_to(simd, self.states, self.frame);
        }
    }
}

/// Replaces the triangles of leaves.
struct Moved<'a> {
    triangles: &'a MovedTriangles<'a>,
    words: &'a mut [u32],
    leaves: &'a [LeafSlots],
    states: &'a mut LeafStates<Vertices>,
}

impl Task for Moved<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(mut self, simd: S) {
        let mut batch = Batch::new();
        while batch.take(&mut self.leaves) {
            batch.gather(self.words, self.triangles);
            batch.store_flat_as_edges(simd);
            batch.measure(simd);
            if let Some(products) = &mut self.states.products {
                batch.add_products(simd, self.words, products);
            }
            batch.write(simd, self.words);
            let frame = &self.triangles.frames[1];
            if batch.has_edges {
                batch.keep_corners(self.states, frame);
            } else {
                batch.keep_vertices(self.states, self.triangles.positions, frame);
            }
            batch.add_to(simd, self.states, frame);
        }
    }
}

/// Most triangles of a batch, a multiple of [`LANES`]. Not a power of two: rows would then be the same part of a cache.
const BATCH: usize = 120;

/// Up to eight triangles of a leaf in one block: the first word, the words of a row, and their number.
#[derive(Clone, Copy, Debug, Default)]
struct Lanes {
    word: usize,
    width: usize,
    n: usize,
}

/// The triangles of several leaves. Each step is done for all of them, so that the processor reads memory for many at once.
struct Batch<'a> {
    leaves: &'a [LeafSlots],
    blocks: Vec<Lanes>,
    n: usize,
    triangles: [[u32; 3]; BATCH],
    /// Coordinates of the three vertices.
    rows: [[f32; BATCH]; 9],
    /// Of each triangle as given; in the last place twice its area.
    boxes: [Extremes; BATCH],
    /// Coordinates before the motion, and the products of edges of each triangle, where they are asked for.
    before: [[f32; BATCH]; 9],
    products: [EdgeProducts; BATCH],
    /// Whether triangles without area were replaced.
    has_edges: bool,
    vertices: Distinct,
}

impl<'a> Batch<'a> {
    fn new() -> Self {
        let (triangles, rows, boxes) = ([[0; 3]; BATCH], [[0.0; BATCH]; 9], [Extremes::EMPTY; BATCH]);
        let (blocks, products) = (Vec::with_capacity(BATCH), [EdgeProducts::ZERO; BATCH]);
        let (has_edges, vertices) = (false, Distinct::new());
        Self { leaves: &[], blocks, n: 0, triangles, rows, boxes, before: rows, products, has_edges, vertices }
    }

    /// Takes the next leaves; false where there are none.
    fn take(&mut self, leaves: &mut &'a [LeafSlots]) -> bool {
        self.blocks.clear();
        self.n = 0;
        let mut n_leaves = 0;
        for leaf in *leaves {
            if self.n + leaf.n > BATCH {
                break;
            }
            let (mut word, mut rest) = (leaf.first / PARTS * HALF_BLOCK_WORDS, leaf.n);
            // Blocks of eight precede a last block of four.
            while rest > 4 {
                self.blocks.push(Lanes { word, width: 8, n: rest.min(8) });
                (word, rest) = (word + 2 * HALF_BLOCK_WORDS, rest.saturating_sub(8));
            }
            if rest > 0 {
                self.blocks.push(Lanes { word: word + leaf.first % PARTS * PART_LANES, width: 4, n: rest });
            }
            self.n += leaf.n;
            n_leaves += 1;
        }
        (self.leaves, *leaves) = leaves.split_at(n_leaves);
        n_leaves > 0
    }

    /// Reads the triangles that leaves in these words hold, as they are now.
    #[inline(always)]
    fn gather(&mut self, words: &[u32], moved: &MovedTriangles) {
        let mut at = 0;
        for block in &self.blocks {
            let ids = &words[block.word + LaneWords::ID_ROW * block.width..][..block.n];
            for (triangle, &id) in self.triangles[at..at + block.n].iter_mut().zip(ids) {
                *triangle = moved.triangles[id as usize];
            }
            at += block.n;
        }
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = &mut self.rows;
        for (at, triangle) in self.triangles[..self.n].iter().enumerate() {
            let [a, b, c] = triangle.map(|vertex| moved.positions[vertex as usize]);
            [ax[at], ay[at], az[at]] = a;
            [bx[at], by[at], bz[at]] = b;
            [cx[at], cy[at], cz[at]] = c;
        }
    }

    /// Replaces triangles without area by their longest edges.
    #[inline(always)]
    fn store_flat_as_edges<S: Simd>(&mut self, simd: S) {
        self.has_edges = false;
        for first in (0..self.n).step_by(LANES) {
            let mut may_be_flat = may_be_flat(simd, &eight(simd, &self.rows, first)) & lanes_below(self.n - first);
            while may_be_flat != 0 {
                let at = first + may_be_flat.trailing_zeros() as usize;
                may_be_flat &= may_be_flat - 1;
                let given = self.corners(at);
                let corners = flat_as_edge(given);
                self.has_edges |= corners != given;
                self.rows.iter_mut().zip(corners.as_flattened()).for_each(|(row, &x)| row[at] = x);
            }
        }
    }

    fn corners(&self, at: usize) -> Corners {
        std::array::from_fn(|vertex| std::array::from_fn(|k| self.rows[3 * vertex + k][at]))
    }

    /// Computes boxes and areas.
    #[inline(always)]
    fn measure<S: Simd>(&mut self, simd: S) {
        let minus = |x| simd.xor_sign(x, simd.splat(-1.0));
        for first in (0..self.n).step_by(LANES) {
            let [ax, ay, az, bx, by, bz, cx, cy, cz] = eight(simd, &self.rows, first);
            let least = |a, b, c| simd.min(simd.min(a, b), c);
            let greatest = |a, b, c| simd.max(simd.max(a, b), c);
            let (ux, uy, uz) = (simd.sub(bx, ax), simd.sub(by, ay), simd.sub(bz, az));
            let (vx, vy, vz) = (simd.sub(cx, ax), simd.sub(cy, ay), simd.sub(cz, az));
            let x = simd.sub(simd.mul(uy, vz), simd.mul(uz, vy));
            let y = simd.sub(simd.mul(uz, vx), simd.mul(ux, vz));
            let z = simd.sub(simd.mul(ux, vy), simd.mul(uy, vx));
            let twice_area = simd.sqrt(simd.add(simd.add(simd.mul(x, x), simd.mul(y, y)), simd.mul(z, z)));
            let boxes = simd.transpose([
                least(ax, bx, cx),
                least(ay, by, cy),
                least(az, bz, cz),
                simd.splat(0.0),
                minus(greatest(ax, bx, cx)),
                minus(greatest(ay, by, cy)),
                minus(greatest(az, bz, cz)),
                twice_area,
            ]);
            for (out, lanes) in self.boxes[first..first + LANES].iter_mut().zip(boxes) {
                out.0 = simd.store(lanes);
            }
        }
    }

    /// Adds the products of the edges of each leaf, which these words hold as it was before the motion.
    #[inline(always)]
    fn add_products<S: Simd>(&mut self, simd: S, words: &[u32], all: &mut Vec<EdgeProducts>) {
        read(&self.blocks, words, &mut self.before);
        for first in (0..self.n).step_by(LANES) {
            let (after, before) = (eight(simd, &self.rows, first), eight(simd, &self.before, first));
            EdgeProducts::of_triangles(simd, &after, &before, &mut self.products[first..first + LANES]);
        }
        let mut at = 0;
        for leaf in self.leaves {
            all.push(EdgeProducts::sum(simd, self.products[at..at + leaf.n].iter()));
            at += leaf.n;
        }
    }

    /// Writes the triangles into their leaves.
    #[inline(always)]
    fn write<S: Simd>(&self, simd: S, words: &mut [u32]) {
        let mut at = 0;
        for block in &self.blocks {
            let out = &mut words[block.word..][..LaneWords::ID_ROW * block.width];
            match (block.width, self.rows[0].get(at..at + 8)) {
                (8, Some(_)) => {
                    // Lanes without a triangle hold zeros.
                    let (used, number) =
                        (simd.splat(block.n as f32), simd.load(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]));
                    for (out, row) in out.as_chunks_mut::<8>().0.iter_mut().zip(&self.rows) {
                        let x = simd.load(row[at..].first_chunk().expect("eight"));
                        *out = simd.store(simd.pick(number, used, x, simd.splat(0.0))).map(f32::to_bits);
                    }
                }
                (4, Some(_)) if block.n == 4 => {
                    for (out, row) in out.as_chunks_mut::<4>().0.iter_mut().zip(&self.rows) {
                        *out = row[at..].first_chunk::<4>().expect("four").map(f32::to_bits);
                    }
                }
                _ => {
                    for (out, row) in out.chunks_exact_mut(block.width).zip(&self.rows) {
                        out.iter_mut().zip(&row[at..at + block.n]).for_each(|(word, x)| *word = x.to_bits());
                    }
                }
            }
            at += block.n;
        }
    }

    /// Keeps the corners of all triangles for the boxes above them, where a piece asks for them.
    #[inline(always)]
    fn keep_corners(&self, states: &mut LeafStates<Vertices>, frame: &MeshFrame) {
        let Some(kept) = &mut states.items else { return };
        let mut at = 0;
        for leaf in self.leaves {
            let first = kept.n_eights();
            kept.push_rows(&self.rows, at..at + leaf.n, frame.reference);
            states.ranges.push([first, kept.n_eights()]);
            at += leaf.n;
        }
    }

    /// The same, where triangles are as given: a vertex of several triangles of a leaf once.
    #[inline(always)]
    fn keep_vertices(&mut self, states: &mut LeafStates<Vertices>, positions: &[[f32; 3]], frame: &MeshFrame) {
        let Some(kept) = &mut states.items else { return };
        let mut at = 0;
        for leaf in self.leaves {
            let first = kept.n_eights();
            let vertices = self.vertices.of(&self.triangles[at..at + leaf.n]);
            kept.push_vertices(vertices, positions, frame.reference);
            states.ranges.push([first, kept.n_eights()]);
            at += leaf.n;
        }
    }

    /// Adds the leaves to those of a piece, which has kept their vertices.
    #[inline(always)]
    fn add_to<S: Simd>(&self, simd: S, states: &mut LeafStates<Vertices>, frame: &MeshFrame) {
        let reference = moves(frame.reference);
        let (mut bounds, mut at) = (simd.load(&Extremes::EMPTY.0), 0);
        for leaf in self.leaves {
            let boxes = &self.boxes[at..at + leaf.n];
            let (mut least, mut sum) = (simd.load(&boxes[0].0), simd.load(&boxes[0].0));
            for one in &boxes[1..] {
                let one = simd.load(&one.0);
                (least, sum) = (simd.min(one, least), simd.add(one, sum));
            }
            bounds = simd.min(least, bounds);
            // Squares of great and of small coordinates leave the range of f32, and subnormal ones lose digits.
            let twice_area = simd.store(sum)[7];
            states.area += if (LEAST_AREA..f32::INFINITY).contains(&twice_area) {
                0.5 * f64::from(twice_area)
            } else {
                (at..at + leaf.n).map(|at| self.corners(at).area()).sum()
            };
            // Rounding is monotonic, so this is the box of all moved triangles.
            let mut extremes = Extremes(simd.store(simd.sub(least, simd.load(&reference))));
            let reach = extremes.0.iter().enumerate().filter(|(i, _)| i % 4 != REACH);
            extremes.0[REACH] = -reach.fold(0.0, |most: f32, (_, x)| if x.abs() > most { x.abs() } else { most });
            if !frame.is_identity {
                let vertices =
                    states.items.as_ref().expect("vertices are kept where the frame is not that of object space");
                let ([first, end], reach) = (states.ranges[states.extremes.len()], extremes.reach());
                let ends = vertices.ends(simd, first..end, frame.rows, reach);
                extremes = Extremes::new(&Aabb { min: ends.lo.map(down), max: ends.hi.map(up) }, reach);
            }
            states.extremes.push(extremes);
            at += leaf.n;
        }
        states.bounds = states.bounds.union(Extremes(simd.store(bounds)).aligned());
    }
}

/// Finds the vertices of a leaf.
struct Distinct {
    /// By the last bits of a vertex: in the upper half the number of the last leaf that had such a vertex, in the lower one the vertex.
    places: [u64; PLACES],
    n_leaves: u64,
    vertices: [[u32; LANES]; (3 * BATCH).div_ceil(LANES) + 1],
}

/// Vertices with so many consecutive numbers have different places.
const PLACES: usize = 128;

impl Distinct {
    fn new() -> Self {
        Self { places: [0; PLACES], n_leaves: 0, vertices: [[0; LANES]; (3 * BATCH).div_ceil(LANES) + 1] }
    }

    /// The vertices of the triangles of the next leaf, each at least once and most once, then the first one again up to a whole vector.
    #[inline(always)]
    fn of(&mut self, triangles: &[[u32; 3]]) -> &[[u32; LANES]] {
        self.n_leaves += 1;
        let (all, mut n) = (self.vertices.as_flattened_mut(), 0);
        for &vertex in triangles.as_flattened() {
            let (place, own) = (&mut self.places[vertex as usize % PLACES], self.n_leaves << 32 | u64::from(vertex));
            all[n] = vertex;
            n += usize::from(*place != own);
            *place = own;
        }
        let n_eights = n.div_ceil(LANES);
        let (repeated, end) = (all[0], n_eights * LANES);
        all[n..end].fill(repeated);
        &self.vertices[..n_eights]
    }
}

/// Reads the triangles of blocks in these words as they are.
#[inline(always)]
fn read(blocks: &[Lanes], words: &[u32], rows: &mut [[f32; BATCH]; 9]) {
    let mut at = 0;
    for block in blocks {
        let from = &words[block.word..][..9 * block.width];
        // Lanes without a triangle are overwritten by the next block, or not part of the batch.
        if block.width == 8 && at + 8 <= BATCH {
            for (row, from) in rows.iter_mut().zip(from.as_chunks::<8>().0) {
                *row[at..].first_chunk_mut().expect("eight") = from.map(f32::from_bits);
            }
        } else {
            for (row, from) in rows.iter_mut().zip(from.chunks_exact(block.width)) {
                row[at..at + block.n].iter_mut().zip(from).for_each(|(x, &word)| *x = f32::from_bits(word));
            }
        }
        at += block.n;
    }
}

/// Eight triangles of a batch, some of which may not be part of it.
#[inline(always)]
fn eight<S: Simd>(simd: S, rows: &[[f32; BATCH]; 9], first: usize) -> [S::F; 9] {
    let mut eight = [simd.splat(0.0); 9];
    for (lanes, row) in eight.iter_mut().zip(rows) {
        *lanes = simd.load(row[first..].first_chunk().expect("batches are whole vectors"));
    }
    eight
}

/// What is subtracted from [`Extremes`] to make them relative to a point.
fn moves(reference: ReferencePoint) -> [f32; 8] {
    let [x, y, z] = reference.point();
    [x, y, z, 0.0, -x, -y, -z, 0.0]
}

/// Mask of the first `n` lanes.
#[inline(always)]
fn lanes_below(n: usize) -> u32 {
    if n < LANES { (1 << n) - 1 } else { 0xff }
}

/// Mask of the lanes that may hold a triangle without area; the others certainly hold none.
///
/// In a plane of two axes, the doubled area is `left - right`, two products of differences. In f32, without over- or underflow, it is
/// off by less than
/// `(3 + 16 u)·u·(|left| + |right|)` (Shewchuk 1997), u = 2^-24: 4 u cover that and the rounding of the bound. Where their sum
/// exceeds 2^-100, what a product loses by underflow, at most 2^-149, is far below the spare.
#[inline(always)]
fn may_be_flat<S: Simd>(simd: S, [ax, ay, az, bx, by, bz, cx, cy, cz]: &[S::F; 9]) -> u32 {
    let bound = simd.splat(4.0 / (1 << 24) as f32);
    let (least, infinite) = (simd.splat(1.0 / (1_u128 << 100) as f32), simd.splat(f32::INFINITY));
    let u = [simd.sub(*ax, *cx), simd.sub(*ay, *cy), simd.sub(*az, *cz)];
    let v = [simd.sub(*bx, *cx), simd.sub(*by, *cy), simd.sub(*bz, *cz)];
    let mut may_be_flat = 0xff;
    for [i, j] in [[0, 1], [1, 2], [2, 0]] {
        let (left, right) = (simd.mul(u[i], v[j]), simd.mul(u[j], v[i]));
        let sum = simd.add(simd.abs(left), simd.abs(right));
        // False for what overflows, and for a NaN.
        let exceeds = simd.lt(simd.mul(bound, sum), simd.abs(simd.sub(left, right)));
        may_be_flat &= !(exceeds & simd.lt(least, sum) & simd.lt(sum, infinite));
    }
    may_be_flat
}

/// Primitives of the caller before and after a motion.
pub(super) struct MovedPrimitives<'a> {
    pub(super) primitives: [&'a dyn Primitives; 2],
    pub(super) frames: [MeshFrame; 2],
}

impl<'a> MovedPrimitives<'a> {
    /// Adds leaves of these primitives before the motion, or after it.
    pub(super) fn add(
        &self,
        state: usize,
        order: &[PrimId],
        leaves: &[LeafSlots],
        states: &mut LeafStates<Vec<Placed<'a>>>,
    ) {
        let (primitives, frame) = (self.primitives[state], &self.frames[state]);
        for leaf in leaves {
            let ids = &order[leaf.first..leaf.first + leaf.n];
            let given = ids.iter().map(|id| Placed::given(primitives.at(id.index())));
            states.area += given.clone().map(|item| item.area()).sum::<f64>();
            if let Some(items) = &mut states.items {
                let first = items.len();
                items.extend(given.map(|item| item.moved(frame.reference)));
                states.ranges.push([first, items.len()]);
            }
            let Content { bounds, aligned, reach } = content_of(primitives, ids, frame);
            states.bounds = states.bounds.union(bounds);
            states.extremes.push(Extremes::new(&aligned, reach));
        }
    }
}

/// What the boxes around a leaf of these primitives depend on.
pub(crate) fn content_of(primitives: &dyn Primitives, ids: &[PrimId], frame: &MeshFrame) -> Content {
    let (mut bounds, mut aligned) = (Aabb::EMPTY, Aabb::EMPTY);
    for id in ids {
        let given = Placed::given(primitives.at(id.index()));
        bounds = bounds.union(given.aabb());
        if !frame.is_identity {
            aligned = aligned.union(item::rotated_box(&given.moved(frame.reference), &frame.rows));
        }
    }
    content(bounds, aligned, frame)
}

/// Of items with these bounds; `aligned` is around them in a mesh frame that is not that of object space.
fn content(bounds: Aabb, aligned: Aabb, frame: &MeshFrame) -> Content {
    // Rounding is monotonic, so this is the box of all moved items.
    let moved = frame.reference.moved_box(&bounds);
    Content { bounds, aligned: if frame.is_identity { moved } else { aligned }, reach: moved.reach() }
}

/// From here on, what a leaf of 32 triangles loses by products below 2^-126 is less than 2^-14 of its area.
const LEAST_AREA: f32 = 1.0 / (1_u64 << 44) as f32;

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use canted_obb::{Aabb, Obb};
    use canted_trace::{ReferencePoint, Slabs};

    use super::*;
    use crate::leaf::{StoredTriangles, unused_lanes_are_zero};
    use crate::node::checked::{CheckedLeaf, Hierarchy};
    use crate::node::{LeafLayout, MAX_LEAF};
    use crate::simd::Scalar;
    use crate::traverse::{Block, MeshFrame};

    /// Reads a leaf as the traversal does.
    fn traversed(halves: &[HalfBlock], n: usize) -> Vec<(Corners, PrimId)> {
        let mut triangles = vec![];
        for first in (0..n).step_by(8) {
            let block = Block::at(halves, first / 4, u32::try_from(n - first).unwrap());
            triangles.extend((0..(n - first).min(8)).map(|lane| (block.vertices(lane), block.primitive(lane))));
        }
        triangles
    }

    /// Triangles of any size and place, many of them without area or almost so.
    #[test]
    fn flat_triangles_are_stored_as_edges_and_no_others() {
        let mut rng = canted_fixtures::SplitMix64::new(6);
        let (mut n_flat, mut n_naive_wrong, mut n_exact) = (0, 0, 0);
        for round in 0..20_000 {
            let scale = [1.0, 1e-6, 1e7, 1e-18, 1e-30, 3e18][round % 6];
            let offset = [0.0, 1e7, 1.0][round / 6 % 3] * scale;
            let triangles: Vec<Corners> = (0..LANES)
                .map(|i| {
                    let mut point = || rng.signed3().map(|x| (offset + scale * x) as f32);
                    let (a, b) = (point(), point());
                    let along = [0.5, 2.0, 0.25][i % 3];
                    match i {
                        0 => [a, b, a],
                        1..=4 => [a, b, [0, 1, 2].map(|k| a[k] + along * (b[k] - a[k]))],
                        5 => [a, b, [0, 1, 2].map(|k| (a[k] + 0.3 * (b[k] - a[k])).next_up())],
                        6 => [[a[0], 0.0, 0.0], [b[0], 0.0, 0.0], [a[1], b[1], 0.0]],
                        _ => [a, b, point()],
                    }
                })
                .collect();
            let n = 1 + round % LANES;
            let mut batch = Batch::new();
            batch.n = n;
            for (lane, triangle) in triangles.iter().enumerate().take(n) {
                batch.rows.iter_mut().zip(triangle.as_flattened()).for_each(|(row, &x)| row[lane] = x);
            }
            let may_be_flat = may_be_flat(Scalar, &eight(Scalar, &batch.rows, 0));
            batch.store_flat_as_edges(Scalar);
            assert_eq!(batch.has_edges, triangles[..n].iter().any(|&triangle| flat_as_edge(triangle) != triangle));
            for (lane, &triangle) in triangles.iter().enumerate().take(n) {
                let want = flat_as_edge(triangle);
                assert_eq!(batch.corners(lane), want, "{triangle:?}");
                let [a, b, c] = triangle;
                let doubled = |i: usize, j: usize| (a[i] - c[i]) * (b[j] - c[j]) - (a[j] - c[j]) * (b[i] - c[i]);
                let naive = [(0, 1), (1, 2), (2, 0)].iter().all(|&(i, j)| doubled(i, j) == 0.0);
                n_flat += usize::from(want != triangle);
                n_exact += (may_be_flat >> lane & 1) as usize;
                n_naive_wrong += usize::from(naive != canted_obb::is_flat(triangle));
            }
        }
        assert!(n_flat > 1000 && n_naive_wrong > 1000, "{n_flat} flat, {n_naive_wrong} wrong without the bound");
        assert!(n_exact < 80_000, "{n_exact} are decided exactly");
    }

    #[test]
    fn leaves_of_any_size_are_read_as_the_traversal_reads_them() {
        for n in 1..=MAX_LEAF {
            let n_halves = LeafLayout::BLOCKS.n_units(n);
            let words: Vec<u32> = (0_u16..).take(n_halves * HALF_BLOCK_WORDS).map(|i| f32::from(i).to_bits()).collect();
            let mut halves: Vec<HalfBlock> =
                words.chunks_exact(HALF_BLOCK_WORDS).map(|w| HalfBlock(w.try_into().unwrap())).collect();
            let leaf = CheckedLeaf { first: 0, places: 0..n, is_shared: false };
            let hierarchy = Hierarchy { nodes: vec![], leaves: vec![leaf.clone()], n_places: n, depth: 0 };
            let read = StoredTriangles::read(&hierarchy, &halves);
            let want = traversed(&halves, n);
            assert_eq!(read.corners, want.iter().map(|t| t.0).collect::<Vec<_>>(), "{n}");
            assert_eq!(read.ids, want.iter().map(|t| t.1).collect::<Vec<_>>(), "{n}");
            // Ids that are also numbers of triangles, in another order.
            let ids: Vec<PrimId> = (0u32..).take(n).map(|i| PrimId((5 * i + 3) % 37)).collect();
            let words: &mut [u32] = bytemuck::cast_slice_mut(&mut halves);
            for (i, id) in ids.iter().enumerate() {
                words[LaneWords::of(i, n, 0).word(LaneWords::ID_ROW)] = id.0;
            }
            // Replaced and read again; only used lanes change.
            // Squares are not on a line, unlike what was read: triangles without area would be stored as edges.
            let moved: Vec<Corners> = read.corners.iter().map(|c| c.map(|p| p.map(|x| -x * x - 1.0))).collect();
            let mut triangles = [[u32::MAX; 3]; 37];
            for (first, id) in (0u32..).step_by(3).zip(&ids) {
                triangles[id.index()] = [first, first + 1, first + 2];
            }
            let frame = MeshFrame::new(Obb::IDENTITY_FRAME, ReferencePoint::ORIGIN);
            let (positions, path) = (moved.as_flattened(), AvailablePath::detect());
            let leaves = MovedTriangles { positions, triangles: &triangles, frames: [frame; 2], path };
            let [mut state, mut before] = [Some(n), None].map(|n_items| LeafStates::new(1, n_items, false));
            leaves.after(&mut halves, &[LeafSlots { first: 0, n }], &mut state);
            leaves.before(&halves, &[LeafSlots { first: 0, n }], &mut before);
            let taken = state.items.unwrap();
            let bounds = Aabb::from_points(moved.iter().flatten().copied());
            let ends = taken.ends(Scalar, 0..taken.n_eights(), Obb::IDENTITY_FRAME, bounds.reach());
            let slabs = Slabs { rows: Obb::IDENTITY_FRAME, lo: ends.lo.map(down), hi: ends.hi.map(up) };
            assert_eq!(slabs, Slabs::from_points(Obb::IDENTITY_FRAME, moved.iter().flatten().copied()));
            for side in [state.bounds, before.bounds, state.extremes[1].aligned(), before.extremes[1].aligned()] {
                assert_eq!(side, bounds);
            }
            assert_eq!(state.extremes[1].reach(), bounds.reach());
            let area: f64 = moved.iter().map(Item::area).sum();
            assert!((state.area - area).abs() <= 1e-5 * area && state.area == before.area);
            assert_eq!(StoredTriangles::read(&hierarchy, &halves), StoredTriangles { corners: moved, ids });
            assert_eq!(unused_lanes_are_zero(&leaf, &halves), n % 4 == 0, "{n}");
        }
    }

    /// Vertices share places, and earlier leaves had some of them.
    #[test]
    fn every_vertex_of_a_leaf_is_found_and_few_are_repeated() {
        let mut rng = canted_fixtures::SplitMix64::new(8);
        let (mut distinct, mut n_lost) = (Distinct::new(), 0);
        for round in 0..5_000 {
            let (n_vertices, step) = ([4, 30, 1_000][round % 3], [1, PLACES, 4_294_967][round / 3 % 3]);
            let n = 1 + rng.below(MAX_LEAF);
            let mut vertex = || u32::try_from(step * rng.below(n_vertices)).unwrap();
            let triangles: Vec<[u32; 3]> = (0..n).map(|_| [vertex(), vertex(), vertex()]).collect();
            let want: BTreeSet<u32> = triangles.as_flattened().iter().copied().collect();
            let vertices = distinct.of(&triangles).as_flattened().to_vec();
            assert_eq!(vertices.iter().copied().collect::<BTreeSet<_>>(), want, "{round}");
            if step == 1 && n_vertices <= PLACES {
                assert_eq!(vertices.len(), want.len().next_multiple_of(LANES), "{round}");
            }
            // As if the next leaf had the same number.
            distinct.n_leaves -= 1;
            n_lost += usize::from(distinct.of(&triangles).as_flattened().len() < want.len());
        }
        assert!(n_lost > 3_000, "{n_lost} would pass if leaves had no numbers");
    }

    /// Leaves of all sizes in one call, so that batches end anywhere, small ones in both parts of shared half-blocks: each as in a call of its own.
    #[test]
    fn leaves_of_a_batch_are_those_of_calls_of_their_own() {
        let mut rng = canted_fixtures::SplitMix64::new(7);
        let (mut n_late, mut n_second_parts) = (0, 0);
        for _ in 0..160 {
            let (mut leaves, mut n_halves, mut n_before) = (vec![], 0, 0);
            while leaves.len() < 40 {
                let most = [PART_LANES, MAX_LEAF][rng.below(2)];
                let n = 1 + rng.below(most);
                let follows = leaves
                    .last()
                    .is_some_and(|last: &LeafSlots| last.n <= PART_LANES && last.first.is_multiple_of(PARTS));
                let is_second = n <= PART_LANES && follows;
                let first = if is_second { PARTS * (n_halves - 1) + 1 } else { PARTS * n_halves };
                n_halves += if is_second { 0 } else { LeafLayout::BLOCKS.n_units(n) };
                leaves.push(LeafSlots { first, n });
                // Blocks of eight in the last places of a batch have no eight rows after them.
                n_before = if n_before + n > BATCH { 0 } else { n_before };
                let last = n_before + (n - 1) / 8 * 8;
                n_late += usize::from((n - 1) % 8 >= 4 && last + 8 > BATCH);
                n_before += n;
                n_second_parts += usize::from(is_second);
            }
            let mut halves = vec![HalfBlock([0; HALF_BLOCK_WORDS]); n_halves];
            let words: &mut [u32] = bytemuck::cast_slice_mut(&mut halves);
            let mut n_triangles = 0_u32;
            for leaf in &leaves {
                for i in 0..leaf.n {
                    let place = LaneWords::of(i, leaf.n, leaf.first % PARTS).word(LaneWords::ID_ROW);
                    words[leaf.first / PARTS * HALF_BLOCK_WORDS + place] = n_triangles;
                    n_triangles += 1;
                }
            }
            let positions: Vec<[f32; 3]> = (0..3 * n_triangles).map(|_| rng.signed3().map(|x| x as f32)).collect();
            let triangles: Vec<[u32; 3]> = (0..n_triangles).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let frame = MeshFrame::new(Obb::IDENTITY_FRAME, ReferencePoint::ORIGIN);
            let (frames, path) = ([frame; 2], AvailablePath::detect());
            let moved = MovedTriangles { positions: &positions, triangles: &triangles, frames, path };
            let mut alone = halves.clone();
            let [mut of_all, mut of_each] = [(); 2].map(|()| LeafStates::new(40, Some(0), true));
            moved.after(&mut halves, &leaves, &mut of_all);
            leaves.iter().for_each(|leaf| moved.after(&mut alone, std::slice::from_ref(leaf), &mut of_each));
            assert!(bytemuck::cast_slice::<_, u32>(&halves) == bytemuck::cast_slice::<_, u32>(&alone));
            assert_eq!((&of_all.extremes, of_all.bounds), (&of_each.extremes, of_each.bounds));
            assert_eq!(of_all.products, of_each.products);
            let ends = [of_all, of_each].map(|states| {
                let items = states.items.unwrap();
                items.ends(Scalar, 0..items.n_eights(), Obb::IDENTITY_FRAME, 1.0)
            });
            assert_eq!(ends[0], ends[1]);
            // Every triangle is where its number is.
            let words: &[u32] = bytemuck::cast_slice(&halves);
            let mut number = 0;
            for leaf in &leaves {
                for i in 0..leaf.n {
                    let place = LaneWords::of(i, leaf.n, leaf.first % PARTS);
                    let word = |row| words[leaf.first / PARTS * HALF_BLOCK_WORDS + place.word(row)];
                    let stored: [f32; 9] = std::array::from_fn(|row| f32::from_bits(word(row)));
                    assert_eq!(stored, *positions[3 * number..3 * number + 3].as_flattened());
                    number += 1;
                }
            }
        }
        assert!(n_late > 10 && n_second_parts > 800, "{n_late}, {n_second_parts}");
    }
}
