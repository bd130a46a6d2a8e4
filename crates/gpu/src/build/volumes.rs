//! Volumes of the nodes: axis-aligned boxes, and oriented ones by each strategy.
//!
//! ```text
//! trees, leaves -> axis-aligned boxes
//!               -> small subtrees -> frame of each node by a rule over its children, or by the moments of everything below it
//!               -> boxes along each of a fixed set of frames, of which the best is kept
//! ```

use bytemuck::{Pod, Zeroable};
use canted_lbvh::Strategy;
use canted_obb::{Aabb, Frame, Obb, dop::frames};
use canted_shaders::{choice, wgsl};

use super::encoder::{Dispatches, Slice};
use super::stages::Trees;
use super::{BuildEncoder, Primitives};
use crate::{Buffer, GpuError, Kernel, NamedBinding, Variant};

/// The axis-aligned box of each inner node, by slot.
///
/// # Errors
/// Out of memory, or device lost.
pub fn aabbs(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    leaves: &Buffer<u32>,
    trees: &Trees,
) -> Result<Buffer<Aabb>, GpuError> {
    let gpu = build.gpu();
    let aabbs = gpu.zeroed("axis-aligned boxes", primitives.len() as usize)?;
    let bound = primitives.bound(&[("parents", &trees.parents), ("leaves", leaves), ("ends", &aabbs)]);
    build.stage("aabb", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::volumes::AABBS, &primitives.part())?;
        dispatches.items(&kernel, &bound, primitives.len())
    })?;
    Ok(aabbs)
}

/// The same, and the heights of the nodes and the depth of the trees, which are filled in.
pub(super) fn aabbs_and_depths(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    leaves: &Buffer<u32>,
    trees: &Trees,
) -> Result<Buffer<Aabb>, GpuError> {
    let gpu = build.gpu();
    let aabbs = gpu.zeroed("axis-aligned boxes", primitives.len() as usize)?;
    let bound = primitives.bound(&[
        ("parents", &trees.parents),
        ("leaves", leaves),
        ("ends", &aabbs),
        ("heights", &trees.heights),
        ("depth", &trees.depth),
    ]);
    build.stage("aabb", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::volumes::AABBS_AND_HEIGHTS, &primitives.part())?;
        dispatches.items(&kernel, &bound, primitives.len())
    })?;
    Ok(aabbs)
}

/// The volume of each inner node, by slot: the oriented box, or the axis-aligned one if that has no more area.
///
/// # Errors
/// As for [`aabbs`]; or an unsupported strategy.
pub fn obbs(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    leaves: &Buffer<u32>,
    trees: &Trees,
    aabbs: &Buffer<Aabb>,
    strategy: Strategy,
) -> Result<Buffer<Obb>, GpuError> {
    let rule = match strategy {
        Strategy::PcaBounded => choice::Rule::PcaBounded,
        Strategy::Quaternion => choice::Rule::Quaternion,
        Strategy::Combined => choice::Rule::Combined,
        Strategy::Dop => return dop(build, primitives, leaves, trees, aabbs),
        Strategy::PcaUnbounded => return unbounded(build, primitives, leaves, trees, aabbs),
        Strategy::Aabb => {
            let message = format!("volume strategy {strategy:?} is not supported on the GPU");
            return Err(GpuError::Invalid { message });
        }
    };
    let gpu = build.gpu();
    let schedule = Schedule::new(build, primitives, trees)?;
    let obbs = gpu.zeroed("oriented boxes", primitives.len() as usize)?;
    let bound = primitives.bound(&[("nodes", &trees.nodes), ("leaves", leaves), ("aabbs", aabbs), ("obbs", &obbs)]);
    build.stage("obb", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::volumes::MERGE, &primitives.part().with(rule))?;
        schedule.dispatch(dispatches, &kernel, &bound)
    })?;
    Ok(obbs)
}

/// The box of each inner node, by slot, along the principal axes of the surface of everything below it; the axis-aligned box if
/// that has no more area.
///
/// Frames are computed from the leaves up, subtree by subtree. Then each run of leaves measures itself in the frame of every node above it, so the
/// time is proportional to the sum of all subtree sizes, as on the CPU.
pub(super) fn unbounded(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    leaves: &Buffer<u32>,
    trees: &Trees,
    aabbs: &Buffer<Aabb>,
) -> Result<Buffer<Obb>, GpuError> {
    let gpu = build.gpu();
    let schedule = Schedule::new(build, primitives, trees)?;
    let n = primitives.len();
    let obbs = gpu.zeroed("oriented boxes", n as usize)?;
    let moments = gpu.zeroed::<[f32; 10]>("moments", n as usize)?;
    let ends = gpu.zeroed::<[f32; 6]>("extents in the frames of nodes", n as usize)?;
    build.stage("obb", |dispatches| {
        let more: [NamedBinding<'_>; 4] =
            [("nodes", &trees.nodes), ("leaves", leaves), ("obbs", &obbs), ("node_moments", &moments)];
        let bound = primitives.bound(&more);
        let kernel = gpu.kernel(wgsl::build::volumes::MOMENTS, &primitives.part())?;
        schedule.dispatch(dispatches, &kernel, &bound)?;
        let more: [NamedBinding<'_>; 5] = [
            ("parents", &trees.parents),
            ("nodes", &trees.nodes),
            ("leaves", leaves),
            ("ends", &ends),
            ("frames", &obbs),
        ];
        let kernel = gpu.kernel(wgsl::build::volumes::POINT_EXTENTS, &primitives.part())?;
        dispatches.items(&kernel, &primitives.bound(&more), n)?;
        let more: [NamedBinding<'_>; 5] =
            [("nodes", &trees.nodes), ("leaves", leaves), ("ends", &ends), ("aabbs", aabbs), ("obbs", &obbs)];
        let kernel = gpu.kernel(wgsl::build::volumes::POINT_BOXES, &primitives.part())?;
        dispatches.items(&kernel, &primitives.bound(&more), n)
    })?;
    Ok(obbs)
}

/// As in `shared/volumes.wgsl`.
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
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    leaves: &Buffer<u32>,
    trees: &Trees,
    aabbs: &Buffer<Aabb>,
) -> Result<Buffer<Obb>, GpuError> {
    let gpu = build.gpu();
    let n = primitives.len();
    let obbs = gpu.zeroed("oriented boxes", n as usize)?;
    let ends = gpu.zeroed::<[f32; 6]>("extents along a frame", n as usize)?;
    build.stage("obb", |dispatches| {
        let axis_aligned = gpu.kernel(wgsl::build::volumes::AXIS_ALIGNED, &Variant::none())?;
        dispatches.items(&axis_aligned, &[("aabbs", aabbs), ("obbs", &obbs)], n)?;
        let extents = gpu.kernel(wgsl::build::volumes::DOP_EXTENTS, &primitives.part())?;
        let boxes = gpu.kernel(wgsl::build::volumes::DOP_BOXES, &primitives.part())?;
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
            let bound = primitives.bound(&more);
            dispatches.work.clear(&ends);
            dispatches.items(&extents, &bound, n)?;
            dispatches.items(&boxes, &bound, n)?;
        }
        Ok(())
    })?;
    Ok(obbs)
}

/// `TREELET` of `build/volumes/schedule`: most leaves of a subtree that a work-group walks.
const TREELET: u32 = 512;

/// Words before the lists of a schedule, as there.
const HEAD: usize = 8;

/// `Walk` of `build/volumes/walk`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Walk {
    is_large: u32,
}

/// The nodes of all trees, so that each comes after its children: small subtrees, and the nodes above them.
pub(super) struct Schedule {
    schedule: Buffer<u32>,
    order: Buffer<u32>,
    slice: Buffer<Slice>,
    /// Whether trees have nodes above small subtrees.
    has_large: bool,
}

impl Schedule {
    /// Finds the small subtrees and the nodes above them.
    ///
    /// # Errors
    /// Out of memory, or device lost.
    pub(super) fn new(build: &mut BuildEncoder<'_>, primitives: &Primitives, trees: &Trees) -> Result<Self, GpuError> {
        let gpu = build.gpu();
        let n = primitives.len() as usize;
        let schedule = gpu.indirect("small subtrees and nodes above", HEAD + 2 * n)?;
        gpu.write(&schedule, &[0, 0, 1]);
        let bound: [NamedBinding<'_>; 4] = [
            ("nodes", &trees.nodes),
            ("parents", &trees.parents),
            ("heights", &trees.heights),
            ("schedule", &schedule),
        ];
        build.stage("levels", |dispatches| {
            let kernel = gpu.kernel(wgsl::build::volumes::TREELETS, &Variant::none())?;
            dispatches.items(&kernel, &bound, primitives.len())
        })?;
        Ok(Self {
            schedule,
            order: gpu.zeroed("nodes by height", 2 * n)?,
            slice: gpu.uniform("slice", &Slice::ALL)?,
            has_large: primitives.ranges().iter().any(|range| range.count > TREELET),
        })
    }

    /// Runs a kernel of `build/volumes/walk` over all nodes.
    pub(super) fn dispatch(
        &self,
        dispatches: &mut Dispatches<'_>,
        kernel: &Kernel,
        bound: &[NamedBinding<'_>],
    ) -> Result<(), GpuError> {
        for is_large in [false, true] {
            let walk = dispatches.gpu.uniform("walk", &Walk { is_large: is_large.into() })?;
            let mut with_walk: Vec<NamedBinding<'_>> =
                vec![("slice", &self.slice), ("walk", &walk), ("schedule", &self.schedule), ("order", &self.order)];
            with_walk.extend_from_slice(bound);
            match is_large {
                false => dispatches.work.dispatch_indirect(kernel, &with_walk, &self.schedule, 0)?,
                true if self.has_large => dispatches.work.dispatch(kernel, &with_walk, [1, 1, 1])?,
                true => {}
            }
        }
        Ok(())
    }
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
