//! Command lists, and detection of drivers that end the loops of kernels early.

use canted_shaders::{Binding, wgsl};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, CommandEncoder, CommandEncoderDescriptor,
    ComputePassDescriptor, ComputePassTimestampWrites, QuerySet, QuerySetDescriptor, QueryType,
};

use crate::buffer::Slot;
use crate::{Buffer, Gpu, GpuError, Kernel, Variant, block_on};

/// Maximum number of timed passes per submission. Each uses two queries of the 4,096 that a query set may have.
const MAX_TIMED: u32 = 2_048;

/// Device time of a pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTime {
    /// Name of the kernel.
    pub kernel: String,
    /// Milliseconds on the device.
    pub milliseconds: f64,
}

/// Dispatches that run in order. Each sees what the previous ones wrote.
pub struct Commands<'a> {
    gpu: &'a Gpu,
    encoder: Encoder<'a>,
    timed: Option<Timed>,
    /// Work-groups of all dispatches so far.
    n_groups: u64,
}

/// Where commands are recorded.
enum Encoder<'a> {
    Own(CommandEncoder),
    /// That of a program, which submits it.
    Given(&'a mut CommandEncoder),
}

impl Encoder<'_> {
    fn get(&mut self) -> &mut CommandEncoder {
        match self {
            Self::Own(encoder) => encoder,
            Self::Given(encoder) => encoder,
        }
    }
}

struct Timed {
    queries: QuerySet,
    kernels: Vec<String>,
}

/// A resource and the name of the shader variable it is bound to.
pub type NamedBinding<'a> = (&'a str, &'a dyn AsBinding);

impl AsBinding for Slot<'_> {
    fn resource(&self) -> wgpu::BindingResource<'_> {
        let size = std::num::NonZeroU64::new(self.n_bytes);
        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: self.buffer, offset: self.first_byte, size })
    }

    fn n_bytes(&self) -> u64 {
        self.n_bytes
    }
}

/// A resource that can be bound to a shader variable.
pub trait AsBinding {
    /// The whole resource.
    #[doc(hidden)]
    fn resource(&self) -> wgpu::BindingResource<'_>;

    /// Size on the device, in bytes.
    fn n_bytes(&self) -> u64;
}

impl<T> AsBinding for Buffer<T> {
    fn resource(&self) -> wgpu::BindingResource<'_> {
        let size = std::num::NonZeroU64::new(Self::n_bytes(self));
        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: &self.raw, offset: self.first_byte, size })
    }

    fn n_bytes(&self) -> u64 {
        Self::n_bytes(self)
    }
}

impl AsBinding for wgpu::Buffer {
    fn resource(&self) -> wgpu::BindingResource<'_> {
        self.as_entire_binding()
    }

    fn n_bytes(&self) -> u64 {
        self.size()
    }
}

impl Gpu {
    /// Starts a command list.
    #[must_use]
    pub fn commands(&self) -> Commands<'_> {
        let encoder = self.device.create_command_encoder(&CommandEncoderDescriptor::default());
        Commands { gpu: self, encoder: Encoder::Own(encoder), timed: None, n_groups: 0 }
    }

    /// A new encoder, for [`BufferScene`](crate::BufferScene) and [`InstancedScene`](crate::InstancedScene).
    #[must_use]
    pub fn encoder(&self) -> CommandEncoder {
        self.device.create_command_encoder(&CommandEncoderDescriptor::default())
    }

    /// Submits what was recorded, without waiting.
    ///
    /// # Errors
    /// The device is already known to be lost.
    pub fn submit(&self, encoder: CommandEncoder) -> Result<(), GpuError> {
        self.check()?;
        self.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Records into a program's encoder, which the program submits.
    pub(crate) fn record<'a>(&'a self, encoder: &'a mut CommandEncoder) -> Commands<'a> {
        Commands { gpu: self, encoder: Encoder::Given(encoder), timed: None, n_groups: 0 }
    }

    /// Starts a command list that measures the time of each pass, if the device supports timestamps; see [`Commands::times`].
    #[must_use]
    pub fn timed_commands(&self) -> Commands<'_> {
        let mut commands = self.commands();
        if self.has_timestamps() {
            let descriptor = QuerySetDescriptor { label: None, ty: QueryType::Timestamp, count: 2 * MAX_TIMED };
            commands.timed = Some(Timed { queries: self.device.create_query_set(&descriptor), kernels: vec![] });
        }
        commands
    }
}

impl Commands<'_> {
    /// Adds a dispatch of `groups` work-groups. `bound` must contain every variable that the kernel uses; it may contain
    /// others.
    ///
    /// # Errors
    /// A variable is missing.
    pub fn dispatch(&mut self, kernel: &Kernel, bound: &[NamedBinding<'_>], groups: [u32; 3]) -> Result<(), GpuError> {
        if groups.contains(&0) {
            return Ok(());
        }
        self.n_groups += groups.map(u64::from).iter().product::<u64>();
        self.record_pass(kernel, bound, |pass| {
            let [x, y, z] = groups;
            pass.dispatch_workgroups(x, y, z);
        })
    }

    /// Adds a dispatch of as many work-groups as entry `number` of `groups` says in its first three words when it runs.
    pub(crate) fn dispatch_indirect<T>(
        &mut self,
        kernel: &Kernel,
        bound: &[NamedBinding<'_>],
        groups: &Buffer<T>,
        number: u32,
    ) -> Result<(), GpuError> {
        self.record_pass(kernel, bound, |pass| {
            pass.dispatch_workgroups_indirect(
                &groups.raw,
                groups.first_byte + size_of::<T>() as u64 * u64::from(number),
            )
        })
    }

    /// Adds a pass of one dispatch.
    fn record_pass(
        &mut self,
        kernel: &Kernel,
        bound: &[NamedBinding<'_>],
        dispatch: impl FnOnce(&mut wgpu::ComputePass<'_>),
    ) -> Result<(), GpuError> {
        let bind_groups = bind_groups(self.gpu, &kernel.name, kernel.bindings(), bound, |number| {
            kernel.pipeline.get_bind_group_layout(number)
        })?;
        let timestamp_writes =
            self.timed.as_mut().filter(|timed| timed.kernels.len() < MAX_TIMED as usize).map(|timed| {
                let first = 2 * timed.kernels.len() as u32;
                timed.kernels.push(kernel.name.clone());
                ComputePassTimestampWrites {
                    query_set: &timed.queries,
                    beginning_of_pass_write_index: Some(first),
                    end_of_pass_write_index: Some(first + 1),
                }
            });
        let mut pass = self
            .encoder
            .get()
            .begin_compute_pass(&ComputePassDescriptor { label: Some(&kernel.name), timestamp_writes });
        pass.set_pipeline(&kernel.pipeline);
        for (number, group) in &bind_groups {
            pass.set_bind_group(*number, group, &[]);
        }
        dispatch(&mut pass);
        self.gpu.counters.add_dispatch();
        Ok(())
    }

    /// Work-groups of all dispatches so far.
    pub(crate) fn n_groups(&self) -> u64 {
        self.n_groups
    }

    /// Copies `n` values.
    pub(crate) fn copy_range<T>(&mut self, (from, first): (&Buffer<T>, u32), (to, at): (&Buffer<T>, u32), n: u32) {
        let bytes = |n: u32| u64::from(n) * size_of::<T>() as u64;
        let (first, at) = (from.first_byte + bytes(first), to.first_byte + bytes(at));
        self.encoder.get().copy_buffer_to_buffer(&from.raw, first, &to.raw, at, bytes(n));
    }

    /// Copies a part of a buffer to the words from a word on.
    pub(crate) fn copy_slot(&mut self, from: &Slot<'_>, to: &Buffer<u32>, word: u32) {
        let at = to.first_byte + 4 * u64::from(word);
        self.encoder.get().copy_buffer_to_buffer(from.buffer, from.first_byte, &to.raw, at, from.n_bytes);
    }

    /// Fills `n` values with zeros.
    pub(crate) fn clear_range<T>(&mut self, buffer: &Buffer<T>, first: u32, n: u32) {
        let bytes = |n: u32| u64::from(n) * size_of::<T>() as u64;
        self.encoder.get().clear_buffer(&buffer.raw, buffer.first_byte + bytes(first), Some(bytes(n)));
    }

    /// Sets a word of a buffer of any type to zero.
    pub(crate) fn clear_word<T>(&mut self, buffer: &Buffer<T>, word: u32) {
        self.encoder.get().clear_buffer(&buffer.raw, buffer.first_byte + 4 * u64::from(word), Some(4));
    }

    /// Fills `buffer` with zeros.
    pub fn clear<T>(&mut self, buffer: &Buffer<T>) {
        self.encoder.get().clear_buffer(&buffer.raw, buffer.first_byte, Some(buffer.n_bytes()));
    }

    /// Submits the dispatches added so far, so that other programs can use the device in between.
    pub(crate) fn flush(&mut self) {
        if let Encoder::Own(encoder) = &mut self.encoder {
            let next = self.gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
            self.gpu.queue.submit([std::mem::replace(encoder, next).finish()]);
        }
    }

    /// Submits the dispatches and waits for them.
    ///
    /// # Errors
    /// The device is lost, does not finish, or rejects a dispatch.
    pub async fn run(self) -> Result<(), GpuError> {
        self.times().await.map(drop)
    }

    /// Submits the dispatches without waiting.
    ///
    /// # Errors
    /// The device is already known to be lost.
    pub fn submit(self) -> Result<(), GpuError> {
        self.gpu.check()?;
        if let Encoder::Own(encoder) = self.encoder {
            self.gpu.queue.submit([encoder.finish()]);
        }
        Ok(())
    }

    /// Submits the dispatches, waits for them, and returns the time of each pass; empty without timestamps.
    ///
    /// # Errors
    /// As for [`Commands::run`].
    pub async fn times(self) -> Result<Vec<PassTime>, GpuError> {
        let (kernels, ends) = self.ends().await?;
        Ok(kernels
            .into_iter()
            .zip(ends)
            .map(|(kernel, [begin, end])| PassTime { kernel, milliseconds: end - begin })
            .collect())
    }

    /// Submits the dispatches, waits for them, and returns the milliseconds from the start of the first to the end of the last;
    /// 0 without timestamps.
    ///
    /// # Errors
    /// As for [`Commands::run`].
    pub(crate) fn span(self) -> Result<f64, GpuError> {
        let (_, ends) = block_on(self.ends())?;
        let begin = ends.iter().map(|[begin, _]| *begin).fold(f64::INFINITY, f64::min);
        Ok(ends.iter().map(|[_, end]| end - begin).fold(0.0, f64::max))
    }

    /// Submits the dispatches and waits for them. Returns for each timed dispatch the kernel, and its start and end in
    /// milliseconds since the start of the first.
    async fn ends(self) -> Result<(Vec<String>, Vec<[f64; 2]>), GpuError> {
        let Self { gpu, encoder, timed, .. } = self;
        gpu.check()?;
        let Encoder::Own(mut encoder) = encoder else { return Ok((vec![], vec![])) };
        let Some(timed) = timed.filter(|timed| !timed.kernels.is_empty()) else {
            let submission = gpu.queue.submit([encoder.finish()]);
            gpu.wait(submission).await?;
            return Ok((vec![], vec![]));
        };
        let n_queries = 2 * timed.kernels.len();
        let ticks = gpu.resolve_target(n_queries)?;
        encoder.resolve_query_set(&timed.queries, 0..n_queries as u32, &ticks.raw, 0);
        gpu.queue.submit([encoder.finish()]);
        let ticks = gpu.read(&ticks).await?;
        let milliseconds_each = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
        let since_first = |tick: u64| tick.saturating_sub(ticks[0]) as f64 * milliseconds_each;
        let ends = ticks.chunks_exact(2).map(|pair| [since_first(pair[0]), since_first(pair[1])]).collect();
        Ok((timed.kernels, ends))
    }
}

/// Bind groups of a pipeline, with their indices.
///
/// # Errors
/// A variable is missing.
pub(crate) fn bind_groups(
    gpu: &Gpu,
    name: &str,
    bindings: &[Binding],
    bound: &[NamedBinding<'_>],
    layout_of: impl Fn(u32) -> BindGroupLayout,
) -> Result<Vec<(u32, BindGroup)>, GpuError> {
    let mut numbers: Vec<u32> = bindings.iter().map(|binding| binding.group).collect();
    numbers.dedup();
    let group = |number: u32| {
        let entries = bindings.iter().filter(|binding| binding.group == number).map(|binding| {
            let given = bound.iter().find(|(known, _)| *known == binding.name);
            let (_, given) = given.ok_or_else(|| GpuError::Invalid {
                message: format!("kernel '{name}' has no binding for '{}'", binding.name),
            })?;
            Ok(BindGroupEntry { binding: binding.number, resource: given.resource() })
        });
        let entries = entries.collect::<Result<Vec<_>, GpuError>>()?;
        let layout = layout_of(number);
        let descriptor = BindGroupDescriptor { label: Some(name), layout: &layout, entries: &entries };
        Ok((number, gpu.device.create_bind_group(&descriptor)))
    };
    numbers.into_iter().map(group).collect()
}

/// The number for [`LONG_LOOP`], which is counted once per device.
pub(crate) async fn longest_loop(gpu: &Gpu) -> Result<u32, GpuError> {
    if let Some(&counted) = gpu.longest_loop.get() {
        return Ok(counted);
    }
    let counted = loop_iterations(gpu, LONG_LOOP).await?;
    Ok(*gpu.longest_loop.get_or_init(|| counted))
}

/// Iterations requested to detect drivers that end loops early.
pub(crate) const LONG_LOOP: u32 = 100_000;

/// Number of iterations that a loop of `wanted` iterations actually runs on this device.
///
/// Some software drivers end loops early without an error: Mesa's llvmpipe before version 23 ends them after 65,535 iterations,
/// summed over all loops of an invocation.
///
/// # Errors
/// The device is lost or does not finish.
pub async fn loop_iterations(gpu: &Gpu, wanted: u32) -> Result<u32, GpuError> {
    let kernel = gpu.kernel(wgsl::check::LOOPS, &Variant::none())?;
    let parameters = gpu.uniform("loop check", &[wanted, 0, 0, 0])?;
    let counted = gpu.zeroed::<u32>("loop iterations", 1)?;
    let mut commands = gpu.commands();
    commands.dispatch(&kernel, &[("wanted", &parameters), ("counted", &counted)], kernel.groups(1))?;
    commands.run().await?;
    Ok(gpu.read(&counted).await?[0])
}
