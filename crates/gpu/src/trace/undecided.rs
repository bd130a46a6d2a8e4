//! The list of rays that kernels of `shared/certain` leave to exact ones.

use crate::commands::AsBinding;
use crate::{Buffer, Commands, Gpu, GpuError, Kernel, NamedBinding};

/// Words before the list: the work-groups of an indirect dispatch, and the number of the listed ones.
const HEAD: usize = 4;

/// The list, in the layout of `shared/undecided`.
pub struct Undecided {
    words: Buffer<u32>,
}

impl Undecided {
    /// An empty list with room for `n`.
    ///
    /// # Errors
    /// A limit of the device.
    pub(super) fn new(gpu: &Gpu, n: usize) -> Result<Self, GpuError> {
        Ok(Self { words: gpu.indirect("undecided", HEAD + n)? })
    }

    /// The bindings of kernels that write the list, and of those that read it.
    pub(super) fn bindings(&self) -> [NamedBinding<'_>; 2] {
        ["undecided", "listed"].map(|name| (name, &self.words as &dyn AsBinding))
    }

    /// Adds a dispatch with an invocation for each entry.
    pub(super) fn dispatch(
        &self,
        commands: &mut Commands<'_>,
        kernel: &Kernel,
        bound: &[NamedBinding<'_>],
    ) -> Result<(), GpuError> {
        commands.dispatch_indirect(kernel, bound, &self.words, 0)
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
