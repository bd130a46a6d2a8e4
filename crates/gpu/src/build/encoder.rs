//! Stages as sequences of short dispatches, optionally timed.

use bytemuck::{Pod, Zeroable};

use crate::wait::Instant;
use crate::{AdapterKind, Buffer, Commands, Gpu, GpuError, Kernel, NamedBinding};

/// Maximum number of invocations per submission and per dispatch whose size the host knows: about 100 ms on a software driver, less on
/// hardware. Dispatches whose sizes only the device knows are not divided.
const SOFTWARE_INVOCATIONS: u32 = 1 << 18;
const INVOCATIONS: u32 = 1 << 22;

/// Cost of a stage on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTime {
    /// The stage, named as on the CPU.
    pub stage: &'static str,
    /// Milliseconds from its first dispatch to its last, by device timestamps. Wall-clock time including submission and wait if
    /// [`Gpu::has_timestamps`] is false.
    pub milliseconds: f64,
    /// Number of work-groups, which does not depend on the load of the machine; without those of dispatches whose sizes only the device
    /// knows.
    pub n_groups: u64,
}

/// A sequence of stages.
pub struct BuildEncoder<'a> {
    gpu: &'a Gpu,
    /// A program's encoder, which records the stages.
    encoder: Option<&'a mut wgpu::CommandEncoder>,
    timed: bool,
    times: Vec<StageTime>,
}

impl<'a> BuildEncoder<'a> {
    /// Submits stages without waiting.
    #[must_use]
    pub fn new(gpu: &'a Gpu) -> Self {
        Self { gpu, encoder: None, timed: false, times: vec![] }
    }

    /// Waits for each stage and times it; not in browsers.
    #[must_use]
    pub fn timed(gpu: &'a Gpu) -> Self {
        Self { gpu, encoder: None, timed: true, times: vec![] }
    }

    /// Records stages into `encoder`, which the program submits.
    #[must_use]
    pub fn recorded(gpu: &'a Gpu, encoder: &'a mut wgpu::CommandEncoder) -> Self {
        Self { gpu, encoder: Some(encoder), timed: false, times: vec![] }
    }

    /// The device.
    #[must_use]
    pub fn gpu(&self) -> &'a Gpu {
        self.gpu
    }

    /// The measured times, in the order of each stage's first dispatch.
    #[must_use]
    pub fn times(&self) -> &[StageTime] {
        &self.times
    }

    /// Runs what `record` adds as part of `stage`.
    pub(crate) fn stage(
        &mut self,
        stage: &'static str,
        record: impl FnOnce(&mut Dispatches<'_>) -> Result<(), GpuError>,
    ) -> Result<(), GpuError> {
        let work = match &mut self.encoder {
            Some(encoder) => self.gpu.record(encoder),
            None if self.timed => self.gpu.timed_commands(),
            None => self.gpu.commands(),
        };
        let mut dispatches = Dispatches { gpu: self.gpu, work, n_waiting: 0 };
        let start = Instant::now();
        record(&mut dispatches)?;
        if !self.timed {
            return dispatches.work.submit();
        }
        let n_groups = dispatches.work.n_groups();
        let on_device = dispatches.work.span()?;
        let on_wall = start.elapsed().as_secs_f64() * 1e3;
        let milliseconds = if self.gpu.has_timestamps() { on_device } else { on_wall };
        match self.times.iter_mut().find(|time| time.stage == stage) {
            Some(time) => {
                time.milliseconds += milliseconds;
                time.n_groups += n_groups;
            }
            None => self.times.push(StageTime { stage, milliseconds, n_groups }),
        }
        Ok(())
    }
}

/// The dispatches of one stage.
pub(crate) struct Dispatches<'a> {
    pub(super) gpu: &'a Gpu,
    pub(crate) work: Commands<'a>,
    /// Invocations not yet submitted.
    n_waiting: u32,
}

/// As in `shared/build.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Slice {
    pub(super) first: u32,
    pub(super) end: u32,
    pub(super) zero: u32,
}

impl Slice {
    /// All items, where kernels find on the device how many there are.
    pub(super) const ALL: Self = Self { first: 0, end: u32::MAX, zero: 0 };
}

/// `PassSize` of `shared/build/pass`: the work-groups of a dispatch, and what it is over, as the dispatch before finds them.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PassSize {
    groups: [u32; 3],
    n: u32,
    depth: u32,
}

impl PassSize {
    /// The word of the depth.
    pub(super) const DEPTH: usize = 4;

    /// A size that is not found yet, of `n` items so far.
    pub(super) fn buffer(gpu: &Gpu, n: u32) -> Result<Buffer<Self>, GpuError> {
        let size = gpu.indirect("size of a dispatch", 1)?;
        gpu.write(&size, &[Self { groups: [0, 0, 1], n, depth: 0 }]);
        Ok(size)
    }
}

impl Dispatches<'_> {
    /// One invocation for each of `n` items.
    pub(crate) fn items(&mut self, kernel: &Kernel, bound: &[NamedBinding<'_>], n: u32) -> Result<(), GpuError> {
        self.range(kernel, bound, [0, n])
    }

    /// One invocation for each item of a range.
    pub(crate) fn range(
        &mut self,
        kernel: &Kernel,
        bound: &[NamedBinding<'_>],
        range: [u32; 2],
    ) -> Result<(), GpuError> {
        self.sliced(kernel, bound, range, self.invocations(), |n| kernel.groups(n))
    }

    /// One work-group for each tile of a range.
    pub(super) fn tiles(
        &mut self,
        kernel: &Kernel,
        bound: &[NamedBinding<'_>],
        range: [u32; 2],
    ) -> Result<(), GpuError> {
        let most = (self.invocations() / kernel.group_size()).min(65_535);
        self.sliced(kernel, bound, range, most, |n| [n, 1, 1])
    }

    fn invocations(&self) -> u32 {
        if self.gpu.info().kind == AdapterKind::Software { SOFTWARE_INVOCATIONS } else { INVOCATIONS }
    }

    fn sliced(
        &mut self,
        kernel: &Kernel,
        bound: &[NamedBinding<'_>],
        [mut first, end]: [u32; 2],
        most: u32,
        groups: impl Fn(u32) -> [u32; 3],
    ) -> Result<(), GpuError> {
        let of_each = if most < self.invocations() { kernel.group_size() } else { 1 };
        while first < end {
            let slice = Slice { first, end: end.min(first + most), zero: 0 };
            let uniform = self.gpu.uniform("slice", &slice)?;
            let mut with_slice: Vec<NamedBinding<'_>> = vec![("slice", &uniform)];
            with_slice.extend_from_slice(bound);
            let n = (slice.end - first).saturating_mul(of_each);
            if self.n_waiting > 0 && self.n_waiting.saturating_add(n) > self.invocations() {
                self.work.flush();
                self.n_waiting = 0;
            }
            self.work.dispatch(kernel, &with_slice, groups(slice.end - first))?;
            self.n_waiting += n;
            first = slice.end;
        }
        Ok(())
    }
}
