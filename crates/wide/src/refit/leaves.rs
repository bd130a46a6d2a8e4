//! Leaves before and after a motion: blocks of triangles, and primitives of the caller.

use canted_lbvh::Corners;
use canted_obb::{Aabb, PrimId};

use super::subtree::{Content, LeafState, Leaves};
use crate::item::{self, Item, Placed};
use crate::layout::{HALF_WORDS, Half, Lane, PART_LANES, PARTS};
use crate::primitive::Primitive;
use crate::traverse::MeshFrame;

/// Triangles of a mesh that has moved. Every index is valid.
pub(super) struct MovedTriangles<'a> {
    pub(super) positions: &'a [[f32; 3]],
    pub(super) triangles: &'a [[u32; 3]],
    /// Before and after the motion.
    pub(super) frames: [MeshFrame; 2],
}

impl Leaves<Corners, Half> for MovedTriangles<'_> {
    fn before(&self, units: &[Half], first: usize, n: usize, mut items: Option<&mut Vec<Corners>>) -> LeafState {
        let words: &[u32] = bytemuck::cast_slice(&units[first / PARTS..]);
        let mut leaf = GrowingTriangles::new(self.frames[0]);
        for done in (0..n).step_by(LANES) {
            let in_lane = |i: usize| triangle_of(words, first % PARTS, n, done + i);
            leaf.add(&Eight::gather((n - done).min(LANES), in_lane), items.as_deref_mut());
        }
        leaf.state((0..n).map(|i| triangle_of(words, first % PARTS, n, i)))
    }

    fn after(&self, units: &mut [Half], first: usize, n: usize, mut items: Option<&mut Vec<Corners>>) -> LeafState {
        let (first, part) = (first / PARTS, first % PARTS);
        let mut leaf = GrowingTriangles::new(self.frames[1]);
        let mut take = |triangles: &Eight| leaf.add(triangles, items.as_deref_mut());
        let words: &mut [u32] = bytemuck::cast_slice_mut(&mut units[first..]);
        let (mut rest, mut done) = (words, 0);
        // Blocks of eight precede a last block of four.
        while n - done > 4 {
            let (block, after) = rest.split_at_mut(2 * HALF_WORDS);
            self.replace::<8>(block, 0, (n - done).min(8), &mut take);
            (rest, done) = (after, done + 8.min(n - done));
        }
        if done < n {
            self.replace::<4>(&mut rest[..HALF_WORDS], part * PART_LANES, n - done, &mut take);
        }
        let words: &[u32] = bytemuck::cast_slice(&units[first..]);
        leaf.state((0..n).map(|i| triangle_of(words, part, n, i)))
    }
}

/// Triangle `i` of a leaf of `n`, whose words start with its first half-block.
fn triangle_of(words: &[u32], part: usize, n: usize, i: usize) -> Corners {
    let lane = Lane::of(i, n, part);
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
        let rows: &mut [[u32; WIDTH]; Lane::ID_ROW + 1] =
            block.as_chunks_mut::<WIDTH>().0.try_into().expect("a block has ten rows");
        let ids = &rows[Lane::ID_ROW][lane..lane + n];
        // In two steps, so that memory is read for all triangles at once.
        let mut triangles = [[0; 3]; LANES];
        for (triangle, &id) in triangles.iter_mut().zip(ids) {
            *triangle = self.triangles[id as usize];
        }
        let eight = Eight::gather(n, |i| triangles[i].map(|vertex| self.positions[vertex as usize]));
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
    /// Before the motion, or after it.
    fn leaf(&self, state: usize, ids: &[PrimId], items: Option<&mut Vec<Placed<'a, P>>>) -> LeafState {
        let (primitives, frame) = (self.primitives[state], &self.frames[state]);
        let (mut bounds, mut aligned, mut area) = (Aabb::EMPTY, Aabb::EMPTY, 0.0);
        for id in ids {
            let given = Placed::given(&primitives[id.index()]);
            bounds = bounds.union(given.aabb());
            area += given.area();
            if !frame.is_identity {
                aligned = aligned.union(item::rotated_box(&given.moved(frame.reference), &frame.rows));
            }
        }
        if let Some(items) = items {
            items.extend(ids.iter().map(|id| Placed::given(&primitives[id.index()]).moved(frame.reference)));
        }
        LeafState { content: Content::new(bounds, aligned, frame), area }
    }
}

impl<'a, P: Primitive> Leaves<Placed<'a, P>, PrimId> for MovedPrimitives<'a, P> {
    fn before(&self, units: &[PrimId], first: usize, n: usize, items: Option<&mut Vec<Placed<'a, P>>>) -> LeafState {
        self.leaf(0, &units[first..first + n], items)
    }

    fn after(&self, units: &mut [PrimId], first: usize, n: usize, items: Option<&mut Vec<Placed<'a, P>>>) -> LeafState {
        self.leaf(1, &units[first..first + n], items)
    }
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
        LeafState { content: Content::new(bounds, self.aligned, &self.frame), area }
    }
}
