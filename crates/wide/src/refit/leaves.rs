//! Leaves before and after a motion: blocks of triangles, and primitives of the caller.

use canted_lbvh::Corners;
use canted_obb::{Aabb, PrimId};
use glam::Vec3A;

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
        for corners in triangles_of(words, first % PARTS, n) {
            leaf.add(corners);
            if let Some(items) = &mut items {
                items.push(corners.moved(self.frames[0].reference));
            }
        }
        leaf.state(|| triangles_of(words, first % PARTS, n))
    }

    fn after(&self, units: &mut [Half], first: usize, n: usize, mut items: Option<&mut Vec<Corners>>) -> LeafState {
        let (first, part) = (first / PARTS, first % PARTS);
        let mut leaf = GrowingTriangles::new(self.frames[1]);
        let mut take = |corners: Corners| {
            leaf.add(corners);
            if let Some(items) = &mut items {
                items.push(corners.moved(self.frames[1].reference));
            }
        };
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
        leaf.state(|| triangles_of(bytemuck::cast_slice(&units[first..]), part, n))
    }
}

/// The triangles of a leaf of `n`, whose words start with its first half-block.
fn triangles_of(words: &[u32], part: usize, n: usize) -> impl Iterator<Item = Corners> {
    (0..n).map(move |i| {
        let lane = Lane::of(i, n, part);
        let mut corners = Corners::default();
        for (row, x) in corners.as_flattened_mut().iter_mut().enumerate() {
            *x = f32::from_bits(words[lane.word(row)]);
        }
        corners
    })
}

impl MovedTriangles<'_> {
    /// Replaces `n` triangles from a lane of a block on, whose rows have `LANES` words.
    #[inline(always)]
    fn replace<const LANES: usize>(&self, block: &mut [u32], lane: usize, n: usize, take: &mut impl FnMut(Corners)) {
        let rows: &mut [[u32; LANES]; Lane::ID_ROW + 1] =
            block.as_chunks_mut::<LANES>().0.try_into().expect("a block has ten rows");
        for lane in lane..lane + n {
            let corners =
                self.triangles[rows[Lane::ID_ROW][lane] as usize].map(|vertex| self.positions[vertex as usize]);
            for (row, x) in rows.iter_mut().zip(corners.as_flattened()) {
                row[lane] = x.to_bits();
            }
            take(corners);
        }
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

/// A leaf as triangles are added, all of a vertex in one instruction.
struct GrowingTriangles {
    min: Vec3A,
    max: Vec3A,
    aligned: Aabb,
    /// Twice the sum of the areas.
    twice_area: f32,
    frame: MeshFrame,
}

impl GrowingTriangles {
    fn new(frame: MeshFrame) -> Self {
        Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY, aligned: Aabb::EMPTY, twice_area: 0.0, frame }
    }

    #[inline(always)]
    fn add(&mut self, corners: Corners) {
        let [a, b, c] = corners.map(Vec3A::from);
        self.min = self.min.min(a.min(b)).min(c);
        self.max = self.max.max(a.max(b)).max(c);
        self.twice_area += (b - a).cross(c - a).length();
        if !self.frame.is_identity {
            let moved = corners.moved(self.frame.reference);
            self.aligned = self.aligned.union(item::rotated_box(&moved, &self.frame.rows));
        }
    }

    /// The leaf, of whose triangles `all` are.
    fn state<I: Iterator<Item = Corners>>(self, all: impl FnOnce() -> I) -> LeafState {
        let bounds = Aabb { min: self.min.to_array(), max: self.max.to_array() };
        // Squares of great and of small coordinates leave the range of f32, and subnormal ones lose digits.
        let area = if (LEAST_AREA..f32::INFINITY).contains(&self.twice_area) {
            0.5 * f64::from(self.twice_area)
        } else {
            all().map(|corners| corners.area()).sum()
        };
        LeafState { content: Content::new(bounds, self.aligned, &self.frame), area }
    }
}
