//! Volumes of the nodes.

use canted_lbvh::Strategy;
use canted_obb::{Aabb, Obb};

use super::{Items, Run, Sorter, Trees, count, dop::dop, unbounded::unbounded};
use crate::{Buffer, GpuError, NamedBinding, Specialisation};

/// Maximum height of a tree: bits of a code, bits of a position, and the leaf.
const HEIGHTS: usize = 128;

/// Bits of a height.
const HEIGHT_BITS: u32 = 7;

/// The axis-aligned box of each inner node, by slot.
///
/// # Errors
/// Out of memory, or device lost.
pub fn aabbs(run: &mut Run<'_>, items: &Items, leaves: &Buffer<u32>, trees: &Trees) -> Result<Buffer<Aabb>, GpuError> {
    let gpu = run.gpu();
    let aabbs = gpu.zeroed("axis-aligned boxes", items.len() as usize)?;
    let bound = items.bound(&[("parents", &trees.parents), ("leaves", leaves), ("ends", &aabbs)]);
    run.stage("aabb", |dispatches| {
        let kernel = gpu.kernel("build/aabbs", &items.part())?;
        dispatches.items(&kernel, &bound, items.len())
    })?;
    Ok(aabbs)
}

/// The nodes of all trees, in order of height.
pub(super) struct Schedule {
    /// Slots by height.
    order: Buffer<u32>,
    /// The range of `order` for each height, from the lowest.
    levels: Vec<[u32; 2]>,
}

impl Schedule {
    /// Slots by height.
    pub(super) fn order(&self) -> &Buffer<u32> {
        &self.order
    }

    /// The range of slots of each height.
    pub(super) fn levels(&self) -> &[[u32; 2]] {
        &self.levels
    }

    /// Sorts the nodes by height and reads back where each height starts.
    ///
    /// # Errors
    /// As for [`aabbs`].
    pub(super) fn new(run: &mut Run<'_>, trees: &Trees) -> Result<Self, GpuError> {
        let gpu = run.gpu();
        if run.is_recorded() {
            let what =
                "a recorded build of oriented boxes other than those of dop, which reads the height of the tree back";
            return Err(GpuError::Unsupported { what: what.to_owned() });
        }
        let sorter = Sorter::new(gpu)?;
        let order = sorter.sort_as("levels", run, &[(&trees.heights, HEIGHT_BITS)])?;
        let ends = gpu.zeroed::<u32>("ends of levels", HEIGHTS)?;
        let bound: [NamedBinding<'_>; 3] = [("heights", &trees.heights), ("order", &order), ("ends", &ends)];
        run.stage("levels", |dispatches| {
            let kernel = gpu.kernel("build/levels", &Specialisation::none())?;
            dispatches.items(&kernel, &bound, count(order.len()))
        })?;
        let ends = gpu.read(&ends)?;
        // Empty slots have height 0. A height without nodes has no end.
        let mut first = ends[0];
        let mut levels = vec![];
        for &end in ends[1..].iter().filter(|&&end| end > 0) {
            levels.push([first, end]);
            first = end;
        }
        Ok(Self { order, levels })
    }
}

/// The volume of each inner node, by slot: the oriented box, or the axis-aligned one if that has no more area.
///
/// # Errors
/// As for [`aabbs`]; or an unsupported strategy.
pub fn obbs(
    run: &mut Run<'_>,
    items: &Items,
    leaves: &Buffer<u32>,
    trees: &Trees,
    aabbs: &Buffer<Aabb>,
    strategy: Strategy,
) -> Result<Buffer<Obb>, GpuError> {
    let rule = match strategy {
        Strategy::PcaBounded => "shared/rule/pca_bounded",
        Strategy::Quaternion => "shared/rule/quaternion",
        Strategy::Combined => "shared/rule/combined",
        Strategy::Dop => return dop(run, items, leaves, trees, aabbs),
        Strategy::PcaUnbounded => return unbounded(run, items, leaves, trees, aabbs),
        Strategy::Aabb => {
            let message = format!("volume strategy {strategy:?} is not supported on the GPU");
            return Err(GpuError::Invalid { message });
        }
    };
    let gpu = run.gpu();
    let schedule = Schedule::new(run, trees)?;
    let obbs = gpu.zeroed("oriented boxes", items.len() as usize)?;
    let bound = items.bound(&[
        ("order", &schedule.order),
        ("nodes", &trees.nodes),
        ("leaves", leaves),
        ("aabbs", aabbs),
        ("obbs", &obbs),
    ]);
    run.stage("obb", |dispatches| {
        let kernel = gpu.kernel("build/merge", &items.part().part("rule", rule))?;
        schedule.levels.iter().try_for_each(|&level| dispatches.range(&kernel, &bound, level))
    })?;
    Ok(obbs)
}
