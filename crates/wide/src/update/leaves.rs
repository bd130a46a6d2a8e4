//! Leaves before and after a motion: blocks of triangles, and primitives of the caller.

use canted_lbvh::Corners;
use canted_obb::{Aabb, PrimId, flat_as_edge};

use super::subtree::LeafState;
use crate::build::item::{self, Item};
use crate::leaf::{Placed, Primitive};
use crate::node::{Content, HALF_BLOCK_WORDS, HalfBlock, LaneWords, PART_LANES, PARTS};
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
    pub(super) fn before(
        &self,
        units: &[HalfBlock],
        first: usize,
        n: usize,
        mut items: Option<&mut Vec<Corners>>,
    ) -> LeafState {
        let words: &[u32] = bytemuck::cast_slice(&units[first / PARTS..]);
        let mut leaf = GrowingTriangles::new(self.frames[0]);
        for done in (0..n).step_by(LANES) {
            let in_lane = |i: usize| triangle_of(words, first % PARTS, n, done + i);
            leaf.add(&Eight::gather((n - done).min(LANES), in_lane), items.as_deref_mut());
        }
        leaf.state((0..n).map(|i| triangle_of(words, first % PARTS, n, i)))
    }

    /// The leaf after the motion, which is written.
    pub(super) fn after(
        &self,
        units: &mut [HalfBlock],
        first: usize,
        n: usize,
        mut items: Option<&mut Vec<Corners>>,
    ) -> LeafState {
        let (first, part) = (first / PARTS, first % PARTS);
        let mut leaf = GrowingTriangles::new(self.frames[1]);
        let mut take = |triangles: &Eight| leaf.add(triangles, items.as_deref_mut());
        let words: &mut [u32] = bytemuck::cast_slice_mut(&mut units[first..]);
        let (mut rest, mut done) = (words, 0);
        // Blocks of eight precede a last block of four.
        while n - done > 4 {
            let (block, after) = rest.split_at_mut(2 * HALF_BLOCK_WORDS);
            self.replace::<8>(block, 0, (n - done).min(8), &mut take);
            (rest, done) = (after, done + 8.min(n - done));
        }
        if done < n {
            self.replace::<4>(&mut rest[..HALF_BLOCK_WORDS], part * PART_LANES, n - done, &mut take);
        }
        let words: &[u32] = bytemuck::cast_slice(&units[first..]);
        leaf.state((0..n).map(|i| triangle_of(words, part, n, i)))
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
    fn replace<const WIDTH: usize>(&self, block: &mut [u32], lane: usize, n: usize, take: &mut impl FnMut(&Eight)) {
        let rows: &mut [[u32; WIDTH]; LaneWords::ID_ROW + 1] =
            block.as_chunks_mut::<WIDTH>().0.try_into().expect("a block has ten rows");
        let ids = &rows[LaneWords::ID_ROW][lane..lane + n];
        // In two steps, so that memory is read for all triangles at once.
        let mut triangles = [[0; 3]; LANES];
        for (triangle, &id) in triangles.iter_mut().zip(ids) {
            *triangle = self.triangles[id as usize];
        }
        let eight = Eight::gather(n, |i| flat_as_edge(triangles[i].map(|vertex| self.positions[vertex as usize])));
        for (row, xs) in rows.iter_mut().zip(&eight.rows) {
            for (word, x) in row[lane..lane + n].iter_mut().zip(xs) {
                *word = x.to_bits();
            }
        }
        take(&eight);
    }
}

/// Triangles of a block of eight.
const LANES: usize = 8;

/// Up to eight triangles by coordinate: nine rows, the vertices one after another.
struct Eight {
    rows: [[f32; LANES]; 9],
    n: usize,
}

impl Eight {
    /// The first `n` of these triangles, at least one; the other lanes hold a vertex of the first.
    #[inline(always)]
    fn gather(n: usize, triangle: impl Fn(usize) -> Corners) -> Self {
        let mut all = [[[0.0; 3]; 3]; LANES];
        for (i, corners) in all.iter_mut().enumerate().take(n) {
            *corners = triangle(i);
        }
        let point = [all[0][0]; 3];
        all[n..].fill(point);
        let mut rows = [[0.0; LANES]; 9];
        for (lane, corners) in all.iter().enumerate() {
            for (row, &x) in rows.iter_mut().zip(corners.as_flattened()) {
                row[lane] = x;
            }
        }
        Self { rows, n }
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
struct GrowingTriangles {
    /// By axis and lane.
    min: [[f32; LANES]; 3],
    max: [[f32; LANES]; 3],
    aligned: Aabb,
    /// Twice the sum of the areas, by lane.
    twice_area: [f32; LANES],
    frame: MeshFrame,
}

impl GrowingTriangles {
    fn new(frame: MeshFrame) -> Self {
        Self {
            min: [[f32::INFINITY; LANES]; 3],
            max: [[f32::NEG_INFINITY; LANES]; 3],
            aligned: Aabb::EMPTY,
            twice_area: [0.0; LANES],
            frame,
        }
    }

    #[inline(always)]
    fn add(&mut self, triangles: &Eight, items: Option<&mut Vec<Corners>>) {
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
        if !self.frame.is_identity {
            for lane in 0..triangles.n {
                let moved = triangles.corners(lane).moved(self.frame.reference);
                self.aligned = self.aligned.union(item::rotated_box(&moved, &self.frame.rows));
            }
        }
        if let Some(items) = items {
            items.extend((0..triangles.n).map(|lane| triangles.corners(lane).moved(self.frame.reference)));
        }
    }

    /// The leaf, of whose triangles `all` are.
    fn state(self, all: impl Iterator<Item = Corners>) -> LeafState {
        let bounds = Aabb {
            min: self.min.map(|xs| xs.into_iter().fold(f32::INFINITY, f32::min)),
            max: self.max.map(|xs| xs.into_iter().fold(f32::NEG_INFINITY, f32::max)),
        };
        // Squares of great and of small coordinates leave the range of f32, and subnormal ones lose digits.
        let twice_area: f32 = self.twice_area.iter().sum();
        let area = if (LEAST_AREA..f32::INFINITY).contains(&twice_area) {
            0.5 * f64::from(twice_area)
        } else {
            all.map(|corners| corners.area()).sum()
        };
        LeafState { content: content(bounds, self.aligned, &self.frame), area }
    }
}

#[cfg(test)]
mod tests {
    use canted_obb::{Aabb, Obb};
    use canted_trace::ReferencePoint;

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
            let mut taken = vec![];
            let state = leaves.after(&mut halves, 0, n, Some(&mut taken));
            assert_eq!(taken, moved);
            assert_eq!(state.content.bounds, leaves.before(&halves, 0, n, None).content.bounds);
            assert_eq!(state.content.bounds, Aabb::from_points(moved.iter().flatten().copied()));
            assert_eq!(StoredTriangles::read(&hierarchy, &halves), StoredTriangles { corners: moved, ids });
            assert_eq!(unused_lanes_are_zero(&leaf, &halves), n % 4 == 0, "{n}");
        }
    }
}
