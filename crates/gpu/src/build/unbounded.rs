//! Volumes: boxes along the principal axes of everything below a node.

use canted_obb::{Aabb, Obb};

use super::schedule::Schedule;
use super::{Items, Run, Trees};
use crate::{Buffer, GpuError, NamedBinding};

/// The box of each inner node, by slot, along the principal axes of the surface of everything below it; the axis-aligned box if
/// that has no more area.
///
/// Frames are computed one height at a time. Then each run of leaves measures itself in the frame of every node above it, so the
/// time is proportional to the sum of all subtree sizes, as on the CPU.
pub(super) fn unbounded(
    run: &mut Run<'_>,
    items: &Items,
    leaves: &Buffer<u32>,
    trees: &Trees,
    aabbs: &Buffer<Aabb>,
) -> Result<Buffer<Obb>, GpuError> {
    let gpu = run.gpu();
    let schedule = Schedule::new(run, trees)?;
    let n = items.len();
    let obbs = gpu.zeroed("oriented boxes", n as usize)?;
    let moments = gpu.zeroed::<[f32; 10]>("moments", n as usize)?;
    let ends = gpu.zeroed::<[f32; 6]>("extents in the frames of nodes", n as usize)?;
    run.stage("obb", |dispatches| {
        let more: [NamedBinding<'_>; 5] = [
            ("order", &schedule.order),
            ("nodes", &trees.nodes),
            ("leaves", leaves),
            ("obbs", &obbs),
            ("node_moments", &moments),
        ];
        let bound = items.bound(&more);
        let kernel = gpu.kernel("build/moments", &items.part())?;
        schedule.dispatch(dispatches, &kernel, &bound)?;
        let more: [NamedBinding<'_>; 5] = [
            ("parents", &trees.parents),
            ("nodes", &trees.nodes),
            ("leaves", leaves),
            ("ends", &ends),
            ("frames", &obbs),
        ];
        let kernel = gpu.kernel("build/point_extents", &items.part())?;
        dispatches.items(&kernel, &items.bound(&more), n)?;
        let more: [NamedBinding<'_>; 5] =
            [("nodes", &trees.nodes), ("leaves", leaves), ("ends", &ends), ("aabbs", aabbs), ("obbs", &obbs)];
        let kernel = gpu.kernel("build/point_boxes", &items.part())?;
        dispatches.items(&kernel, &items.bound(&more), n)
    })?;
    Ok(obbs)
}
