//! Queries of rays that kernels write, without a read-back: pictures trace paths by them.

use std::sync::Arc;

use canted_shaders::choice;

use super::layout::{DeviceHit, DeviceRay};
use super::query::{CLOSEST, Kernels, OCCLUDED};
use super::ray_list::RayList;
use super::scene::TracedScene;
use crate::commands::AsBinding;
use crate::{Buffer, Commands, Gpu, GpuError, Kernel, NamedBinding};

/// Most queries whose exact rays are counted; those of further ones are not.
const MAX_COUNTED: usize = 256;

/// Compiled queries of the rays of a list.
pub struct StreamQueries {
    closest: Kernels,
    occluded: Kernels,
    /// Rays of a query that exact kernels trace.
    undecided: RayList,
    /// How many those were, by query.
    counts: Buffer<u32>,
    n_counted: usize,
}

impl TracedScene {
    /// Queries of at most `n` rays that kernels write. `own`: the caller's kernels of closest hits and of occlusion, which trace the rays of a list exactly in
    /// place of those of this crate, and decide which hits of [masked triangles](crate::Options::masked) count.
    ///
    /// # Errors
    /// A scene with curves, some of whose rays the CPU must trace; rays of the driver; a limit of the device.
    pub fn stream_queries(
        &self,
        gpu: &Gpu,
        n: usize,
        own: Option<[Arc<Kernel>; 2]>,
    ) -> Result<StreamQueries, GpuError> {
        if self.is_of_driver() {
            return Err(GpuError::Unsupported { what: "streams of rays by ray queries of the driver".to_owned() });
        }
        let [own_closest, own_occluded] = own.map_or([None, None], |own| own.map(Some));
        let kernels = |names, own: Option<Arc<Kernel>>| {
            let kernels = self.kernels(gpu, names, choice::Each::Listed)?;
            Ok::<_, GpuError>(match own {
                None => kernels,
                Some(own) => kernels.with_exact(own),
            })
        };
        if self.has_curves() {
            return Err(GpuError::Unsupported { what: "streams of rays through curves".to_owned() });
        }
        Ok(StreamQueries {
            closest: kernels(&CLOSEST, own_closest)?,
            occluded: kernels(&OCCLUDED, own_occluded)?,
            undecided: RayList::uncleared(gpu, n)?,
            counts: gpu.work_buffer("exact rays of queries", MAX_COUNTED)?,
            n_counted: 0,
        })
    }
}

impl StreamQueries {
    /// Adds the dispatches that write the closest hit of each listed ray. `bound` has the [bindings of the scene](TracedScene::bindings), and what kernels
    /// of the caller bind.
    ///
    /// # Errors
    /// A variable is missing.
    pub fn record_closest_hits(
        &mut self,
        bound: &[NamedBinding<'_>],
        commands: &mut Commands<'_>,
        list: &RayList,
        rays: &Buffer<DeviceRay>,
        hits: &Buffer<DeviceHit>,
    ) -> Result<(), GpuError> {
        self.record(bound, commands, true, list, [("rays", rays), ("hits", hits)])
    }

    /// Adds the dispatches that write whether each listed ray hits anything: 1 for a hit, 0 for a miss.
    ///
    /// # Errors
    /// A variable is missing.
    pub fn record_occluded(
        &mut self,
        bound: &[NamedBinding<'_>],
        commands: &mut Commands<'_>,
        list: &RayList,
        rays: &Buffer<DeviceRay>,
        found: &Buffer<u32>,
    ) -> Result<(), GpuError> {
        self.record(bound, commands, false, list, [("rays", rays), ("found", found)])
    }

    fn record(
        &mut self,
        bound: &[NamedBinding<'_>],
        commands: &mut Commands<'_>,
        is_closest: bool,
        list: &RayList,
        own: [NamedBinding<'_>; 2],
    ) -> Result<(), GpuError> {
        let [(_, rays), (_, answers)] = own;
        let room = |binding: &dyn AsBinding, size: usize| binding.n_bytes() / size as u64;
        let size_of_answer = if is_closest { size_of::<DeviceHit>() } else { size_of::<u32>() };
        let n_rays = room(rays, size_of::<DeviceRay>());
        if room(answers, size_of_answer) < n_rays || self.undecided.capacity() < list.capacity() {
            let message = format!("answers or lists of a query have no room for those of {n_rays} rays");
            return Err(GpuError::Input { message });
        }
        let bound = [bound, &own, &[("undecided", &self.undecided as &dyn AsBinding)]].concat();
        let of_list = [&bound[..], &[("listed", list as &dyn AsBinding)]].concat();
        let of_undecided = [&bound[..], &[("listed", &self.undecided as &dyn AsBinding)]].concat();
        match if is_closest { &self.closest } else { &self.occluded } {
            // Not reached: such scenes have no queries.
            Kernels::Host | Kernels::Driver(_) => {
                return Err(GpuError::Input { message: "the scene has no queries".to_owned() });
            }
            Kernels::Exact(kernel) => list.dispatch(commands, kernel, &of_list)?,
            Kernels::CertainFirst { certain, listed } => {
                self.undecided.clear(commands);
                for kernel in certain {
                    list.dispatch(commands, kernel, &of_list)?;
                }
                if let Some(listed) = listed {
                    self.undecided.dispatch(commands, listed, &of_undecided)?;
                }
                if self.n_counted < MAX_COUNTED {
                    self.undecided.copy_count(commands, &self.counts, self.n_counted as u32);
                    self.n_counted += 1;
                }
            }
        }
        Ok(())
    }

    /// How many rays exact kernels traced since the last call, in commands that were submitted: for each query a word, which the caller [reads beside
    /// others](Gpu::read_beside) and adds; of the first 256 queries.
    pub fn take_exact_counts(&mut self) -> (&Buffer<u32>, usize) {
        (&self.counts, std::mem::take(&mut self.n_counted))
    }
}
