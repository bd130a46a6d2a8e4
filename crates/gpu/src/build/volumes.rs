//! Volumes of the nodes: axis-aligned boxes, and oriented ones by each strategy.
//!
//! ```text
//! trees, leaves -> axis-aligned boxes
//!               -> nodes by height -> frame of each node by a rule over its children, or by the moments of everything below it
//!               -> boxes along each of a fixed set of frames, of which the best is kept
//! ```

use bytemuck::{Pod, Zeroable};
use canted_lbvh::Strategy;
use canted_obb::{Aabb, Frame, Obb, dop::frames};
use canted_shaders::{choice, wgsl};

use super::encoder::Dispatches;
use super::primitives::count;
use super::sort::Sorter;
use super::stages::Trees;
use super::{BuildEncoder, Primitives};
use crate::commands::Slot;
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

/// The volume of each inner node, by slot: the oriented box, or the axis-aligned one if that has no more area.
///
/// # Errors
/// As for [`aabbs`]; or an unsupported strategy.
pub async fn obbs(
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
        Strategy::PcaUnbounded => return unbounded(build, primitives, leaves, trees, aabbs).await,
        Strategy::Aabb => {
            let message = format!("volume strategy {strategy:?} is not supported on the GPU");
            return Err(GpuError::Invalid { message });
        }
    };
    let gpu = build.gpu();
    let schedule = Schedule::new(build, trees).await?;
    let obbs = gpu.zeroed("oriented boxes", primitives.len() as usize)?;
    let bound = primitives.bound(&[
        ("order", &schedule.order),
        ("nodes", &trees.nodes),
        ("leaves", leaves),
        ("aabbs", aabbs),
        ("obbs", &obbs),
    ]);
    build.stage("obb", |dispatches| {
        let kernel = gpu.kernel(wgsl::build::volumes::MERGE, &primitives.part().with(rule))?;
        schedule.dispatch(dispatches, &kernel, &bound)
    })?;
    Ok(obbs)
}

/// The box of each inner node, by slot, along the principal axes of the surface of everything below it; the axis-aligned box if
/// that has no more area.
///
/// Frames are computed one height at a time. Then each run of leaves measures itself in the frame of every node above it, so the
/// time is proportional to the sum of all subtree sizes, as on the CPU.
pub(super) async fn unbounded(
    build: &mut BuildEncoder<'_>,
    primitives: &Primitives,
    leaves: &Buffer<u32>,
    trees: &Trees,
    aabbs: &Buffer<Aabb>,
) -> Result<Buffer<Obb>, GpuError> {
    let gpu = build.gpu();
    let schedule = Schedule::new(build, trees).await?;
    let n = primitives.len();
    let obbs = gpu.zeroed("oriented boxes", n as usize)?;
    let moments = gpu.zeroed::<[f32; 10]>("moments", n as usize)?;
    let ends = gpu.zeroed::<[f32; 6]>("extents in the frames of nodes", n as usize)?;
    build.stage("obb", |dispatches| {
        let more: [NamedBinding<'_>; 5] = [
            ("order", &schedule.order),
            ("nodes", &trees.nodes),
            ("leaves", leaves),
            ("obbs", &obbs),
            ("node_moments", &moments),
        ];
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

/// Maximum height of a tree: bits of a code, bits of a position, and the leaf.
const HEIGHTS: usize = 128;

/// Bits of a height.
const HEIGHT_BITS: u32 = 7;

/// Bytes between slices of heights: uniforms start at multiples of it on every device.
const SLICE_BYTES: u64 = 256;

/// The nodes of all trees, in order of height.
pub(super) struct Schedule {
    /// Slots by height.
    pub(super) order: Buffer<u32>,
    levels: Levels,
}

/// Where each height starts and ends.
enum Levels {
    /// The range of `order` for each height, from the lowest.
    Known(Vec<[u32; 2]>),
    /// The same on the device: a slice for each height, and its work-groups.
    There { slices: Buffer<[u32; 64]>, groups: Buffer<[u32; 3]>, n_heights: u32 },
}

impl Schedule {
    /// Sorts the nodes by height. Where stages are not recorded, reads back where each height starts; otherwise there is a dispatch for
    /// every height that the codes allow, whose size the device computes.
    ///
    /// # Errors
    /// Out of memory, or device lost.
    pub(super) async fn new(build: &mut BuildEncoder<'_>, trees: &Trees) -> Result<Self, GpuError> {
        let gpu = build.gpu();
        let sorter = Sorter::new(gpu);
        let order = sorter.sort_as("levels", build, &[(&trees.heights, HEIGHT_BITS)])?;
        let ends = gpu.zeroed::<u32>("ends of levels", HEIGHTS)?;
        let bound: [NamedBinding<'_>; 3] = [("heights", &trees.heights), ("order", &order), ("ends", &ends)];
        build.stage("levels", |dispatches| {
            let kernel = gpu.kernel(wgsl::build::volumes::LEVELS, &Variant::none())?;
            dispatches.items(&kernel, &bound, count(order.len()))
        })?;
        let levels = if build.is_recorded() {
            Levels::there(build, trees, &ends)?
        } else {
            Levels::known(&gpu.read(&ends).await?)
        };
        Ok(Self { order, levels })
    }

    /// One dispatch for each height, from the lowest, each with an invocation for each node.
    pub(super) fn dispatch(
        &self,
        dispatches: &mut Dispatches<'_>,
        kernel: &Kernel,
        bound: &[NamedBinding<'_>],
    ) -> Result<(), GpuError> {
        match &self.levels {
            Levels::Known(levels) => levels.iter().try_for_each(|&level| dispatches.range(kernel, bound, level)),
            Levels::There { slices, groups, n_heights } => (1..=*n_heights).try_for_each(|height| {
                let slice = Slot { buffer: &slices.raw, first_byte: SLICE_BYTES * u64::from(height), n_bytes: 16 };
                let mut with_slice: Vec<NamedBinding<'_>> = vec![("slice", &slice)];
                with_slice.extend_from_slice(bound);
                dispatches.work.dispatch_indirect(kernel, &with_slice, groups, height)
            }),
        }
    }
}

impl Levels {
    fn known(ends: &[u32]) -> Self {
        // Empty slots have height 0. A height without nodes has no end.
        let mut first = ends[0];
        let mut levels = vec![];
        for &end in ends[1..].iter().filter(|&&end| end > 0) {
            levels.push([first, end]);
            first = end;
        }
        Self::Known(levels)
    }

    fn there(build: &mut BuildEncoder<'_>, trees: &Trees, ends: &Buffer<u32>) -> Result<Self, GpuError> {
        let gpu = build.gpu();
        let slices = gpu.uniforms::<[u32; 64]>("slices of levels", HEIGHTS)?;
        let groups = gpu.indirect::<[u32; 3]>("work-groups of levels", HEIGHTS)?;
        let bound: [NamedBinding<'_>; 3] = [("ends", ends), ("slices", &slices), ("groups", &groups)];
        build.stage("levels", |dispatches| {
            let kernel = gpu.kernel(wgsl::build::volumes::LEVEL_SLICES, &Variant::none())?;
            dispatches.items(&kernel, &bound, count(HEIGHTS))
        })?;
        Ok(Self::There { slices, groups, n_heights: trees.max_height.min(count(HEIGHTS) - 1) })
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
