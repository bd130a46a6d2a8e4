//! The nodes of all trees, one height after another.

use super::run::Dispatches;
use super::{Run, Sorter, Trees, count};
use crate::commands::Slot;
use crate::{Buffer, GpuError, Kernel, NamedBinding, Specialisation};

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
    pub(super) fn new(run: &mut Run<'_>, trees: &Trees) -> Result<Self, GpuError> {
        let gpu = run.gpu();
        let sorter = Sorter::new(gpu)?;
        let order = sorter.sort_as("levels", run, &[(&trees.heights, HEIGHT_BITS)])?;
        let ends = gpu.zeroed::<u32>("ends of levels", HEIGHTS)?;
        let bound: [NamedBinding<'_>; 3] = [("heights", &trees.heights), ("order", &order), ("ends", &ends)];
        run.stage("levels", |dispatches| {
            let kernel = gpu.kernel("build/levels", &Specialisation::none())?;
            dispatches.items(&kernel, &bound, count(order.len()))
        })?;
        let levels =
            if run.is_recorded() { Levels::there(run, trees, &ends)? } else { Levels::known(&gpu.read(&ends)?) };
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

    fn there(run: &mut Run<'_>, trees: &Trees, ends: &Buffer<u32>) -> Result<Self, GpuError> {
        let gpu = run.gpu();
        let slices = gpu.uniforms::<[u32; 64]>("slices of levels", HEIGHTS)?;
        let groups = gpu.indirect::<[u32; 3]>("work-groups of levels", HEIGHTS)?;
        let bound: [NamedBinding<'_>; 3] = [("ends", ends), ("slices", &slices), ("groups", &groups)];
        run.stage("levels", |dispatches| {
            let kernel = gpu.kernel("build/level_slices", &Specialisation::none())?;
            dispatches.items(&kernel, &bound, count(HEIGHTS))
        })?;
        Ok(Self::There { slices, groups, n_heights: trees.max_height.min(count(HEIGHTS) - 1) })
    }
}
