//! A wavefront path tracer: a measured alternative to one kernel per sample.
//!
//! Separate kernels generate, trace and shade paths; the paths that continue are compacted in between (Laine, Karras,
//! Aila 2013). Only benchmarks and tests select it.

use std::sync::Arc;

use canted_gpu::{Buffer, Gpu, GpuError, Kernel, NamedBinding, Specialisation};

/// Work-groups whose paths are in memory at once: 80 MiB for paths of 160 bytes.
const MAX_GROUPS: u32 = 1 << 13;

/// Rays of a path between two reads of the number of active paths.
const RAYS_PER_READ: usize = 4;

/// The three kernels.
#[derive(Clone)]
pub(super) struct WavefrontKernels {
    generate: Arc<Kernel>,
    trace: Arc<Kernel>,
    shade: Arc<Kernel>,
}

impl WavefrontKernels {
    /// Compiles the kernels with the specialisation of `render/path`.
    pub(super) fn new(gpu: &Gpu, specialisation: &Specialisation) -> Result<Self, GpuError> {
        let kernel = |name: &str| gpu.kernel(name, &specialisation.of_kernel(name)?);
        Ok(Self {
            generate: kernel("alternatives/wavefront/generate")?,
            trace: kernel("alternatives/wavefront/trace")?,
            shade: kernel("alternatives/wavefront/shade")?,
        })
    }

    pub(super) fn all(&self) -> [&Arc<Kernel>; 3] {
        [&self.generate, &self.trace, &self.shade]
    }

    /// Bytes of a path.
    fn path_bytes(&self) -> usize {
        self.shade.bytes_of("Path").expect("the kernel has paths") as usize
    }

    /// Work-groups whose paths fit in a binding, by the number that fits for a size in bytes.
    pub(super) fn max_groups(&self, fit: impl Fn(usize) -> u32) -> u32 {
        MAX_GROUPS.min(fit(self.path_bytes()))
    }
}

/// Indices of paths, and their number.
type Queue = (Buffer<u32>, Buffer<u32>);

/// The kernels and the paths between them.
pub(super) struct Wavefront {
    kernels: WavefrontKernels,
    paths: Buffer<u32>,
    /// Active paths before and after a ray.
    queues: [Queue; 2],
    /// Hits of their rays, five words each.
    hits: Buffer<[u32; 5]>,
}

impl Wavefront {
    /// Allocates `n` paths.
    pub(super) fn new(gpu: &Gpu, kernels: WavefrontKernels, n: usize) -> Result<Self, GpuError> {
        let queue =
            || -> Result<Queue, GpuError> { Ok((gpu.zeroed("active paths", n)?, gpu.zeroed("number of paths", 1)?)) };
        Ok(Self {
            paths: gpu.zeroed("paths", n * kernels.path_bytes() / size_of::<u32>())?,
            queues: [queue()?, queue()?],
            hits: gpu.zeroed("hits", n)?,
            kernels,
        })
    }

    /// Takes the samples of `n` work-groups.
    pub(super) fn run(&self, gpu: &Gpu, bindings: &[NamedBinding<'_>], n: u32) -> Result<(), GpuError> {
        let Self { kernels: WavefrontKernels { generate, trace, shade }, paths, queues, hits } = self;
        let mut commands = gpu.commands();
        let [(active, n_active), _] = queues;
        commands.clear(n_active);
        let own: [NamedBinding<'_>; 3] = [("paths", paths), ("next_active", active), ("n_next_active", n_active)];
        let mut max = n * generate.group_size();
        commands.dispatch(generate, &joined(bindings, &own), generate.groups(max))?;
        for turn in 1.. {
            let [(active, n_active), (next, n_next)] = [&queues[(turn + 1) % 2], &queues[turn % 2]];
            commands.clear(n_next);
            let own: [NamedBinding<'_>; 6] = [
                ("paths", paths),
                ("hits", hits),
                ("active_paths", active),
                ("n_active", n_active),
                ("next_active", next),
                ("n_next_active", n_next),
            ];
            let bindings = joined(bindings, &own);
            commands.dispatch(trace, &bindings, trace.groups(max))?;
            commands.dispatch(shade, &bindings, shade.groups(max))?;
            if turn % RAYS_PER_READ == 0 {
                std::mem::replace(&mut commands, gpu.commands()).submit()?;
                // The number of active paths never grows.
                max = gpu.read(n_next)?.first().copied().unwrap_or(0);
                if max == 0 {
                    break;
                }
            }
        }
        Ok(())
    }
}

fn joined<'a>(shared: &[NamedBinding<'a>], own: &[NamedBinding<'a>]) -> Vec<NamedBinding<'a>> {
    shared.iter().chain(own).copied().collect()
}
