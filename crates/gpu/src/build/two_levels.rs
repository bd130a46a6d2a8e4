//! One tree per mesh and a tree over the instances.

use canted_obb::{Aabb, Obb};
use canted_tlas::{Instance, InstanceError};

use super::{BuildConfig, Built, Items, Run, items::Leaf};
use crate::{Gpu, GpuError, wait::block_on};

/// A two-level hierarchy in device memory.
///
/// Only the root boxes of the meshes are read back. The CPU transforms them in `f64`, so the items of the top level equal the
/// CPU's bit for bit.
pub struct TwoLevels {
    /// One tree per mesh.
    pub bottom: Built,
    /// The tree over the instances.
    pub top: Built,
    /// The instance of each item of the top level. Instances of meshes without triangles are skipped.
    pub instances: Vec<u32>,
    roots: Vec<Option<Obb>>,
    config: BuildConfig,
}

impl TwoLevels {
    /// Builds the top level over `instances` of the meshes in `bottom`.
    ///
    /// # Errors
    /// An instance that refers to no mesh or moves; a transform that is not finite or overflows; out of memory, or device lost.
    pub fn new(
        run: &mut Run<'_>,
        bottom: Built,
        instances: &[Instance],
        config: BuildConfig,
    ) -> Result<Self, GpuError> {
        block_on(Self::new_async(run, bottom, instances, config))
    }

    /// [`TwoLevels::new`] for browsers.
    ///
    /// # Errors
    /// As for [`TwoLevels::new`].
    pub async fn new_async(
        run: &mut Run<'_>,
        bottom: Built,
        instances: &[Instance],
        config: BuildConfig,
    ) -> Result<Self, GpuError> {
        let roots = bottom.roots_async(run.gpu()).await?;
        let (top, instances) = top(run, &roots, instances, config).await?;
        Ok(Self { bottom, top, instances, roots, config })
    }

    /// Replaces the instances. Rebuilds only the top level.
    ///
    /// # Errors
    /// As for [`TwoLevels::new`]; the previous instances then remain.
    pub fn place(&mut self, run: &mut Run<'_>, instances: &[Instance]) -> Result<(), GpuError> {
        block_on(self.place_async(run, instances))
    }

    /// [`TwoLevels::place`] for browsers.
    ///
    /// # Errors
    /// As for [`TwoLevels::place`].
    pub async fn place_async(&mut self, run: &mut Run<'_>, instances: &[Instance]) -> Result<(), GpuError> {
        (self.top, self.instances) = top(run, &self.roots, instances, self.config).await?;
        Ok(())
    }
}

/// The tree over the boxes of instances, and the instance of each box.
async fn top(
    run: &mut Run<'_>,
    roots: &[Option<Obb>],
    instances: &[Instance],
    config: BuildConfig,
) -> Result<(Built, Vec<u32>), GpuError> {
    let (mut boxes, mut numbers) = (vec![], vec![]);
    for (number, instance) in (0u32..).zip(instances) {
        if let Some(placed) = placed(number, instance, roots)? {
            boxes.push(placed);
            numbers.push(number);
        }
    }
    let items = Items::boxes(run.gpu(), &boxes)?;
    Ok((Built::new_async(run, items, config).await?, numbers))
}

/// World-space box of an instance; `None` if its mesh has no triangles.
fn placed(number: u32, instance: &Instance, roots: &[Option<Obb>]) -> Result<Option<Obb>, GpuError> {
    let index = number as usize;
    if instance.world_from_object_close.is_some_and(|close| close != instance.world_from_object) {
        return Err(GpuError::Unsupported { what: format!("moving instance {index}") });
    }
    let root = match roots.get(instance.blas as usize) {
        None => Err(InstanceError::NoSuchBlas { instance: index, blas: instance.blas }),
        Some(_) if !instance.world_from_object.is_finite() => Err(InstanceError::NotFinite { instance: index }),
        Some(root) => Ok(root.map(|root| root.transformed(&instance.world_from_object))),
    };
    let in_range = root.and_then(|placed| match placed {
        Some(placed) if !placed.aabb().is_finite() => Err(InstanceError::OutOfRange { instance: index }),
        placed => Ok(placed),
    });
    in_range.map_err(|error| GpuError::Unsupported { what: error.to_string() })
}

impl Built {
    /// Root box of each tree, in its own space; `None` for an empty tree.
    ///
    /// # Errors
    /// The device is lost.
    pub fn roots(&self, gpu: &Gpu) -> Result<Vec<Option<Obb>>, GpuError> {
        block_on(self.roots_async(gpu))
    }

    /// [`Built::roots`] for browsers.
    ///
    /// # Errors
    /// As for [`Built::roots`].
    pub async fn roots_async(&self, gpu: &Gpu) -> Result<Vec<Option<Obb>>, GpuError> {
        let nodes = match &self.obbs {
            Some(obbs) => gpu.read_at(obbs, &self.firsts(|n| n > 1)).await?,
            None => gpu.read_at(&self.aabbs, &self.firsts(|n| n > 1)).await?.iter().map(Obb::from_aabb).collect(),
        };
        let single = self.firsts(|n| n == 1);
        let leaves = match &self.items.leaf {
            Leaf::Triangle { .. } => self.leaf_aabbs(gpu, &single).await?.iter().map(Obb::from_aabb).collect(),
            Leaf::Box { boxes, .. } => gpu.read_at(boxes, &single).await?,
        };
        Ok(self.of_roots(nodes, leaves))
    }

    /// Axis-aligned box of each tree, in its own space; empty for an empty tree.
    pub(crate) async fn root_aabbs(&self, gpu: &Gpu) -> Result<Vec<Aabb>, GpuError> {
        let nodes = gpu.read_at(&self.aabbs, &self.firsts(|n| n > 1)).await?;
        let leaves = self.leaf_aabbs(gpu, &self.firsts(|n| n == 1)).await?;
        Ok(self.of_roots(nodes, leaves).into_iter().map(|root| root.unwrap_or(Aabb::EMPTY)).collect())
    }

    async fn leaf_aabbs(&self, gpu: &Gpu, items: &[u32]) -> Result<Vec<Aabb>, GpuError> {
        match &self.items.leaf {
            Leaf::Triangle { corners } => {
                Ok(gpu.read_at(corners, items).await?.into_iter().map(Aabb::from_points).collect())
            }
            Leaf::Box { aabbs, .. } => gpu.read_at(aabbs, items).await,
        }
    }

    /// The first item of each tree with such a number of items. It is the slot of the root, too.
    fn firsts(&self, wanted: fn(u32) -> bool) -> Vec<u32> {
        self.items.ranges().iter().filter(|range| wanted(range.count)).map(|range| range.first).collect()
    }

    /// One value for each tree: from `nodes` for trees with several items, from `leaves` for trees with one.
    fn of_roots<T>(&self, nodes: Vec<T>, leaves: Vec<T>) -> Vec<Option<T>> {
        let (mut nodes, mut leaves) = (nodes.into_iter(), leaves.into_iter());
        let of_tree = |count: u32| match count {
            0 => None,
            1 => leaves.next(),
            _ => nodes.next(),
        };
        self.items.ranges().iter().map(|range| range.count).map(of_tree).collect()
    }
}

#[cfg(test)]
mod tests {
    use canted_obb::Affine;

    use super::*;

    fn scaled(by: f32, shift: f32) -> Affine {
        Affine { columns: [[by, 0.0, 0.0], [0.0, by, 0.0], [0.0, 0.0, by], [shift, 0.0, 0.0]] }
    }

    #[test]
    fn overflowing_boxes_are_rejected_with_the_instance() {
        let roots = [Some(Obb::from_aabb(&Aabb { min: [-1e10; 3], max: [1e10; 3] })), None];
        let refused = |number, map| placed(number, &Instance::new(0, map), &roots).unwrap_err().to_string();
        for (number, map) in [(3, scaled(1e30, 0.0)), (4, scaled(f32::MAX, f32::MAX))] {
            let error = refused(number, map);
            assert!(
                error.contains(&format!("the transformed bounds of instance {number} exceed the range of f32")),
                "{error}"
            );
        }
        assert!(refused(5, scaled(1.0, f32::NAN)).contains("instance 5 is not finite"));
        let inside = placed(0, &Instance::new(0, scaled(1e20, -1e30)), &roots).unwrap().unwrap();
        assert!(inside.aabb().is_finite());
        // A mesh without triangles has no box that could overflow.
        assert_eq!(placed(0, &Instance::new(1, scaled(1e30, 0.0)), &roots), Ok(None));
    }
}
