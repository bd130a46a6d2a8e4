//! Batches of rays through a scene.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use bytemuck::Pod;
use canted_shaders::{Override, ShaderName, Variant, choice, wgsl};
use canted_trace::{Ray, ScaledRay};

use super::layout::{DeviceHit, DeviceRay, INCOMPLETE};
use super::ray_list::RayList;
use super::scene::TracedScene;
use crate::commands::AsBinding;
use crate::wait::Instant;
use crate::{Buffer, Commands, Gpu, GpuError, Kernel};

/// Result of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome<T> {
    /// The ray was traced.
    Complete(T),
    /// Traversal stopped at the iteration limit, or met a curve that single precision does not decide; trace the ray on the CPU.
    Incomplete,
}

/// Rays of the first slice, and maximum.
const FIRST_SLICE: usize = 1 << 12;
const MAX_SLICE: usize = 1 << 21;

/// Target time of a slice, well below what stalls a display or triggers a driver reset.
const SLICE_TIME: Duration = Duration::from_millis(50);

impl TracedScene {
    /// The closest hit of each ray, `None` for a miss. Ties go to the lowest instance, then the lowest primitive.
    ///
    /// # Errors
    /// The device is lost or does not finish.
    pub async fn closest_hits(&self, gpu: &Gpu, rays: &[Ray]) -> Result<Vec<Outcome<Option<DeviceHit>>>, GpuError> {
        let kernels = self.kernels(gpu, &CLOSEST, choice::Each::All)?;
        let mut answers = Vec::with_capacity(rays.len());
        let incomplete = DeviceHit { t: 0.0, u: 0.0, v: 0.0, primitive: 0, instance: INCOMPLETE };
        self.in_slices(gpu, &kernels, ("hits", incomplete), rays, |slice, hits: Vec<DeviceHit>| {
            answers.extend(slice.iter().zip(hits).map(|(ray, hit)| match (hit.instance, ray) {
                (INCOMPLETE, _) => Outcome::Incomplete,
                (DeviceHit::NONE, _) | (_, None) => Outcome::Complete(None),
                (_, Some(ray)) => Outcome::Complete(Some(DeviceHit { t: ray.caller_t(hit.t), ..hit })),
            }));
        })
        .await?;
        Ok(answers)
    }

    /// Whether each ray hits anything.
    ///
    /// # Errors
    /// As for [`TracedScene::closest_hits`].
    pub async fn occluded(&self, gpu: &Gpu, rays: &[Ray]) -> Result<Vec<Outcome<bool>>, GpuError> {
        let kernels = self.kernels(gpu, &OCCLUDED, choice::Each::All)?;
        let mut answers = Vec::with_capacity(rays.len());
        self.in_slices(gpu, &kernels, ("found", INCOMPLETE), rays, |_, found: Vec<u32>| {
            answers.extend(
                found.iter().map(
                    |&found| if found == INCOMPLETE { Outcome::Incomplete } else { Outcome::Complete(found == 1) },
                ),
            );
        })
        .await?;
        Ok(answers)
    }

    /// The kernels of a query, of all rays of a buffer or of a list of them, compiled at the same time. Those of a list leave [masked](crate::Options::masked)
    /// triangles to the exact one.
    pub(super) fn kernels(&self, gpu: &Gpu, names: &Names, each: choice::Each) -> Result<Kernels, GpuError> {
        if self.is_of_driver() {
            return Ok(Kernels::Driver(gpu.kernel(names.driver, &Variant::none().with(each))?));
        }
        let exact = |each| (names.exact, self.specialize(exact_parts()).with(each));
        Ok(match self.certain_variants(gpu, names, each, None)? {
            // No kernel repeats the arithmetic of the CPU for curves.
            None if self.has_curves() => Kernels::Host,
            Some(certain) if self.has_curves() => {
                Kernels::CertainFirst { certain: gpu.kernels(&certain)?, listed: None }
            }
            None => {
                let (name, chosen) = exact(each);
                Kernels::Exact(gpu.kernel(name, &chosen)?)
            }
            Some(mut wanted) => {
                wanted.push(exact(choice::Each::Listed));
                let mut certain = gpu.kernels(&wanted)?;
                Kernels::CertainFirst { listed: certain.pop(), certain }
            }
        })
    }

    /// Whether single precision decides most rays of a list, and exact kernels the others.
    #[must_use]
    pub fn decides_by_f32(&self, gpu: &Gpu) -> bool {
        matches!(self.certain_variants(gpu, &CLOSEST, choice::Each::Listed, None), Ok(Some(_)))
    }

    /// The kernels that decide what is certain; `None` where exact ones must trace all rays: of binary BVHs, and where the device binds too few
    /// buffers for lists beside those of the scene.
    fn certain_variants(
        &self,
        gpu: &Gpu,
        names: &Names,
        each: choice::Each,
        bound_scale: Option<f64>,
    ) -> Result<Option<Vec<(ShaderName, Variant)>>, GpuError> {
        if gpu.limits().max_storage_buffers_per_shader_stage < self.n_query_buffers(each) {
            return Ok(None);
        }
        let chosen = Variant::none().with(choice::Count::None).with(each);
        let chosen = match bound_scale {
            Some(scale) => chosen.value(Override::BoundScale, scale),
            None => chosen,
        };
        let of = |&name: &ShaderName| {
            let variant = self.specialize_certain(name, chosen.clone(), each == choice::Each::Listed)?;
            Ok(variant.map(|variant| (name, variant)))
        };
        names.certain.iter().map(of).collect()
    }

    /// Traces rays in slices whose size adapts to the measured time, and passes the results to `take`.
    async fn in_slices<T: Pod>(
        &self,
        gpu: &Gpu,
        kernels: &Kernels,
        (into, incomplete): (&str, T),
        rays: &[Ray],
        mut take: impl FnMut(&[Option<ScaledRay>], Vec<T>),
    ) -> Result<(), GpuError> {
        // Rays of the device have no mask.
        if self.has_masks && rays.iter().any(|ray| ray.mask != u32::MAX) {
            let what = "batches of rays with masks through instances with masks; use closest_hit_masked in a kernel";
            return Err(GpuError::Unsupported { what: what.to_owned() });
        }
        let most = MAX_SLICE.min(max_rays(gpu));
        let (mut waiting, mut n) = (rays, FIRST_SLICE.min(most));
        while !waiting.is_empty() {
            let (slice, rest) = waiting.split_at(n.min(waiting.len()));
            let scaled: Vec<Option<ScaledRay>> = slice.iter().map(ScaledRay::new).collect();
            // Rays of the device are at shutter opening.
            let is_later: Vec<bool> = slice.iter().map(|ray| self.has_moving_curves() && ray.time > 0.0).collect();
            let of_device = |(ray, is_later): (&Option<ScaledRay>, &bool)| {
                ray.as_ref().filter(|_| !is_later).map_or(DeviceRay::NOTHING, DeviceRay::scaled)
            };
            let device_rays: Vec<DeviceRay> = scaled.iter().zip(&is_later).map(of_device).collect();
            let start = Instant::now();
            let mut answers = self.slice(gpu, kernels, (into, incomplete), &device_rays).await?;
            let later = is_later.iter().zip(&mut answers).filter(|(is_later, _)| **is_later);
            let n_later = later.map(|(_, answer)| *answer = incomplete).count();
            self.n_exact_rays.fetch_add(n_later as u64, Ordering::Relaxed);
            take(&scaled, answers);
            n = next_size(n, start.elapsed()).min(most);
            waiting = rest;
        }
        Ok(())
    }

    /// The answers to a slice of rays; `incomplete` for those that are left to the CPU.
    async fn slice<T: Pod>(
        &self,
        gpu: &Gpu,
        kernels: &Kernels,
        (into, incomplete): (&str, T),
        rays: &[DeviceRay],
    ) -> Result<Vec<T>, GpuError> {
        if let Kernels::Host = kernels {
            self.n_exact_rays.fetch_add(rays.len() as u64, Ordering::Relaxed);
            return Ok(vec![incomplete; rays.len()]);
        }
        let rays_there = gpu.buffer("rays", rays)?;
        let answers = gpu.zeroed::<T>("answers", rays.len())?;
        let mut commands = gpu.commands();
        let undecided = self.record(gpu, &mut commands, kernels, &rays_there, (into, &answers))?;
        commands.run().await?;
        let n_exact = match (&undecided, kernels) {
            (Some(undecided), _) => undecided.count(gpu).await?,
            (None, Kernels::Driver(_)) => 0,
            (None, _) => u32::try_from(rays.len()).unwrap_or(u32::MAX),
        };
        self.n_exact_rays.fetch_add(n_exact.into(), Ordering::Relaxed);
        let mut found = gpu.read(&answers).await?;
        if let (Some(undecided), Kernels::CertainFirst { listed: None, .. }) = (undecided, kernels) {
            for ray in undecided.listed(gpu, n_exact).await? {
                found[ray as usize] = incomplete;
            }
        }
        Ok(found)
    }

    /// Adds the dispatches of a query. Returns the list of rays that exact kernels trace; `None` where they trace all.
    fn record<T>(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        kernels: &Kernels,
        rays: &Buffer<DeviceRay>,
        (into, answers): (&str, &Buffer<T>),
    ) -> Result<Option<RayList>, GpuError> {
        if answers.len() < rays.len() {
            let message = format!("{} answers have no room for those of {} rays", answers.len(), rays.len());
            return Err(GpuError::Input { message });
        }
        let n_rays = u32::try_from(rays.len()).unwrap_or(u32::MAX);
        let mut bound = self.bindings();
        bound.extend([("rays", rays as &dyn AsBinding), (into, answers)]);
        let (certain, listed) = match kernels {
            Kernels::Host => return Err(GpuError::Input { message: "the CPU traces all rays".to_owned() }),
            Kernels::Exact(kernel) | Kernels::Driver(kernel) => {
                commands.dispatch(kernel, &bound, kernel.groups(n_rays))?;
                return Ok(None);
            }
            Kernels::CertainFirst { certain, listed } => (certain, listed),
        };
        let undecided = RayList::new(gpu, rays.len())?;
        bound.extend([("undecided", &undecided as &dyn AsBinding), ("listed", &undecided)]);
        for kernel in certain {
            commands.dispatch(kernel, &bound, kernel.groups(n_rays))?;
        }
        if let Some(listed) = listed {
            undecided.dispatch(commands, listed, &bound)?;
        }
        drop(bound);
        Ok(Some(undecided))
    }
}

/// Parts of queries, to test and to measure them.
#[doc(hidden)]
impl TracedScene {
    /// Adds the dispatches of [`Self::closest_hits`], for rays and hits in the units of [`DeviceRay::scaled`]. Returns the list of rays that exact
    /// arithmetic decides; `None` if it decides all.
    ///
    /// # Errors
    /// As for [`TracedScene::closest_hits`].
    pub fn record_closest_hits(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        rays: &Buffer<DeviceRay>,
        hits: &Buffer<DeviceHit>,
    ) -> Result<Option<RayList>, GpuError> {
        self.record(gpu, commands, &self.kernels(gpu, &CLOSEST, choice::Each::All)?, rays, ("hits", hits))
    }

    /// The same for [`Self::occluded`]: 1 for a hit, 0 for a miss, [`INCOMPLETE`].
    ///
    /// # Errors
    /// As for [`TracedScene::closest_hits`].
    pub fn record_occluded(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        rays: &Buffer<DeviceRay>,
        found: &Buffer<u32>,
    ) -> Result<Option<RayList>, GpuError> {
        self.record(gpu, commands, &self.kernels(gpu, &OCCLUDED, choice::Each::All)?, rays, ("found", found))
    }

    /// What [`Self::closest_hits`] decides by f32, to test it: hits in the units of [`DeviceRay::scaled`], incomplete where exact arithmetic
    /// must decide. `bound_scale` multiplies the bounds of edges.
    ///
    /// # Errors
    /// Exact kernels trace all rays of this scene; otherwise as for [`TracedScene::closest_hits`].
    #[doc(hidden)]
    pub async fn certain_hits(
        &self,
        gpu: &Gpu,
        rays: &[DeviceRay],
        bound_scale: f64,
    ) -> Result<Vec<Outcome<DeviceHit>>, GpuError> {
        let kernels = self.certain_variants(gpu, &CLOSEST, choice::Each::All, Some(bound_scale))?;
        let certain = kernels.ok_or_else(|| GpuError::Input { message: "exact kernels trace all rays".to_owned() })?;
        let certain = gpu.kernels(&certain)?;
        let rays_there = gpu.buffer("rays", rays)?;
        let hits = gpu.zeroed::<DeviceHit>("hits", rays.len())?;
        let mut commands = gpu.commands();
        let kernels = Kernels::CertainFirst { certain, listed: None };
        let undecided = self.record(gpu, &mut commands, &kernels, &rays_there, ("hits", &hits))?;
        commands.run().await?;
        let mut outcomes: Vec<_> = gpu.read(&hits).await?.into_iter().map(Outcome::Complete).collect();
        if let Some(undecided) = undecided {
            for ray in undecided.listed(gpu, undecided.count(gpu).await?).await? {
                outcomes[ray as usize] = Outcome::Incomplete;
            }
        }
        Ok(outcomes)
    }
}

/// Names of the kernels of a query.
pub(super) struct Names {
    /// The one that traces rays exactly.
    exact: ShaderName,
    /// Those that decide what is certain, in order.
    certain: &'static [ShaderName],
    /// The one whose rays the driver traces.
    driver: ShaderName,
}

pub(super) const CLOSEST: Names = Names {
    exact: wgsl::trace::CLOSEST,
    certain: &[wgsl::trace::CERTAIN_CLOSEST, wgsl::trace::CERTAIN_WEIGHTS],
    driver: wgsl::trace::DRIVER_CLOSEST,
};

pub(super) const OCCLUDED: Names = Names {
    exact: wgsl::trace::OCCLUDED,
    certain: &[wgsl::trace::CERTAIN_OCCLUDED],
    driver: wgsl::trace::DRIVER_OCCLUDED,
};

/// The choices of exact kernels of queries: all hits count, and tests are not counted.
fn exact_parts() -> Variant {
    Variant::none().with(choice::Mask::None).with(choice::Count::None)
}

/// The kernels of a query.
pub(super) enum Kernels {
    /// Exact arithmetic for all rays.
    Exact(Arc<Kernel>),
    /// None: the CPU traces all rays.
    Host,
    /// Ray queries of the driver for all rays.
    Driver(Arc<Kernel>),
    /// What the bounds of f32 decide, by one kernel after another, then exact arithmetic for the listed rest, unless the CPU traces that or a test wants to
    /// see it.
    CertainFirst { certain: Vec<Arc<Kernel>>, listed: Option<Arc<Kernel>> },
}

impl Kernels {
    /// The same with another kernel for what is traced exactly.
    pub(super) fn with_exact(self, exact: Arc<Kernel>) -> Self {
        match self {
            Self::Host | Self::Driver(_) => self,
            Self::Exact(_) => Self::Exact(exact),
            Self::CertainFirst { certain, .. } => Self::CertainFirst { certain, listed: Some(exact) },
        }
    }
}

/// Maximum number of rays in a binding.
fn max_rays(gpu: &Gpu) -> usize {
    let limits = gpu.limits();
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / size_of::<DeviceRay>() as u64;
    usize::try_from(most).unwrap_or(usize::MAX)
}

/// Size of the slice after one of `n` rays that took `time`; grows at most fourfold.
fn next_size(n: usize, time: Duration) -> usize {
    let times = SLICE_TIME.as_nanos() / time.as_nanos().max(1);
    match times {
        0 => (n / 2).max(FIRST_SLICE / 4),
        1 => n,
        2 | 3 => 2 * n,
        _ => 4 * n,
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn slice_size_adapts_to_time() {
        assert_eq!(next_size(4096, Duration::from_millis(1)), 16_384);
        assert_eq!(next_size(4096, Duration::from_millis(40)), 4096);
        assert_eq!(next_size(4096, Duration::from_millis(400)), 2048);
        assert_eq!(next_size(1024, Duration::from_secs(4)), 1024);
        assert_eq!(next_size(4096, Duration::ZERO), 16_384);
    }
}
