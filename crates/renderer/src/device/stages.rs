//! The kernels that take samples: one that does it all, or a few that hand paths to each other.

use std::sync::Arc;

use canted_gpu::{Buffer, Gpu, GpuError, Kernel, NamedBinding, Specialisation};

use super::slices::{CELL_PIXELS, Seen, Taken};

/// Most work-groups whose paths wait at once: of 160 bytes, 80 MiB.
const MOST_WAITING: u32 = 1 << 13;

/// Rays of a path that are traced before the host asks how many paths are left.
const RAYS_AT_ONCE: usize = 4;

/// Kernels, compiled.
#[derive(Clone)]
pub(super) struct Stages {
    pub(super) light: Light,
    /// Tells what camera rays meet first, where that is asked for.
    pub(super) guide: Option<Arc<Kernel>>,
}

/// What gathers light.
#[derive(Clone)]
pub(super) enum Light {
    /// All rays of a sample are traced in one invocation.
    One(Arc<Kernel>),
    /// Paths wait in memory for their rays; those that go on are closed up before the next.
    Waves { generate: Arc<Kernel>, trace: Arc<Kernel>, shade: Arc<Kernel> },
}

impl Light {
    /// The kernels of a wavefront, of what is `chosen` for `render/path`.
    pub(super) fn waves(gpu: &Gpu, chosen: &Specialisation) -> Result<Self, GpuError> {
        let kernel = |name: &str| gpu.kernel(name, &chosen.of_kernel(name)?);
        Ok(Self::Waves {
            generate: kernel("alternatives/wavefront/generate")?,
            trace: kernel("alternatives/wavefront/trace")?,
            shade: kernel("alternatives/wavefront/shade")?,
        })
    }
}

impl Stages {
    /// Whether any of them binds a variable of this name.
    pub(super) fn binds(&self, name: &str) -> bool {
        let light = match &self.light {
            Light::One(kernel) => vec![kernel],
            Light::Waves { generate, trace, shade } => vec![generate, trace, shade],
        };
        light.into_iter().chain(&self.guide).any(|kernel| kernel.bindings().iter().any(|binding| binding.name == name))
    }
}

/// Kernels with the memory that they need beside the samples, for so many work-groups of one sample of a cell each.
pub(super) struct Ready {
    stages: Stages,
    waiting: Option<Waiting>,
    pub(super) most_groups: u32,
}

/// Places of paths, and how many they are.
type Queue = (Buffer<u32>, Buffer<u32>);

/// Paths between kernels.
struct Waiting {
    paths: Buffer<u32>,
    /// Those that are on their way, before and after a ray.
    queues: [Queue; 2],
    /// What their rays met: five words each.
    hits: Buffer<[u32; 5]>,
}

impl Ready {
    /// Kernels for at most `most` work-groups.
    pub(super) fn new(gpu: &Gpu, stages: Stages, most: u32) -> Result<Self, GpuError> {
        let binding = gpu.limits().max_storage_buffer_binding_size;
        let fit = |bytes: usize| u32::try_from(binding / (CELL_PIXELS * bytes) as u64).unwrap_or(u32::MAX);
        let most = most.min(fit(size_of::<Taken>()));
        let most = if stages.guide.is_some() { most.min(fit(size_of::<Seen>())) } else { most };
        let Light::Waves { shade, .. } = &stages.light else {
            return Ok(Self { stages, waiting: None, most_groups: most });
        };
        let of_path = shade.bytes_of("Path").expect("the kernel has paths") as usize;
        let most = most.min(MOST_WAITING).min(fit(of_path));
        let n = most as usize * CELL_PIXELS;
        let queue = || -> Result<Queue, GpuError> {
            Ok((gpu.zeroed("paths on their way", n)?, gpu.zeroed("number of paths", 1)?))
        };
        let waiting = Waiting {
            paths: gpu.zeroed("paths", n * of_path / size_of::<u32>())?,
            queues: [queue()?, queue()?],
            hits: gpu.zeroed("hits", n)?,
        };
        Ok(Self { stages, waiting: Some(waiting), most_groups: most })
    }

    /// Whether guides are told too.
    pub(super) fn is_guided(&self) -> bool {
        self.stages.guide.is_some()
    }

    /// Takes the samples of `n` work-groups; returns when they are there.
    pub(super) fn run(&self, gpu: &Gpu, bound: &[NamedBinding<'_>], n: u32) -> Result<(), GpuError> {
        let alone = match (&self.stages.light, &self.waiting) {
            (Light::Waves { generate, trace, shade }, Some(waiting)) => {
                waiting.run(gpu, [generate, trace, shade], bound, n)?;
                None
            }
            (Light::One(kernel) | Light::Waves { generate: kernel, .. }, _) => Some(kernel),
        };
        let mut commands = gpu.commands();
        for kernel in alone.into_iter().chain(&self.stages.guide) {
            commands.dispatch(kernel, bound, kernel.groups(n * kernel.group_size()))?;
        }
        commands.run()
    }
}

impl Waiting {
    fn run(&self, gpu: &Gpu, kernels: [&Kernel; 3], bound: &[NamedBinding<'_>], n: u32) -> Result<(), GpuError> {
        let [generate, trace, shade] = kernels;
        let Self { paths, queues, hits } = self;
        let mut commands = gpu.commands();
        let [(living, n_living), _] = queues;
        commands.clear(n_living);
        let own: [NamedBinding<'_>; 3] = [("paths", paths), ("next_active", living), ("n_next_active", n_living)];
        let mut most = n * generate.group_size();
        commands.dispatch(generate, &together(bound, &own), generate.groups(most))?;
        for turn in 1.. {
            let [(living, n_living), (following, n_following)] = [&queues[(turn + 1) % 2], &queues[turn % 2]];
            commands.clear(n_following);
            let own: [NamedBinding<'_>; 6] = [
                ("paths", paths),
                ("hits", hits),
                ("active_paths", living),
                ("n_active", n_living),
                ("next_active", following),
                ("n_next_active", n_following),
            ];
            let bound = together(bound, &own);
            commands.dispatch(trace, &bound, trace.groups(most))?;
            commands.dispatch(shade, &bound, shade.groups(most))?;
            if turn % RAYS_AT_ONCE == 0 {
                std::mem::replace(&mut commands, gpu.commands()).submit()?;
                // Paths only become fewer.
                most = gpu.read(n_following)?.first().copied().unwrap_or(0);
                if most == 0 {
                    break;
                }
            }
        }
        Ok(())
    }
}

fn together<'a>(shared: &[NamedBinding<'a>], own: &[NamedBinding<'a>]) -> Vec<NamedBinding<'a>> {
    shared.iter().chain(own).copied().collect()
}
