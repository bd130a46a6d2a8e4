//! The items that trees are built over.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use canted_lbvh::Corners;
use canted_obb::{Aabb, Obb};

use super::count;
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation};

/// The items of one tree, as a range of the level's items.
///
/// Its leaves use the same range of positions. Its inner nodes use the same range of slots, the last of which is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Range {
    /// The first item.
    pub first: u32,
    /// Number of items.
    pub count: u32,
}

/// The items of a level. All trees of a level are built together.
pub struct Items {
    ranges: Vec<Range>,
    n: u32,
    device_ranges: Buffer<Range>,
    pub(super) leaf: Leaf,
}

/// The kind of an item.
pub(super) enum Leaf {
    /// A triangle of a mesh.
    Triangle { corners: Arc<Buffer<Corners>> },
    /// World-space box of an instance, and its axis-aligned bounding box.
    Box { boxes: Buffer<Obb>, aabbs: Buffer<Aabb> },
}

impl Items {
    /// Triangles, one tree per mesh.
    ///
    /// # Errors
    /// A vertex that is not finite, by mesh and triangle; out of memory.
    pub fn triangles<'m>(gpu: &Gpu, meshes: impl IntoIterator<Item = &'m [Corners]>) -> Result<Self, GpuError> {
        let mut all = vec![];
        let mut ranges = vec![];
        for (mesh, corners) in meshes.into_iter().enumerate() {
            let is_bad = |corners: &Corners| !corners.iter().flatten().all(|x| x.is_finite());
            if let Some(triangle) = corners.iter().position(is_bad) {
                let message = format!("mesh {mesh}: triangle {triangle} has a vertex that is not finite");
                return Err(GpuError::Input { message });
            }
            ranges.push(Range { first: count(all.len()), count: count(corners.len()) });
            all.extend_from_slice(corners);
        }
        let leaf = Leaf::Triangle { corners: Arc::new(gpu.buffer("corners", &all)?) };
        Self::new(gpu, ranges, leaf)
    }

    /// Boxes of instances, in one tree.
    ///
    /// # Errors
    /// Out of memory.
    pub fn boxes(gpu: &Gpu, boxes: &[Obb]) -> Result<Self, GpuError> {
        let ranges = vec![Range { first: 0, count: count(boxes.len()) }];
        let aabbs: Vec<Aabb> = boxes.iter().map(Obb::aabb).collect();
        let leaf =
            Leaf::Box { boxes: gpu.buffer("boxes", boxes)?, aabbs: gpu.buffer("axis-aligned boxes of items", &aabbs)? };
        Self::new(gpu, ranges, leaf)
    }

    /// Boxes of `n` instances in one tree, which are not computed yet; see [`super::place`].
    pub(crate) fn unplaced(gpu: &Gpu, n: u32) -> Result<Self, GpuError> {
        let (boxes, aabbs) = (gpu.zeroed("boxes", n as usize)?, gpu.zeroed("axis-aligned boxes of items", n as usize)?);
        Self::new(gpu, vec![Range { first: 0, count: n }], Leaf::Box { boxes, aabbs })
    }

    pub(super) fn new(gpu: &Gpu, ranges: Vec<Range>, leaf: Leaf) -> Result<Self, GpuError> {
        let n = ranges.iter().map(|range| range.count).sum();
        Ok(Self { device_ranges: gpu.buffer("ranges of trees", &ranges)?, n, ranges, leaf })
    }

    /// Number of items of all trees.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.n
    }

    /// Whether there are no items.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// The items of each tree.
    #[must_use]
    pub fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    /// The items of a range of trees.
    pub(crate) fn of_trees(&self, [first, end]: [u32; 2]) -> [u32; 2] {
        let first_item = |tree: u32| self.ranges.get(tree as usize).map_or(self.n, |range| range.first);
        [first_item(first), first_item(end)]
    }

    /// The vertices of the triangles; none for boxes.
    pub(crate) fn corners(&self) -> Option<&Arc<Buffer<Corners>>> {
        match &self.leaf {
            Leaf::Triangle { corners } => Some(corners),
            Leaf::Box { .. } => None,
        }
    }

    /// Bits of a tree index.
    pub(super) fn tree_bits(&self) -> u32 {
        count(self.ranges.len()).max(1).next_power_of_two().ilog2()
    }

    /// The shader part that reads these items.
    pub(crate) fn part(&self) -> Specialisation {
        let file = match self.leaf {
            Leaf::Triangle { .. } => "shared/item/triangles",
            Leaf::Box { .. } => "shared/item/boxes",
        };
        Specialisation::none().part("item", file)
    }

    /// `more`, and the bindings of that part and of `shared/build/tree/forest`.
    pub(crate) fn bound<'a>(&'a self, more: &[NamedBinding<'a>]) -> Vec<NamedBinding<'a>> {
        let mut bound: Vec<NamedBinding<'a>> = vec![("ranges", &self.device_ranges)];
        match &self.leaf {
            Leaf::Triangle { corners } => bound.push(("corners", &**corners)),
            Leaf::Box { boxes, aabbs } => {
                let both: [NamedBinding<'a>; 2] = [("item_boxes", boxes), ("item_aabbs", aabbs)];
                bound.extend(both);
            }
        }
        bound.extend_from_slice(more);
        bound
    }
}
