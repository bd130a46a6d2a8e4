//! Lists of rays in device memory, such as those that kernels of `shared/certain` leave to exact ones.

use wgpu::BindingResource;

use crate::commands::AsBinding;
use crate::{Buffer, Commands, Gpu, GpuError, Kernel, NamedBinding};

/// Words before the list: the work-groups of an indirect dispatch, and the number of the listed ones.
const HEAD: usize = 4;

/// Rays of a dispatch with work-groups of 64 in one row.
const MOST: usize = 65_535 * 64;

/// A list of indices that kernels write, in the layout of `shared/undecided`, and that sizes a dispatch.
pub struct RayList {
    words: Buffer<u32>,
}

impl RayList {
    /// An empty list with room for `n`.
    ///
    /// # Errors
    /// More than the work-groups of a dispatch take, 4,194,240, or another limit of the device.
    pub fn new(gpu: &Gpu, n: usize) -> Result<Self, GpuError> {
        check_len(n)?;
        Ok(Self { words: gpu.indirect("list of rays", HEAD + n)? })
    }

    /// A list with room for `n` in [memory that serves again](Gpu::work_buffer), to be [cleared](Self::clear) before its first use.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn uncleared(gpu: &Gpu, n: usize) -> Result<Self, GpuError> {
        check_len(n)?;
        Ok(Self { words: gpu.work_buffer("list of rays", HEAD + n)? })
    }

    /// How many rays it has room for.
    pub(super) fn capacity(&self) -> usize {
        self.words.len() - HEAD
    }

    /// Empties the list before what is recorded next.
    pub fn clear(&self, commands: &mut Commands<'_>) {
        commands.clear_range(&self.words, 0, HEAD as u32);
    }

    /// Adds a dispatch with an invocation of a work-group of 64 for each entry.
    ///
    /// # Errors
    /// A variable is missing.
    pub fn dispatch(
        &self,
        commands: &mut Commands<'_>,
        kernel: &Kernel,
        bound: &[NamedBinding<'_>],
    ) -> Result<(), GpuError> {
        commands.dispatch_indirect(kernel, bound, &self.words, 0)
    }

    /// Copies how many are listed to a word of a buffer.
    pub fn copy_count(&self, commands: &mut Commands<'_>, to: &Buffer<u32>, at: u32) {
        commands.copy_range((&self.words, HEAD as u32 - 1), (to, at), 1);
    }

    /// How many are listed.
    ///
    /// # Errors
    /// The device is lost or does not finish.
    pub async fn count(&self, gpu: &Gpu) -> Result<u32, GpuError> {
        Ok(gpu.read_first(&self.words, HEAD).await?[HEAD - 1])
    }

    /// The indices of the first `n`, in no particular order.
    ///
    /// # Errors
    /// As for [`Self::count`].
    pub async fn listed(&self, gpu: &Gpu, n: u32) -> Result<Vec<u32>, GpuError> {
        Ok(gpu.read_first(&self.words, HEAD + n as usize).await?.split_off(HEAD))
    }
}

fn check_len(n: usize) -> Result<(), GpuError> {
    if n > MOST {
        let what = format!("a list of {n} rays");
        let (limit, remedy) = ("rays in a dispatch", "trace them in parts");
        return Err(GpuError::Limit { what, need: n as u64, limit, most: MOST as u64, remedy });
    }
    Ok(())
}

impl AsBinding for RayList {
    fn resource(&self) -> BindingResource<'_> {
        self.words.resource()
    }

    fn n_bytes(&self) -> u64 {
        self.words.n_bytes()
    }
}
