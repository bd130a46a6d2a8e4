//! Queries of rays that kernels write, without a read-back: pictures trace paths by them.

use canted_shaders::choice;

use super::layout::{DeviceHit, DeviceRay};
use super::query::{CLOSEST, Kernels, OCCLUDED};
use super::ray_list::RayList;
use super::scene::TracedScene;
use crate::commands::AsBinding;
use crate::{Buffer, Commands, Gpu, GpuError, NamedBinding};

/// Most queries whose exact rays are counted; those of later ones are counted with the last.
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
    /// Queries of at most `n` rays that kernels write.
    ///
    /// # Errors
    /// A scene with round segments, some of whose rays the CPU must trace; a limit of the device.
    pub fn stream_queries(&self, gpu: &Gpu, n: usize) -> Result<StreamQueries, GpuError> {
        if self.has_segments() {
            return Err(GpuError::Unsupported { what: "streams of rays through round segments".to_owned() });
        }
        Ok(StreamQueries {
            closest: self.kernels(gpu, &CLOSEST, choice::Each::Listed)?,
            occluded: self.kernels(gpu, &OCCLUDED, choice::Each::Listed)?,
            undecided: RayList::new(gpu, n)?,
            counts: gpu.zeroed("exact rays of queries", MAX_COUNTED)?,
            n_counted: 0,
        })
    }
}

impl StreamQueries {
    /// Adds the dispatches that write the closest hit of each listed ray.
    ///
    /// # Errors
    /// A variable is missing.
    pub fn record_closest_hits(
        &mut self,
        scene: &TracedScene,
        commands: &mut Commands<'_>,
        list: &RayList,
        rays: &Buffer<DeviceRay>,
        hits: &Buffer<DeviceHit>,
    ) -> Result<(), GpuError> {
        self.record(scene, commands, true, list, [("rays", rays), ("hits", hits)])
    }

    /// Adds the dispatches that write whether each listed ray hits anything: 1 for a hit, 0 for a miss.
    ///
    /// # Errors
    /// A variable is missing.
    pub fn record_occluded(
        &mut self,
        scene: &TracedScene,
        commands: &mut Commands<'_>,
        list: &RayList,
        rays: &Buffer<DeviceRay>,
        found: &Buffer<u32>,
    ) -> Result<(), GpuError> {
        self.record(scene, commands, false, list, [("rays", rays), ("found", found)])
    }

    fn record(
        &mut self,
        scene: &TracedScene,
        commands: &mut Commands<'_>,
        is_closest: bool,
        list: &RayList,
        own: [NamedBinding<'_>; 2],
    ) -> Result<(), GpuError> {
        let mut bound = scene.bindings();
        bound.extend(own);
        bound.push(("undecided", &self.undecided));
        let of_list = [&bound[..], &[("listed", list as &dyn AsBinding)]].concat();
        let of_undecided = [&bound[..], &[("listed", &self.undecided as &dyn AsBinding)]].concat();
        match if is_closest { &self.closest } else { &self.occluded } {
            // Not reached: such a scene has no queries.
            Kernels::Host => return Err(GpuError::Input { message: "the CPU traces all rays".to_owned() }),
            Kernels::Exact(kernel) => list.dispatch(commands, kernel, &of_list)?,
            Kernels::CertainFirst { certain, listed } => {
                self.undecided.clear(commands);
                for kernel in certain {
                    list.dispatch(commands, kernel, &of_list)?;
                }
                if let Some(listed) = listed {
                    self.undecided.dispatch(commands, listed, &of_undecided)?;
                }
                let number = self.n_counted.min(MAX_COUNTED - 1);
                self.undecided.copy_count(commands, &self.counts, number as u32);
                self.n_counted += 1;
            }
        }
        Ok(())
    }

    /// How many rays exact kernels traced since the last call, of commands that were submitted; of those beyond 256 queries, some.
    ///
    /// # Errors
    /// The device is lost or does not finish.
    pub async fn take_exact_count(&mut self, gpu: &Gpu) -> Result<u64, GpuError> {
        let n = std::mem::take(&mut self.n_counted).min(MAX_COUNTED);
        Ok(gpu.read_first(&self.counts, n).await?.into_iter().map(u64::from).sum())
    }
}
