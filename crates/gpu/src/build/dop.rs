//! Boxes along the best of a fixed set of frames.

use bytemuck::{Pod, Zeroable};
use canted_obb::{Aabb, Frame, Obb, dop::frames};

use super::{Items, Run, Trees};
use crate::{Buffer, GpuError, NamedBinding, Specialisation};

/// As in `shared/build/dop.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct FixedFrame {
    /// Axes, each followed by a padding word.
    columns: [[f32; 4]; 3],
    skewness: f32,
    padding: [f32; 3],
}

impl FixedFrame {
    fn new(frame: &Frame) -> Self {
        let columns = frame.map(|[x, y, z]| [x, y, z, 0.0]);
        Self { columns, skewness: skewness(frame), padding: [0.0; 3] }
    }
}

/// Upper bound of the greatest row sum of `|FᵀF - 1|`. The error in `f64` is less than half a ULP of the result, which is
/// rounded up.
#[expect(clippy::cast_possible_truncation, reason = "rounded up by the next number")]
fn skewness(frame: &Frame) -> f32 {
    let dot = |a: usize, b: usize| (0..3).map(|k| f64::from(frame[a][k]) * f64::from(frame[b][k])).sum::<f64>();
    let row = |a: usize| (0..3).map(|b| (dot(a, b) - f64::from(u8::from(a == b))).abs()).sum::<f64>();
    ((row(0).max(row(1)).max(row(2)) as f32).next_up()).next_up()
}

/// The box of each inner node, by slot, along the frame of [`canted_obb::dop::frames`] with the least area; the axis-aligned
/// box if no other has less.
///
/// Frames are tried one at a time. Extents along all directions at once would take 200 bytes per node. Here six numbers
/// propagate from the leaves, then each node keeps its box or takes the new one.
pub(super) fn dop(
    run: &mut Run<'_>,
    items: &Items,
    leaves: &Buffer<u32>,
    trees: &Trees,
    aabbs: &Buffer<Aabb>,
) -> Result<Buffer<Obb>, GpuError> {
    let gpu = run.gpu();
    let n = items.len();
    let obbs = gpu.zeroed("oriented boxes", n as usize)?;
    let ends = gpu.zeroed::<[f32; 6]>("extents along a frame", n as usize)?;
    run.stage("obb", |dispatches| {
        let axis_aligned = gpu.kernel("build/axis_aligned", &Specialisation::none())?;
        dispatches.items(&axis_aligned, &[("aabbs", aabbs), ("obbs", &obbs)], n)?;
        let extents = gpu.kernel("build/dop_extents", &items.part())?;
        let boxes = gpu.kernel("build/dop_boxes", &items.part())?;
        // The first frame is the identity.
        for frame in &frames()[1..] {
            let fixed = gpu.uniform("frame", &FixedFrame::new(frame))?;
            let more: [NamedBinding<'_>; 7] = [
                ("fixed_frame", &fixed),
                ("parents", &trees.parents),
                ("nodes", &trees.nodes),
                ("leaves", leaves),
                ("ends", &ends),
                ("aabbs", aabbs),
                ("obbs", &obbs),
            ];
            let bound = items.bound(&more);
            dispatches.work.clear(&ends);
            dispatches.items(&extents, &bound, n)?;
            dispatches.items(&boxes, &bound, n)?;
        }
        Ok(())
    })?;
    Ok(obbs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_frames_are_orthonormal_up_to_rounding() {
        for frame in frames() {
            assert!(skewness(frame) <= 4.0 * f32::EPSILON, "{frame:?}");
        }
        let skewed = [[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(skewness(&skewed) >= 0.75);
    }
}
