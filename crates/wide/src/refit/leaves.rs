//! Leaves before and after a motion: blocks of triangles, and primitives of the caller.

use canted_lbvh::Corners;
use canted_obb::{Aabb, PrimId};
use glam::Vec3A;

use super::subtree::{Content, LeafState, Leaves};
use crate::item::{self, Item};
use crate::layout::{HALF_WORDS, Half, Lane, PART_LANES, PARTS};
use crate::primitive::Primitive;

/// Rows of the mesh frame; `None` if they are the axes of object space.
pub(super) type Rotation = Option<[[f32; 3]; 3]>;

/// Triangles of a mesh that has moved. Every index is valid.
pub(super) struct MovedTriangles<'a> {
    pub(super) positions: &'a [[f32; 3]],
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) rotation: Rotation,
}

impl Leaves<Corners, Half> for MovedTriangles<'_> {
    fn before(&self, units: &[Half], first: usize, n: usize, mut items: Option<&mut Vec<Corners>>) -> LeafState {
        let words: &[u32] = bytemuck::cast_slice(&units[first / PARTS..]);
        let mut leaf = GrowingTriangles::new(self.rotation);
        for corners in triangles_of(words, first % PARTS, n) {
            leaf.add(corners);
            if let Some(items) = &mut items {
                items.push(corners);
            }
        }
        leaf.state(|| triangles_of(words, first % PARTS, n))
    }

    fn after(&self, units: &mut [Half], first: usize, n: usize, mut items: Option<&mut Vec<Corners>>) -> LeafState {
        let (first, part) = (first / PARTS, first % PARTS);
        let mut leaf = GrowingTriangles::new(self.rotation);
        let mut take = |corners| {
            leaf.add(corners);
            if let Some(items) = &mut items {
                items.push(corners);
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
            let corners = self.triangles[rows[Lane::ID_ROW][lane] as usize].map(|vertex| self.positions[vertex as usize]);
            for (row, x) in rows.iter_mut().zip(corners.as_flattened()) {
                row[lane] = x.to_bits();
            }
            take(corners);
        }
    }
}

/// Primitives of the caller before and after a motion.
pub(super) struct MovedPrimitives<'a, P> {
    pub(super) old: &'a [P],
    pub(super) new: &'a [P],
    pub(super) rotation: Rotation,
}

impl<'a, P: Primitive> MovedPrimitives<'a, P> {
    fn leaf(&self, primitives: &'a [P], ids: &[PrimId], items: Option<&mut Vec<&'a P>>) -> LeafState {
        let mut leaf = Growing::new(self.rotation);
        ids.iter().for_each(|id| leaf.add(&primitives[id.index()]));
        if let Some(items) = items {
            items.extend(ids.iter().map(|id| &primitives[id.index()]));
        }
        leaf.state()
    }
}

impl<'a, P: Primitive> Leaves<&'a P, PrimId> for MovedPrimitives<'a, P> {
    fn before(&self, units: &[PrimId], first: usize, n: usize, items: Option<&mut Vec<&'a P>>) -> LeafState {
        self.leaf(self.old, &units[first..first + n], items)
    }

    fn after(&self, units: &mut [PrimId], first: usize, n: usize, items: Option<&mut Vec<&'a P>>) -> LeafState {
        self.leaf(self.new, &units[first..first + n], items)
    }
}

/// A leaf as triangles are added, all of a vertex in one instruction.
struct GrowingTriangles {
    min: Vec3A,
    max: Vec3A,
    aligned: Aabb,
    /// Twice the sum of the areas.
    twice_area: f32,
    rotation: Rotation,
}

impl GrowingTriangles {
    fn new(rotation: Rotation) -> Self {
        Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY, aligned: Aabb::EMPTY, twice_area: 0.0, rotation }
    }

    #[inline(always)]
    fn add(&mut self, corners: Corners) {
        let [a, b, c] = corners.map(Vec3A::from);
        self.min = self.min.min(a.min(b)).min(c);
        self.max = self.max.max(a.max(b)).max(c);
        self.twice_area += (b - a).cross(c - a).length();
        if let Some(rows) = &self.rotation {
            self.aligned = self.aligned.union(item::rotated_box(&corners, rows));
        }
    }

    /// The leaf, of whose triangles `all` are.
    fn state<I: Iterator<Item = Corners>>(self, all: impl FnOnce() -> I) -> LeafState {
        let bounds = Aabb { min: self.min.to_array(), max: self.max.to_array() };
        let aligned = if self.rotation.is_some() { self.aligned } else { bounds };
        // Squares of great and of small coordinates leave the range of f32.
        let area = if (f32::MIN_POSITIVE..f32::INFINITY).contains(&self.twice_area) {
            0.5 * f64::from(self.twice_area)
        } else {
            all().map(|corners| corners.area()).sum()
        };
        LeafState { content: Content { bounds, aligned }, area }
    }
}

/// A leaf as items are added.
struct Growing {
    bounds: Aabb,
    aligned: Aabb,
    area: f64,
    rotation: Rotation,
}

impl Growing {
    fn new(rotation: Rotation) -> Self {
        Self { bounds: Aabb::EMPTY, aligned: Aabb::EMPTY, area: 0.0, rotation }
    }

    #[inline(always)]
    fn add<I: Item>(&mut self, item: I) {
        self.bounds = self.bounds.union(item.aabb());
        self.area += item.area();
        if let Some(rows) = &self.rotation {
            self.aligned = self.aligned.union(item::rotated_box(&item, rows));
        }
    }

    fn state(self) -> LeafState {
        let aligned = if self.rotation.is_some() { self.aligned } else { self.bounds };
        LeafState { content: Content { bounds: self.bounds, aligned }, area: self.area }
    }
}
