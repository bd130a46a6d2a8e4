//! Pictures as streams of rays: kernels that only trace answer the rays of many samples at once, and others shade in between.
//!
//! ```text
//! start -> onward rays ---------> closest hits -+-> shade -> onward rays, shadow rays ...   for some rounds
//!                 shadow rays -> occluded ------+
//! ```
//!
//! A frame has one round; then a kernel traces all other rays of each sample that has some (`rest`).
//!
//! `shaders/render/stream.wgsl` has the kernels and says why samples have the bits of kernels that take whole samples.

use std::ops::Range;
use std::sync::Arc;

use canted_gpu::{
    AdapterKind, Buffer, Commands, DeviceHit, DeviceRay, Gpu, GpuError, Kernel, NamedBinding, RayList, StreamQueries,
    TracedScene, Variant, choice, wgsl,
};

use super::picture::{CELL_PIXELS, Pace};

/// Words of a state, as many as the larger one has: `Gathering` of `shaders/shared/hybrid.wgsl`, `Path` of `path.wgsl`.
pub(super) const STATE_WORDS: usize = 52;

/// Samples in flight, at most: about 350 MB on hardware, whose memory drivers do not say. More would not help: the largest devices run 300,000 invocations at once
/// (an H200 132 x 2,048), a third of that with the registers of a traversal, so that a round of all samples is four to ten times what fills one, and more
/// could only fill the last tenth of a round better. In these rounds lie some ten dispatches, microseconds each, against milliseconds of rays. Software
/// drivers gain nothing from more than fill their threads.
const MAX_SAMPLES: usize = 1 << 20;
const MAX_SAMPLES_SOFTWARE: usize = 1 << 16;

/// Compiled kernels between the queries.
#[derive(Clone)]
pub(super) struct StreamKernels {
    start: Arc<Kernel>,
    shade: Arc<Kernel>,
    /// Ends samples after so many rounds.
    rest: Option<(Arc<Kernel>, u32)>,
    /// Those that trace onward rays and shadow rays exactly, of scenes in which not every hit counts, or that move.
    masked: Option<[Arc<Kernel>; 2]>,
    /// Whether these trace all rays.
    are_all_masked: bool,
    /// How often samples are shaded.
    n_rounds: u32,
}

/// Which rays need more than the BVHs: alpha, sides of faces, or their time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Masked {
    /// None.
    None,
    /// Those that may hit masked triangles of the [`TracedScene`] first.
    Some,
    /// All.
    All,
}

/// Streams of at most so many samples, with their buffers.
pub(super) struct Streams {
    kernels: StreamKernels,
    /// `None` where the kernels have their own.
    queries: Option<StreamQueries>,
    states: Buffer<[u32; STATE_WORDS]>,
    onward_rays: Buffer<DeviceRay>,
    shadow_rays: Buffer<DeviceRay>,
    hits: Buffer<DeviceHit>,
    found: Buffer<u32>,
    /// Samples to shade in this round and in the next.
    alive: [RayList; 2],
    onward_queue: RayList,
    shadow_queue: RayList,
    /// How many samples each round of these samples leaves to the next.
    n_left: Buffer<u32>,
    /// Rounds that are recorded for these samples.
    n_recorded: u32,
    pace: Arc<Pace>,
}

/// More rounds than the longest sample so far took: most samples of a scene take about as many, and where one takes more, the others follow in
/// commands of their own.
const MORE_ROUNDS: u32 = 2;

impl StreamKernels {
    /// Kernels of an integrator for samples that need so many rounds, or that one kernel ends after `few`; `chosen` has the choices of its kernel for
    /// whole samples.
    pub(super) fn new(
        gpu: &Gpu,
        traced: &TracedScene,
        chosen: &Variant,
        (integrator, masked): (choice::Integrator, Masked),
        (n_rounds, few): (u32, Option<u32>),
    ) -> Result<Self, GpuError> {
        use wgsl::render::stream;
        let chosen = chosen.clone().with(integrator);
        let few = few.filter(|&few| few < n_rounds);
        let mut names = vec![stream::START, stream::SHADE];
        names.extend(few.map(|_| stream::REST));
        if masked != Masked::None {
            names.extend([stream::masked::CLOSEST, stream::masked::OCCLUDED]);
        }
        let wanted = names.into_iter().map(|name| Ok((name, chosen.of_kernel(name)?)));
        let compiled = gpu.kernels(&wanted.collect::<Result<Vec<_>, GpuError>>()?)?;
        let [start, shade, own @ ..] = &compiled[..] else { unreachable!("a kernel for each name") };
        let (rest, own) = own.split_at(usize::from(few.is_some()));
        let own = match own {
            [closest, occluded] => Some([closest.clone(), occluded.clone()]),
            _ => None,
        };
        let kernels = Self {
            start: start.clone(),
            shade: shade.clone(),
            rest: rest.first().cloned().zip(few),
            masked: own,
            are_all_masked: masked == Masked::All,
            n_rounds,
        };
        if kernels.has_queries() {
            // Compiles them now, not while the picture is timed.
            traced.stream_queries(gpu, 0, kernels.masked.clone())?;
        }
        Ok(kernels)
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &Arc<Kernel>> {
        let rest = self.rest.iter().map(|(kernel, _)| kernel);
        [&self.start, &self.shade].into_iter().chain(rest).chain(self.masked.iter().flatten())
    }

    /// Whether kernels of [`TracedScene`] trace rays.
    pub(super) fn has_queries(&self) -> bool {
        !self.are_all_masked
    }

    /// Whether these trace all rays, but for those of scenes in which not every hit counts.
    pub(super) fn are_queries(&self) -> bool {
        self.has_queries() && self.rest.is_none()
    }

    /// Most work-groups of a dispatch.
    pub(super) fn max_groups(gpu: &Gpu, pace: &Pace) -> u32 {
        let is_slow = gpu.info().kind == AdapterKind::Software && !pace.is_of_hardware();
        let most = if is_slow { MAX_SAMPLES_SOFTWARE } else { MAX_SAMPLES };
        let in_binding = gpu.limits().max_storage_buffer_binding_size / (4 * STATE_WORDS) as u64;
        (most.min(usize::try_from(in_binding).unwrap_or(most)) / CELL_PIXELS) as u32
    }
}

impl Streams {
    /// Streams of at most `n` samples.
    pub(super) fn new(
        gpu: &Gpu,
        traced: &TracedScene,
        (kernels, pace): (StreamKernels, Arc<Pace>),
        n: usize,
    ) -> Result<Self, GpuError> {
        let list = || RayList::uncleared(gpu, n);
        Ok(Self {
            queries: match kernels.has_queries() {
                true => Some(traced.stream_queries(gpu, n, kernels.masked.clone())?),
                false => None,
            },
            n_left: gpu.work_buffer("samples left by rounds", kernels.n_rounds as usize)?,
            n_recorded: 0,
            kernels,
            pace,
            states: gpu.work_buffer("states of samples", n)?,
            onward_rays: gpu.work_buffer("onward rays", n)?,
            shadow_rays: gpu.work_buffer("shadow rays", n)?,
            hits: gpu.work_buffer("hits of onward rays", n)?,
            found: gpu.work_buffer("answers to shadow rays", n)?,
            alive: [list()?, list()?],
            onward_queue: list()?,
            shadow_queue: list()?,
        })
    }

    /// What is read beside the samples, for [`Self::took`].
    pub(super) fn beside(&mut self) -> Vec<(&Buffer<u32>, usize)> {
        let counts = self.queries.as_mut().map(StreamQueries::take_exact_counts);
        counts.into_iter().chain([(&self.n_left, self.n_recorded as usize)]).collect()
    }

    /// How many rays exact kernels traced, of those that others did not decide, and whether all samples are done; from the words of [`Self::beside`].
    pub(super) fn took(&mut self, beside: &[u32]) -> (u64, bool) {
        let (exact, left) = beside.split_at(beside.len() - self.n_recorded as usize);
        let n_needed = left.iter().position(|&n| n == 0).map_or(self.n_recorded, |round| round as u32 + 1);
        self.pace.took_rounds(n_needed);
        let has_no_more = self.kernels.rest.is_some() || self.n_recorded == self.kernels.n_rounds;
        let is_done = has_no_more || left.last().is_none_or(|&n| n == 0);
        (exact.iter().map(|&n| u64::from(n)).sum(), is_done)
    }

    /// Adds the dispatches that take the samples of `n_groups` work-groups, in as many rounds as earlier samples needed and some more.
    pub(super) fn record(
        &mut self,
        commands: &mut Commands<'_>,
        bindings: &[NamedBinding<'_>],
        n_groups: u32,
    ) -> Result<(), GpuError> {
        let shared = [bindings, &self.bindings()].concat();
        let [alive, next] = &self.alive;
        for list in [&self.onward_queue, &self.shadow_queue, alive] {
            list.clear(commands);
        }
        let start = &self.kernels.start;
        commands.dispatch(start, &with_lists(&shared, [next, alive]), start.groups(n_groups * start.group_size()))?;
        drop(shared);
        self.n_recorded = 0;
        let n_rounds = self.kernels.n_rounds;
        let n = match (&self.kernels.rest, self.pace.n_rounds()) {
            (Some((_, few)), _) => *few,
            (None, Some(n)) => n.saturating_add(MORE_ROUNDS).min(n_rounds),
            (None, None) => n_rounds,
        };
        self.record_rounds(commands, bindings, n)
    }

    /// Adds the dispatches that end the samples which these rounds left.
    pub(super) fn record_rest(
        &mut self,
        commands: &mut Commands<'_>,
        bindings: &[NamedBinding<'_>],
    ) -> Result<(), GpuError> {
        self.record_rounds(commands, bindings, self.kernels.n_rounds)
    }

    /// Adds the rounds from the last recorded one to before `end`, and keeps the samples.
    fn record_rounds(
        &mut self,
        commands: &mut Commands<'_>,
        bindings: &[NamedBinding<'_>],
        end: u32,
    ) -> Result<(), GpuError> {
        // Apart from the queries, which count.
        let mut queries = self.queries.take();
        let done = self.rounds(commands, bindings, queries.as_mut(), self.n_recorded..end);
        self.queries = queries;
        self.n_recorded = end;
        done
    }

    fn rounds(
        &self,
        commands: &mut Commands<'_>,
        bindings: &[NamedBinding<'_>],
        mut queries: Option<&mut StreamQueries>,
        rounds: Range<u32>,
    ) -> Result<(), GpuError> {
        let Self { kernels, onward_rays, shadow_rays, hits, found, alive, onward_queue, shadow_queue, .. } = self;
        let StreamKernels { shade, rest, masked, .. } = kernels;
        let shared = [bindings, &self.bindings()].concat();
        let mut lists = [&alive[0], &alive[1]];
        lists.rotate_left(rounds.start as usize % 2);
        for round in rounds {
            // Rays from the camera are onward rays.
            let has_shadow_rays = round > 0;
            if let Some(queries) = &mut queries {
                queries.record_closest_hits(&shared, commands, onward_queue, onward_rays, hits)?;
                if has_shadow_rays {
                    queries.record_occluded(&shared, commands, shadow_queue, shadow_rays, found)?;
                }
            } else if let Some([closest, occluded]) = masked {
                onward_queue.dispatch(commands, closest, &with_rays(&shared, onward_queue, onward_rays))?;
                if has_shadow_rays {
                    shadow_queue.dispatch(commands, occluded, &with_rays(&shared, shadow_queue, shadow_rays))?;
                }
            }
            for list in [onward_queue, shadow_queue, lists[1]] {
                list.clear(commands);
            }
            lists[0].dispatch(commands, shade, &with_lists(&shared, lists))?;
            lists[1].copy_count(commands, &self.n_left, round);
            lists.swap(0, 1);
        }
        if let Some((rest, _)) = rest {
            lists[0].dispatch(commands, rest, &with_lists(&shared, lists))?;
        }
        Ok(())
    }

    /// The bindings of all kernels but the lists of samples.
    fn bindings(&self) -> [NamedBinding<'_>; 7] {
        [
            ("states", &self.states),
            ("onward_rays", &self.onward_rays),
            ("shadow_rays", &self.shadow_rays),
            ("hits", &self.hits),
            ("found", &self.found),
            ("onward_queue", &self.onward_queue),
            ("shadow_queue", &self.shadow_queue),
        ]
    }
}

/// The bindings of a kernel that takes the samples of a list and writes another list.
fn with_lists<'a>(shared: &[NamedBinding<'a>], [listed, next]: [&'a RayList; 2]) -> Vec<NamedBinding<'a>> {
    let lists: [NamedBinding<'a>; 2] = [("listed", listed), ("next_samples", next)];
    [shared, &lists].concat()
}

/// The bindings of a kernel that traces the rays of a list.
fn with_rays<'a>(shared: &[NamedBinding<'a>], list: &'a RayList, rays: &'a Buffer<DeviceRay>) -> Vec<NamedBinding<'a>> {
    let own: [NamedBinding<'a>; 2] = [("listed", list), ("rays", rays)];
    [shared, &own].concat()
}
