//! Volumes of the nodes.

use canted_lbvh::Strategy;
use canted_obb::{Aabb, Obb};

use super::{Items, Run, Trees, dop::dop, schedule::Schedule, unbounded::unbounded};
use crate::{Buffer, GpuError};

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
        schedule.dispatch(dispatches, &kernel, &bound)
    })?;
    Ok(obbs)
}
