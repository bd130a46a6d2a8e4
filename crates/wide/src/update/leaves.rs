//! Leaves before and after a motion: blocks of triangles, and primitives of the caller.

use canted_lbvh::Corners;
use canted_obb::{Aabb, PrimId, flat_as_edge};

use super::points::{LANES, Points};
use super::subtree::LeafState;
use crate::build::item::{self, Item};
use crate::leaf::{Placed, Primitive};
use crate::node::{Content, HALF_BLOCK_WORDS, HalfBlock, LaneWords, PART_LANES, PARTS};
use crate::simd::{AvailablePath, Simd, Task};
use crate::traverse::MeshFrame;

/// Triangles of a mesh that has moved. Every index is valid.
pub(super) struct MovedTriangles<'a> {
    pub(super) positions: &'a [[f32; 3]],
    pub(super) triangles: &'a [[u32; 3]],
    /// Before and after the motion.
    pub(super) frames: [MeshFrame; 2],
}

impl MovedTriangles<'_> {
    /// The leaf before the motion.
    pub(super) fn before(&self, units: &[HalfBlock], first: usize, n: usize, points: Option<&mut Points>) -> LeafState {
        let words: &[u32] = bytemuck::cast_slice(&units[first / PARTS..]);
        let mut leaf = GrowingTriangles::new(self.frames[0], points);
        for done in (0..n).step_by(LANES) {
            let mut eight = Eight { rows: [[0.0; LANES]; 9], n: (n - done).min(LANES) };
            for lane in 0..eight.n {
                eight.set(lane, triangle_of(words, first % PARTS, n, done + lane));
            }
            eight.fill();
            leaf.add(&eight);
        }
        leaf.state((0..n).map(|i| triangle_of(words, first % PARTS, n, i)))
    }

    /// The leaf after the motion, which is written.
    pub(super) fn after(
        &self,
        path: AvailablePath,
        units: &mut [HalfBlock],
        first: usize,
        n: usize,
        points: Option<&mut Points>,
    ) -> LeafState {
        path.run(MovedLeaf { triangles: self, units, first, n, points })
    }

    #[inline(always)]
    fn after_on_path<S: Simd>(
        &self,
        simd: S,
        units: &mut [HalfBlock],
        first: usize,
        n: usize,
        points: Option<&mut Points>,
    ) -> LeafState {
        let (first, part) = (first / PARTS, first % PARTS);
        let mut leaf = GrowingTriangles::new(self.frames[1], points);
        let words: &mut [u32] = bytemuck::cast_slice_mut(&mut units[first..]);
        let (mut rest, mut done) = (words, 0);
        // Blocks of eight precede a last block of four.
        while n - done > 4 {
            let (block, after) = rest.split_at_mut(2 * HALF_BLOCK_WORDS);
            self.replace::<8, S>(simd, block, 0, (n - done).min(8), &mut leaf);
            (rest, done) = (after, done + 8.min(n - done));
        }
        if done < n {
            self.replace::<4, S>(simd, &mut rest[..HALF_BLOCK_WORDS], part * PART_LANES, n - done, &mut leaf);
        }
        let words: &[u32] = bytemuck::cast_slice(&units[first..]);
        leaf.state((0..n).map(|i| triangle_of(words, part, n, i)))
    }
}

/// A leaf of triangles that have moved.
struct MovedLeaf<'a, 'b> {
    triangles: &'a MovedTriangles<'a>,
    units: &'b mut [HalfBlock],
    first: usize,
    n: usize,
    points: Option<&'b mut Points>,
}

impl Task for MovedLeaf<'_, '_> {
    type Output = LeafState;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> LeafState {
        self.triangles.after_on_path(simd, self.units, self.first, self.n, self.points)
    }
}

/// Triangle `i` of a leaf of `n`, whose words start with its first half-block.
fn triangle_of(words: &[u32], part: usize, n: usize, i: usize) -> Corners {
    let lane = LaneWords::of(i, n, part);
    let mut corners = Corners::default();
    for (row, x) in corners.as_flattened_mut().iter_mut().enumerate() {
        *x = f32::from_bits(words[lane.word(row)]);
    }
    corners
}

impl MovedTriangles<'_> {
    /// Replaces `n` triangles from a lane of a block on, whose rows have `WIDTH` words.
    #[inline(always)]
    fn replace<const WIDTH: usize, S: Simd>(
        &self,
        simd: S,
        block: &mut [u32],
        lane: usize,
        n: usize,
        leaf: &mut GrowingTriangles,
    ) {
        let rows: &mut [[u32; WIDTH]; LaneWords::ID_ROW + 1] =
            block.as_chunks_mut::<WIDTH>().0.try_into().expect("a block has ten rows");
        let ids = &rows[LaneWords::ID_ROW][lane..lane + n];
        // In two steps, so that memory is read for all triangles at once.
        let mut triangles = [[0; 3]; LANES];
        for (triangle, &id) in triangles.iter_mut().zip(ids) {
            *triangle = self.triangles[id as usize];
        }
        let mut eight = Eight { rows: [[0.0; LANES]; 9], n };
        // Straight into the rows: an array of triangles would be read as a whole before all of its numbers have arrived.
        for (lane, &[a, b, c]) in triangles.iter().enumerate().take(n) {
            eight.set(lane, [self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]]);
        }
        eight.fill();
        eight.store_flat_as_edges(simd);
        for (row, xs) in rows.iter_mut().zip(&eight.rows) {
            for (word, x) in row[lane..lane + n].iter_mut().zip(xs) {
                *word = x.to_bits();
            }
        }
        leaf.add(&eight);
    }
}

/// Up to eight triangles.
struct Eight {
    rows: [[f32; LANES]; 9],
    n: usize,
}

impl Eight {
    /// Sets lanes without a triangle to a vertex of the first.
    #[inline(always)]
    fn fill(&mut self) {
        let (x, y, z) = (self.rows[0][0], self.rows[1][0], self.rows[2][0]);
        for lane in self.n..LANES {
            self.set(lane, [[x, y, z]; 3]);
        }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, [a, b, c]: Corners) {
        for (k, x) in [a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]].into_iter().enumerate() {
            self.rows[k][lane] = x;
        }
    }

    /// Replaces triangles without area by their longest edges.
    #[inline(always)]
    fn store_flat_as_edges<S: Simd>(&mut self, simd: S) {
        let may_be_flat = self.may_be_flat(simd);
        for lane in 0..self.n {
            if may_be_flat >> lane & 1 != 0 {
                self.set(lane, flat_as_edge(self.corners(lane)));
            }
        }
    }

    /// Mask of the lanes that may hold a triangle without area; the others certainly hold none.
    ///
    /// In a plane of two axes, the doubled area is `left - right`, two products of differences. In f32, without over- or underflow, it is
    /// off by less than
    /// `(3 + 16 u)·u·(|left| + |right|)` (Shewchuk 1997), u = 2^-24: 4 u cover that and the rounding of the bound. Where their sum
    /// exceeds 2^-100, what a product loses by underflow, at most 2^-149, is far below the spare.
    #[inline(always)]
    fn may_be_flat<S: Simd>(&self, simd: S) -> u32 {
        let bound = simd.splat(4.0 / (1 << 24) as f32);
        let (least, infinite) = (simd.splat(1.0 / (1_u128 << 100) as f32), simd.splat(f32::INFINITY));
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = &self.rows;
        let (cx, cy, cz) = (simd.load(cx), simd.load(cy), simd.load(cz));
        let u = [simd.sub(simd.load(ax), cx), simd.sub(simd.load(ay), cy), simd.sub(simd.load(az), cz)];
        let v = [simd.sub(simd.load(bx), cx), simd.sub(simd.load(by), cy), simd.sub(simd.load(bz), cz)];
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

    fn corners(&self, lane: usize) -> Corners {
        std::array::from_fn(|vertex| std::array::from_fn(|k| self.rows[3 * vertex + k][lane]))
    }
}

/// Primitives of the caller before and after a motion.
pub(super) struct MovedPrimitives<'a, P> {
    pub(super) primitives: [&'a [P]; 2],
    pub(super) frames: [MeshFrame; 2],
}

impl<'a, P: Primitive> MovedPrimitives<'a, P> {
    /// A leaf of these primitives before the motion, or after it.
    pub(super) fn leaf(&self, state: usize, ids: &[PrimId], items: Option<&mut Vec<Placed<'a, P>>>) -> LeafState {
        let (primitives, frame) = (self.primitives[state], &self.frames[state]);
        let area = ids.iter().map(|id| Placed::given(&primitives[id.index()]).area()).sum();
        if let Some(items) = items {
            items.extend(ids.iter().map(|id| Placed::given(&primitives[id.index()]).moved(frame.reference)));
        }
        LeafState { content: content_of(primitives, ids, frame), area }
    }
}

/// What the boxes around a leaf of these primitives depend on.
pub(crate) fn content_of<P: Primitive>(primitives: &[P], ids: &[PrimId], frame: &MeshFrame) -> Content {
    let (mut bounds, mut aligned) = (Aabb::EMPTY, Aabb::EMPTY);
    for id in ids {
        let given = Placed::given(&primitives[id.index()]);
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

/// A leaf as triangles are added, eight at a time.
struct GrowingTriangles<'a> {
    /// By axis and lane.
    min: [[f32; LANES]; 3],
    max: [[f32; LANES]; 3],
    /// Twice the sum of the areas, by lane.
    twice_area: [f32; LANES],
    frame: MeshFrame,
    /// Where vertices are kept: for a mesh frame of its own, or for oriented boxes.
    points: Option<&'a mut Points>,
    first_point: usize,
}

impl<'a> GrowingTriangles<'a> {
    fn new(frame: MeshFrame, points: Option<&'a mut Points>) -> Self {
        Self {
            min: [[f32::INFINITY; LANES]; 3],
            max: [[f32::NEG_INFINITY; LANES]; 3],
            twice_area: [0.0; LANES],
            frame,
            first_point: points.as_ref().map_or(0, |points| points.len()),
            points,
        }
    }

    #[inline(always)]
    fn add(&mut self, triangles: &Eight) {
        for (i, row) in triangles.rows.iter().enumerate() {
            for (min, &x) in self.min[i % 3].iter_mut().zip(row) {
                *min = if x < *min { x } else { *min };
            }
            for (max, &x) in self.max[i % 3].iter_mut().zip(row) {
                *max = if x > *max { x } else { *max };
            }
        }
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = &triangles.rows;
        for lane in 0..LANES {
            let (ux, uy, uz) = (bx[lane] - ax[lane], by[lane] - ay[lane], bz[lane] - az[lane]);
            let (vx, vy, vz) = (cx[lane] - ax[lane], cy[lane] - ay[lane], cz[lane] - az[lane]);
            let (x, y, z) = (uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
            self.twice_area[lane] += (x * x + y * y + z * z).sqrt();
        }
        if let Some(points) = &mut self.points {
            points.push_rows(&triangles.rows, triangles.n, self.frame.reference);
        }
    }

    /// The leaf, of whose triangles `all` are.
    #[inline(always)]
    fn state(self, all: impl Iterator<Item = Corners>) -> LeafState {
        let mut bounds = Aabb::EMPTY;
        for k in 0..3 {
            let (mut min, mut max) = (self.min[k], self.max[k]);
            for half in [4, 2, 1] {
                for lane in 0..half {
                    min[lane] = if min[lane + half] < min[lane] { min[lane + half] } else { min[lane] };
                    max[lane] = if max[lane + half] > max[lane] { max[lane + half] } else { max[lane] };
                }
            }
            (bounds.min[k], bounds.max[k]) = (min[0], max[0]);
        }
        // Squares of great and of small coordinates leave the range of f32, and subnormal ones lose digits.
        let twice_area: f32 = self.twice_area.iter().sum();
        let area = if (LEAST_AREA..f32::INFINITY).contains(&twice_area) {
            0.5 * f64::from(twice_area)
        } else {
            all.map(|corners| corners.area()).sum()
        };
        let mut content = content(bounds, Aabb::EMPTY, &self.frame);
        if !self.frame.is_identity {
            let points = self.points.expect("vertices are kept where the frame is not that of object space");
            let slabs = points.slabs(self.first_point..points.len(), self.frame.rows, content.reach);
            content.aligned = Aabb { min: slabs.lo, max: slabs.hi };
        }
        LeafState { content, area }
    }
}

#[cfg(test)]
mod tests {
    use canted_obb::{Aabb, Obb};
    use canted_trace::{ReferencePoint, Slabs};

    use super::*;
    use crate::leaf::{StoredTriangles, unused_lanes_are_zero};
    use crate::node::checked::{CheckedLeaf, Hierarchy};
    use crate::node::{LeafLayout, MAX_LEAF};
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
            let mut eight = Eight { rows: [[0.0; LANES]; 9], n };
            triangles.iter().enumerate().take(n).for_each(|(lane, &triangle)| eight.set(lane, triangle));
            eight.fill();
            let may_be_flat = eight.may_be_flat(crate::simd::Scalar);
            eight.store_flat_as_edges(crate::simd::Scalar);
            for (lane, &triangle) in triangles.iter().enumerate().take(n) {
                let want = flat_as_edge(triangle);
                assert_eq!(eight.corners(lane), want, "{triangle:?}");
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
            let leaves = MovedTriangles { positions: moved.as_flattened(), triangles: &triangles, frames: [frame; 2] };
            let mut taken = Points::default();
            let state = leaves.after(AvailablePath::detect(), &mut halves, 0, n, Some(&mut taken));
            assert_eq!(taken.len(), 3 * n);
            let slabs = taken.slabs(0..3 * n, Obb::IDENTITY_FRAME, f32::INFINITY);
            assert_eq!(slabs, Slabs::from_points(Obb::IDENTITY_FRAME, moved.iter().flatten().copied()));
            assert_eq!(state.content.bounds, leaves.before(&halves, 0, n, None).content.bounds);
            assert_eq!(state.content.bounds, Aabb::from_points(moved.iter().flatten().copied()));
            assert_eq!(StoredTriangles::read(&hierarchy, &halves), StoredTriangles { corners: moved, ids });
            assert_eq!(unused_lanes_are_zero(&leaf, &halves), n % 4 == 0, "{n}");
        }
    }
}
