//! Primitives in the form that builds and refits use: boxes along any frame, and what frames are fitted to, all relative to the
//! reference point of the BVH.

use canted_lbvh::{Corners, Leaf, Tree};
use canted_obb::{Aabb, Obb, eigen};
use canted_trace::{ReferencePoint, Slabs};

use crate::build::frames::{self, BoxAreas, Fits, FrameConfig, ScaledBalls, ScaledShape, ScaledTriangle};
use crate::leaf::{Placed, extents_within};
use crate::par;

/// Items of one job.
const CHUNK: usize = 1 << 13;

/// The vertices of a triangle, or a primitive of the caller.
pub(crate) trait Item: Copy + Send + Sync {
    /// Whether oriented nodes are fitted to the tree of groups of two with its groups divided, instead of one of the builders: over curves and spheres
    /// it takes half the time and has fewer nodes a ray (`benches/TRIED.md`); over other shapes it was not measured.
    const REFINES_GROUPS: bool;

    /// What an aligned node costs for its memory, relative to the cost of a primitive in a BVH with aligned nodes; an oriented one twice
    /// as much. Counted where oriented nodes are used: without it up to a third of their slots are empty.
    const MEMORY_COST: f32;

    /// Relative to this point of object space; the item is not moved yet.
    fn moved(self, reference: ReferencePoint) -> Self;

    /// Axis-aligned box, object space.
    fn aabb(&self) -> Aabb;

    /// The box with these rows around several items, rounded outward.
    fn slabs(items: &[Self], rows: [[f32; 3]; 3]) -> Slabs;

    /// Two edges of a triangle that represents its orientation and size.
    fn edges(&self) -> [[f64; 3]; 2];

    /// Surface area; of other primitives than triangles, of a box around it.
    fn area(&self) -> f64;

    /// Frames for a tree over these items, which are in leaf order and multiplied by `scale`, as [`frames::fit`] finds them.
    fn fits(items: &[Self], scale: f32, tree: &Tree, mesh_frame: [[f32; 3]; 3], boxes: &BoxAreas) -> Fits;
}

/// Items by number.
pub(crate) enum Items<'a, I> {
    /// In an array.
    Array(&'a [I]),
    /// Their number, and a function that makes one. The vertices of a mesh's triangles in an array would take as much memory as all leaves
    /// of a BVH.
    Made(usize, &'a (dyn Fn(usize) -> I + Sync)),
}

impl<I> Copy for Items<'_, I> {}

impl<I> Clone for Items<'_, I> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<I: Item> Items<'_, I> {
    /// Their number.
    pub(crate) fn n(self) -> usize {
        match self {
            Self::Array(items) => items.len(),
            Self::Made(n, _) => n,
        }
    }

    #[inline]
    pub(crate) fn get(self, i: usize) -> I {
        match self {
            Self::Array(items) => items[i],
            Self::Made(_, make) => make(i),
        }
    }
}

/// Boxes of items along `rows`, rounded outward.
pub(crate) fn boxes<I: Item>(items: Items<I>, rows: [[f32; 3]; 3]) -> Vec<Aabb> {
    let identity = rows == Obb::IDENTITY_FRAME;
    par::from_fn(items.n(), CHUNK, |i| {
        let item = items.get(i);
        if identity { item.aabb() } else { rotated_box(&item, &rows) }
    })
}

/// The box of an item along `rows`, rounded outward.
pub(crate) fn rotated_box<I: Item>(item: &I, rows: &[[f32; 3]; 3]) -> Aabb {
    let slabs = I::slabs(std::slice::from_ref(item), *rows);
    Aabb { min: slabs.lo, max: slabs.hi }
}

/// The items relative to `reference`; `None` where that is how they are given.
pub(crate) fn moved<I: Item>(items: &[I], reference: ReferencePoint) -> Option<Vec<I>> {
    (!reference.is_origin()).then(|| par::map(items, CHUNK, |item| item.moved(reference)))
}

impl Item for Corners {
    const REFINES_GROUPS: bool = false;
    const MEMORY_COST: f32 = 0.0;

    #[inline]
    fn moved(self, reference: ReferencePoint) -> Self {
        self.map(|vertex| reference.moved(vertex))
    }

    fn aabb(&self) -> Aabb {
        Leaf::aabb(self)
    }

    fn slabs(items: &[Self], rows: [[f32; 3]; 3]) -> Slabs {
        Slabs::from_points(rows, items.iter().flatten().copied())
    }

    /// In `f64`, where no difference of coordinates overflows.
    fn edges(&self) -> [[f64; 3]; 2] {
        let [a, b, c] = *self;
        [b, c].map(|end| std::array::from_fn(|k| f64::from(end[k]) - f64::from(a[k])))
    }

    fn area(&self) -> f64 {
        let [u, v] = self.edges();
        let normal: [f64; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            u[i] * v[j] - u[j] * v[i]
        });
        0.5 * normal.iter().map(|x| x * x).sum::<f64>().sqrt()
    }

    fn fits(items: &[Self], scale: f32, tree: &Tree, mesh_frame: [[f32; 3]; 3], boxes: &BoxAreas) -> Fits {
        frames::fit(tree, &ScaledTriangle::all(items, scale), mesh_frame, boxes, &FrameConfig::default())
    }
}

impl Item for Placed<'_> {
    const REFINES_GROUPS: bool = true;
    const MEMORY_COST: f32 = 0.2;

    fn moved(self, reference: ReferencePoint) -> Self {
        Self { reference, ..self }
    }

    fn aabb(&self) -> Aabb {
        self.reference.moved_box(&self.bounds)
    }

    fn slabs(items: &[Self], rows: [[f32; 3]; 3]) -> Slabs {
        let [lo, hi] = extents_within(&rows, items);
        Slabs { rows, lo, hi }
    }

    /// The two longest edges of the box along its principal axes.
    fn edges(&self) -> [[f64; 3]; 2] {
        let (rows, extents) = principal_box(self);
        let mut order = [0, 1, 2];
        order.sort_by(|&a: &usize, &b: &usize| extents[b].total_cmp(&extents[a]));
        [order[0], order[1]].map(|k| rows[k].map(|x| f64::from(x) * extents[k]))
    }

    fn area(&self) -> f64 {
        let [x, y, z] = principal_box(self).1;
        x * y + y * z + z * x
    }

    fn fits(items: &[Self], scale: f32, tree: &Tree, mesh_frame: [[f32; 3]; 3], boxes: &BoxAreas) -> Fits {
        let config = FrameConfig::default();
        if let Some(balls) = ScaledBalls::all(items, scale) {
            return frames::fit(tree, &balls, mesh_frame, boxes, &config);
        }
        let shapes: Vec<_> = items.iter().map(|&placed| ScaledShape { placed, scale }).collect();
        frames::fit(tree, &shapes, mesh_frame, boxes, &config)
    }
}

/// The principal axes of a primitive, and its extents along them.
fn principal_box(placed: &Placed) -> ([[f32; 3]; 3], [f64; 3]) {
    let moments = placed.primitive.moments();
    let [_, xy, xz, _, yz, _] = moments.scatter;
    if [xy, xz, yz] == [0.0; 3] {
        let Aabb { min, max } = placed.bounds;
        let extent = |k: usize| (f64::from(max[k]) - f64::from(min[k])).max(0.0);
        return (Obb::IDENTITY_FRAME, std::array::from_fn(extent));
    }
    let axes = moments.axes(eigen::COARSE);
    let rows = if axes.as_flattened().iter().all(|x| x.is_finite()) { axes } else { Obb::IDENTITY_FRAME };
    let [lo, hi] = extents_within(&rows, &[placed.moved(ReferencePoint::ORIGIN)]);
    (rows, std::array::from_fn(|k| (f64::from(hi[k]) - f64::from(lo[k])).max(0.0)))
}
