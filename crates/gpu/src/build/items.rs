//! What trees are built over.

use bytemuck::{Pod, Zeroable};
use canted_lbvh::Corners;
use canted_obb::{Aabb, Obb};

use super::count;
use crate::{Buffer, Gpu, GpuError, NamedBinding, Specialisation};

/// Items of one tree, numbered among those of its level.
///
/// Their leaves lie in the same range of positions, their inner nodes in the same range of slots, whose last one is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Range {
    /// The first item.
    pub first: u32,
    /// Number of items.
    pub count: u32,
}

/// The items of a level and the trees over them, which are built together.
pub struct Items {
    ranges: Vec<Range>,
    n: u32,
    device_ranges: Buffer<Range>,
    pub(super) leaf: Leaf,
}

/// What an item is.
pub(super) enum Leaf {
    /// A triangle of a mesh.
    Triangle { corners: Buffer<Corners> },
    /// An instance's box in the world, and the axis-aligned one around it.
    Box { boxes: Buffer<Obb>, aabbs: Buffer<Aabb> },
}

impl Items {
    /// Triangles of meshes, a tree for each mesh.
    ///
    /// # Errors
    /// A device that lacks the memory.
    pub fn triangles<'m>(gpu: &Gpu, meshes: impl IntoIterator<Item = &'m [Corners]>) -> Result<Self, GpuError> {
        let mut all = vec![];
        let mut ranges = vec![];
        for corners in meshes {
            ranges.push(Range { first: count(all.len()), count: count(corners.len()) });
            all.extend_from_slice(corners);
        }
        let leaf = Leaf::Triangle { corners: gpu.buffer("corners", &all)? };
        Self::new(gpu, ranges, leaf)
    }

    /// Boxes of instances under one tree.
    ///
    /// # Errors
    /// A device that lacks the memory.
    pub fn boxes(gpu: &Gpu, boxes: &[Obb]) -> Result<Self, GpuError> {
        let ranges = vec![Range { first: 0, count: count(boxes.len()) }];
        let aabbs: Vec<Aabb> = boxes.iter().map(Obb::aabb).collect();
        let leaf = Leaf::Box { boxes: gpu.buffer("boxes", boxes)?, aabbs: gpu.buffer("boxes around boxes", &aabbs)? };
        Self::new(gpu, ranges, leaf)
    }

    fn new(gpu: &Gpu, ranges: Vec<Range>, leaf: Leaf) -> Result<Self, GpuError> {
        let n = ranges.iter().map(|range| range.count).sum();
        Ok(Self { device_ranges: gpu.buffer("ranges of trees", &ranges)?, n, ranges, leaf })
    }

    /// Number of items of all trees.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.n
    }

    /// Whether there is no item.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Each tree's items.
    #[must_use]
    pub fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    /// Bits that tell the trees apart.
    pub(super) fn tree_bits(&self) -> u32 {
        count(self.ranges.len()).max(1).next_power_of_two().ilog2()
    }

    /// The part of kernels that reads these items.
    pub(super) fn part(&self) -> Specialisation {
        let file = match self.leaf {
            Leaf::Triangle { .. } => "shared/item/triangles",
            Leaf::Box { .. } => "shared/item/boxes",
        };
        Specialisation::none().part("item", file)
    }

    /// `more`, and what that part and `shared/build/forest` bind.
    pub(super) fn bound<'a>(&'a self, more: &[NamedBinding<'a>]) -> Vec<NamedBinding<'a>> {
        let mut bound: Vec<NamedBinding<'a>> = vec![("ranges", &self.device_ranges)];
        match &self.leaf {
            Leaf::Triangle { corners } => bound.push(("corners", corners)),
            Leaf::Box { boxes, aabbs } => {
                let both: [NamedBinding<'a>; 2] = [("item_boxes", boxes), ("item_aabbs", aabbs)];
                bound.extend(both);
            }
        }
        bound.extend_from_slice(more);
        bound
    }
}
