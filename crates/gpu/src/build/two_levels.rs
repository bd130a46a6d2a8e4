//! Trees of meshes, and one over the instances that place them.

use canted_obb::{Aabb, Obb};
use canted_tlas::{Instance, InstanceError};

use super::{BuildConfig, Built, Items, Run, items::Leaf};
use crate::{Gpu, GpuError};

/// Two levels of trees in the device's memory.
///
/// What stands between them is small, a box a mesh, and comes back: an instance's box is placed in `f64` on the CPU, exactly as
/// there, so the top level's items are the CPU's bit for bit.
pub struct TwoLevels {
    /// A tree a mesh.
    pub bottom: Built,
    /// The tree over the instances.
    pub top: Built,
    /// The instance of each item of the top level: one of a mesh without triangles is none.
    pub instances: Vec<u32>,
    roots: Vec<Option<Obb>>,
    config: BuildConfig,
}

impl TwoLevels {
    /// Places `instances` of the meshes under `bottom`, which a tree of `config` is built over.
    ///
    /// # Errors
    /// An instance of no mesh, one that moves while the shutter is open, or a transform that is not finite or carries its box out of
    /// the numbers; a device that lacks the memory, or is lost.
    pub fn new(
        run: &mut Run<'_>,
        bottom: Built,
        instances: &[Instance],
        config: BuildConfig,
    ) -> Result<Self, GpuError> {
        let roots = bottom.roots(run.gpu())?;
        let (top, instances) = top(run, &roots, instances, config)?;
        Ok(Self { bottom, top, instances, roots, config })
    }

    /// Places other instances of the same meshes: builds the top level and nothing else.
    ///
    /// # Errors
    /// As [`TwoLevels::new`]; the old instances then stay.
    pub fn place(&mut self, run: &mut Run<'_>, instances: &[Instance]) -> Result<(), GpuError> {
        (self.top, self.instances) = top(run, &self.roots, instances, self.config)?;
        Ok(())
    }
}

/// The tree over the boxes of instances, and the instance of each.
fn top(
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
    Ok((Built::new(run, items, config)?, numbers))
}

/// The box of an instance in the world; `None` where its mesh has no triangle.
fn placed(number: u32, instance: &Instance, roots: &[Option<Obb>]) -> Result<Option<Obb>, GpuError> {
    let index = number as usize;
    if instance.world_from_object_close.is_some_and(|close| close != instance.world_from_object) {
        return Err(GpuError::Unsupported { what: format!("instance {index}, which moves") });
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
    in_range.map_err(|error| GpuError::Unsupported { what: format!("instances as they stand: {error}") })
}

impl Built {
    /// The box around all items of each tree, in their space; `None` for a tree without any.
    ///
    /// # Errors
    /// A device that is lost.
    pub fn roots(&self, gpu: &Gpu) -> Result<Vec<Option<Obb>>, GpuError> {
        let of_count = |wanted: fn(u32) -> bool| -> Vec<u32> {
            self.items.ranges().iter().filter(|range| wanted(range.count)).map(|range| range.first).collect()
        };
        let nodes = match &self.obbs {
            Some(obbs) => gpu.read_at(obbs, &of_count(|n| n > 1))?,
            None => gpu.read_at(&self.aabbs, &of_count(|n| n > 1))?.iter().map(Obb::from_aabb).collect(),
        };
        let single = of_count(|n| n == 1);
        let leaves: Vec<Obb> = match &self.items.leaf {
            Leaf::Triangle { corners } => {
                gpu.read_at(corners, &single)?.into_iter().map(|c| Obb::from_aabb(&Aabb::from_points(c))).collect()
            }
            Leaf::Box { boxes, .. } => gpu.read_at(boxes, &single)?,
        };
        let (mut nodes, mut leaves) = (nodes.into_iter(), leaves.into_iter());
        let of_tree = |count: u32| match count {
            0 => None,
            1 => leaves.next(),
            _ => nodes.next(),
        };
        Ok(self.items.ranges().iter().map(|range| range.count).map(of_tree).collect())
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
    fn boxes_out_of_the_numbers_are_refused_by_instance() {
        let roots = [Some(Obb::from_aabb(&Aabb { min: [-1e10; 3], max: [1e10; 3] })), None];
        let refused = |number, map| placed(number, &Instance::still(0, map), &roots).unwrap_err().to_string();
        for (number, map) in [(3, scaled(1e30, 0.0)), (4, scaled(f32::MAX, f32::MAX))] {
            let error = refused(number, map);
            assert!(error.contains(&format!("instance {number} carries its box beyond what f32 can hold")), "{error}");
        }
        assert!(refused(5, scaled(1.0, f32::NAN)).contains("instance 5 is not finite"));
        let inside = placed(0, &Instance::still(0, scaled(1e20, -1e30)), &roots).unwrap().unwrap();
        assert!(inside.aabb().is_finite());
        // What has no triangle has no box that could be too large.
        assert_eq!(placed(0, &Instance::still(1, scaled(1e30, 0.0)), &roots), Ok(None));
    }
}
