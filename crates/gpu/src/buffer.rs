//! Typed buffers.

use std::marker::PhantomData;
use std::sync::{Arc, PoisonError};

use bytemuck::Pod;
use wgpu::{BufferDescriptor, BufferUsages};

use crate::memory::{CHUNK, FrameBuffer, FrameBuffers, Reservation, Traffic, changed, hash};
use crate::{Gpu, GpuError};

/// A device buffer of `len` values of `T`. Never empty on the device, because an empty binding is invalid.
pub struct Buffer<T> {
    pub(crate) raw: wgpu::Buffer,
    /// Where the values start; several buffers may be parts of one.
    pub(crate) first_byte: u64,
    n_bytes: u64,
    len: usize,
    values: PhantomData<T>,
    /// Releases the memory when the buffer is dropped.
    reservation: Arc<Reservation>,
}

/// A part of a buffer.
#[derive(Clone, Copy)]
pub(crate) struct Slot<'a> {
    pub(crate) buffer: &'a wgpu::Buffer,
    pub(crate) first_byte: u64,
    pub(crate) n_bytes: u64,
}

/// Parts of buffers start at multiples of it: WebGPU's default of `min_storage_buffer_offset_alignment`, above which no device is.
pub(crate) const PART_BYTES: u64 = canted_shaders::TABLE_BYTES as u64;

impl<T> Buffer<T> {
    /// Number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the buffer has no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The buffer itself, for a program's own bind groups and copies. Its first [`Buffer::n_bytes`] have these values: of a [work
    /// buffer](Gpu::work_buffer) there may be more, and parts of buffers begin elsewhere.
    #[must_use]
    pub fn wgpu(&self) -> &wgpu::Buffer {
        &self.raw
    }

    /// Size on the device, in bytes.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// A buffer of `len` values and its reservation of the memory.
    pub(crate) fn of_parts(raw: wgpu::Buffer, len: usize, reservation: Arc<Reservation>) -> Self {
        let n_bytes = raw.size();
        Self { raw, first_byte: 0, n_bytes, len, values: PhantomData, reservation }
    }

    /// The part of `len` values from a byte on, a multiple of [`PART_BYTES`]. It shares the memory.
    pub(crate) fn part<U>(&self, first_byte: u64, len: usize) -> Buffer<U> {
        let n_bytes = Gpu::n_bytes_of::<U>(len);
        assert!(
            first_byte.is_multiple_of(PART_BYTES) && first_byte + n_bytes <= self.n_bytes,
            "a part beyond its buffer"
        );
        Buffer {
            raw: self.raw.clone(),
            first_byte: self.first_byte + first_byte,
            n_bytes,
            len,
            values: PhantomData,
            reservation: self.reservation.clone(),
        }
    }

    /// `n` words from a word on.
    pub(crate) fn slot(&self, word: usize, n: usize) -> Slot<'_> {
        Slot { buffer: &self.raw, first_byte: self.first_byte + 4 * word as u64, n_bytes: 4 * n as u64 }
    }

    /// The buffer and its reservation of the memory.
    pub(crate) fn parts(&self) -> (wgpu::Buffer, Arc<Reservation>) {
        (self.raw.clone(), self.reservation.clone())
    }
}

impl Gpu {
    /// Creates a storage buffer that holds `values`.
    ///
    /// # Errors
    /// The size exceeds the limit of a binding or the available memory.
    pub fn buffer<T: Pod>(&self, what: &str, values: &[T]) -> Result<Buffer<T>, GpuError> {
        let buffer = self.zeroed(what, values.len())?;
        if !values.is_empty() {
            self.upload(&buffer.raw, 0, bytemuck::cast_slice(values));
        }
        Ok(buffer)
    }

    /// Creates a storage buffer of `len` zeros.
    ///
    /// # Errors
    /// As for [`Gpu::buffer`].
    pub fn zeroed<T: Pod>(&self, what: &str, len: usize) -> Result<Buffer<T>, GpuError> {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        self.allocate(what, len, usage, self.limits().max_storage_buffer_binding_size, "bytes in a storage binding")
    }

    /// Creates a uniform buffer that holds one value.
    ///
    /// # Errors
    /// As for [`Gpu::buffer`].
    pub fn uniform<T: Pod>(&self, what: &str, value: &T) -> Result<Buffer<T>, GpuError> {
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let most = self.limits().max_uniform_buffer_binding_size;
        let buffer = self.allocate(what, 1, usage, most, "bytes in a uniform binding")?;
        self.upload(&buffer.raw, 0, bytemuck::bytes_of(value));
        Ok(buffer)
    }

    /// Creates a buffer of `len` zeros that kernels write, and that sizes later dispatches.
    pub(crate) fn indirect<T: Pod>(&self, what: &str, len: usize) -> Result<Buffer<T>, GpuError> {
        let usage = BufferUsages::STORAGE | BufferUsages::INDIRECT | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        self.allocate(what, len, usage, self.limits().max_storage_buffer_binding_size, "bytes in a storage binding")
    }

    /// A buffer of `len` values for the work of one call: what kernels did not write yet may have any value. Once all handles are dropped, a later
    /// call with the same name may get the same memory, of which up to four times as much may be there as it needs.
    ///
    /// The device keeps the memory until something else needs it, or [`Gpu::free_work_buffers`] frees it.
    ///
    /// # Errors
    /// As for [`Gpu::buffer`].
    pub fn work_buffer<T: Pod>(&self, what: &str, len: usize) -> Result<Buffer<T>, GpuError> {
        let usage = BufferUsages::STORAGE | BufferUsages::INDIRECT | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let (most, limit) = (self.limits().max_storage_buffer_binding_size, "bytes in a storage binding");
        let size = self.checked_size::<T>(what, len, most, limit)?;
        if self.memory.is_exceeded() {
            self.free_work_buffers();
        }
        if let Some((raw, reservation)) = self.work_buffers.take(what, size) {
            let n_bytes = size;
            return Ok(Buffer { raw, first_byte: 0, n_bytes, len, values: PhantomData, reservation });
        }
        let buffer = self.allocate(what, len, usage, most, limit)?;
        self.work_buffers.keep(what, buffer.parts());
        Ok(buffer)
    }

    /// Frees [work buffers](Self::work_buffer) that no call uses. Returns whether there were any.
    pub fn free_work_buffers(&self) -> bool {
        self.work_buffers.free()
    }

    /// Overwrites the first values of `buffer`. Takes effect before the next submission.
    pub fn write<T: Pod>(&self, buffer: &Buffer<T>, values: &[T]) {
        assert!(values.len() <= buffer.len, "a buffer of {} takes no {} values", buffer.len, values.len());
        self.upload(&buffer.raw, buffer.first_byte, bytemuck::cast_slice(values));
    }

    /// A buffer of values from which the driver builds an acceleration structure.
    pub(crate) fn for_driver<T: Pod>(&self, what: &str, values: &[T]) -> Result<Buffer<T>, GpuError> {
        let usage = BufferUsages::BLAS_INPUT | BufferUsages::COPY_DST;
        let most = self.limits().max_buffer_size;
        let buffer = self.allocate(what, values.len(), usage, most, "bytes in a buffer")?;
        self.upload(&buffer.raw, 0, bytemuck::cast_slice(values));
        Ok(buffer)
    }

    /// A buffer for resolved timestamp queries.
    pub(crate) fn resolve_target(&self, len: usize) -> Result<Buffer<u64>, GpuError> {
        let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        self.allocate("timestamps", len, usage, self.limits().max_buffer_size, "bytes in a buffer")
    }

    fn allocate<T: Pod>(
        &self,
        what: &str,
        len: usize,
        usage: BufferUsages,
        most: u64,
        limit: &'static str,
    ) -> Result<Buffer<T>, GpuError> {
        let size = self.checked_size::<T>(what, len, most, limit)?;
        match self.allocate_once(what, len, size, usage) {
            // Buffers of earlier calls may have the memory.
            Err(GpuError::OutOfMemory { .. }) if self.free_work_buffers() => self.allocate_once(what, len, size, usage),
            made => made,
        }
    }

    /// Bytes of a buffer, checked against the limit of a binding and that of a buffer.
    fn checked_size<T: Pod>(&self, what: &str, len: usize, most: u64, limit: &'static str) -> Result<u64, GpuError> {
        self.check()?;
        let size = Self::n_bytes_of::<T>(len);
        let most = most.min(self.limits().max_buffer_size);
        if size > most {
            let remedy = "use a smaller scene";
            return Err(GpuError::Limit { what: what.to_owned(), need: size, limit, most, remedy });
        }
        Ok(size)
    }

    fn allocate_once<T: Pod>(
        &self,
        what: &str,
        len: usize,
        size: u64,
        usage: BufferUsages,
    ) -> Result<Buffer<T>, GpuError> {
        // The driver's message does not contain the name of the buffer.
        let no_memory = || GpuError::OutOfMemory { what: format!("{what} of {size} bytes") };
        let reservation = self.memory.take(size).ok_or_else(no_memory)?;
        let descriptor = BufferDescriptor { label: Some(what), size, usage, mapped_at_creation: false };
        let raw = self.guarded(|| self.device.create_buffer(&descriptor));
        let raw = raw.and_then(|raw| self.check().map(|()| raw)).map_err(|error| match error {
            GpuError::OutOfMemory { .. } => no_memory(),
            error => error,
        })?;
        Ok(Buffer::of_parts(raw, len, Arc::new(reservation)))
    }

    /// Size of a buffer in bytes. Sizes are multiples of a word. An empty buffer still has one word.
    pub(crate) fn n_bytes_of<T>(len: usize) -> u64 {
        (len * size_of::<T>()).max(size_of::<T>().max(4)).next_multiple_of(4) as u64
    }

    /// Reads back the values of `buffer` at the given indices, after all submitted work. For a few values of a large buffer.
    ///
    /// # Errors
    /// As for [`Gpu::read`].
    pub(crate) async fn read_at<T: Pod>(&self, buffer: &Buffer<T>, at: &[u32]) -> Result<Vec<T>, GpuError> {
        let gathered = self.zeroed::<T>("gathered values", at.len())?;
        let size = size_of::<T>() as u64;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (to, &from) in (0u64..).zip(at) {
            encoder.copy_buffer_to_buffer(
                &buffer.raw,
                buffer.first_byte + u64::from(from) * size,
                &gathered.raw,
                to * size,
                size,
            );
        }
        self.queue.submit([encoder.finish()]);
        self.read(&gathered).await
    }

    /// The first values of a buffer and the first words of others, in one read.
    ///
    /// # Errors
    /// As for [`Gpu::read`].
    pub async fn read_beside<T: Pod>(
        &self,
        buffer: &Buffer<T>,
        len: usize,
        beside: &[(&Buffer<u32>, usize)],
    ) -> Result<(Vec<T>, Vec<u32>), GpuError> {
        let words = beside.iter().map(|(words, n)| words.slot(0, (*n).min(words.len)));
        self.download(buffer, buffer.len.min(len), &words.collect::<Vec<_>>()).await
    }

    /// Reads back words of several buffers at once.
    pub(crate) async fn read_slots(&self, slots: &[Slot<'_>]) -> Result<Vec<u32>, GpuError> {
        self.download_words(slots).await
    }

    /// Reads back all values of `buffer`, after all submitted work.
    ///
    /// # Errors
    /// The device is lost or does not finish.
    pub async fn read<T: Pod>(&self, buffer: &Buffer<T>) -> Result<Vec<T>, GpuError> {
        self.read_first(buffer, buffer.len).await
    }

    /// Reads back at most `len` values of `buffer`, after all submitted work.
    ///
    /// # Errors
    /// As for [`Gpu::read`].
    pub async fn read_first<T: Pod>(&self, buffer: &Buffer<T>, len: usize) -> Result<Vec<T>, GpuError> {
        Ok(self.download(buffer, buffer.len.min(len), &[]).await?.0)
    }
}

impl Gpu {
    /// What went to the device so far.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        self.counters.traffic()
    }

    /// Writes bytes to a buffer, before the next submission.
    pub(crate) fn upload(&self, buffer: &wgpu::Buffer, at: u64, bytes: &[u8]) {
        self.queue.write_buffer(buffer, at, bytes);
        self.counters.add_upload(bytes.len() as u64);
    }
}

impl Gpu {
    /// Starts a frame of a sequence: buffers that [`Gpu::read_only`] makes from now on replace those of the last frame, in the same order.
    /// Where a buffer has the same name and size, only the parts that differ are uploaded.
    pub fn start_frame(&self) {
        let mut kept = self.frame_buffers.lock().unwrap_or_else(PoisonError::into_inner);
        match &mut *kept {
            None => *kept = Some(FrameBuffers::default()),
            Some(kept) => kept.start_frame(),
        }
    }

    /// Whether this is a frame of a sequence.
    pub(crate) fn keeps_buffers(&self) -> bool {
        self.frame_buffers.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Creates a storage buffer that holds `values`, and that kernels only read. Between [frames](Gpu::start_frame), the buffer of the
    /// last frame is updated, unless something still holds it.
    ///
    /// # Errors
    /// As for [`Gpu::buffer`].
    pub fn read_only<T: Pod>(&self, what: &str, values: &[T]) -> Result<Buffer<T>, GpuError> {
        self.kept_or(what, values, || self.buffer(what, values))
    }

    /// The same for a uniform buffer that holds one value.
    ///
    /// # Errors
    /// As for [`Gpu::uniform`].
    pub fn read_only_uniform<T: Pod>(&self, what: &str, value: &T) -> Result<Buffer<T>, GpuError> {
        self.kept_or(what, std::slice::from_ref(value), || self.uniform(what, value))
    }

    /// The buffer of the last frame, updated, or one that `make` makes.
    fn kept_or<T: Pod>(
        &self,
        what: &str,
        values: &[T],
        make: impl FnOnce() -> Result<Buffer<T>, GpuError>,
    ) -> Result<Buffer<T>, GpuError> {
        let mut kept = self.frame_buffers.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(kept) = &mut *kept else { return make() };
        self.check()?;
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let hashes: Vec<u64> = bytes.chunks(CHUNK).map(hash).collect();
        let (list, number) = kept.take(what);
        if let Some(old) = list.get_mut(number)
            && Arc::strong_count(&old.reservation) == 1
            && old.raw.size() == Self::n_bytes_of::<T>(values.len())
            && old.hashes.len() == hashes.len()
        {
            for [first, end] in changed(&old.hashes, &hashes) {
                let (first, end) = (first * CHUNK, (end * CHUNK).min(bytes.len()));
                self.upload(&old.raw, first as u64, &bytes[first..end]);
            }
            old.hashes = hashes;
            return Ok(Buffer::of_parts(old.raw.clone(), values.len(), old.reservation.clone()));
        }
        let buffer = make()?;
        let (raw, reservation) = buffer.parts();
        let new = FrameBuffer { raw, reservation, hashes };
        match list.get_mut(number) {
            Some(old) => *old = new,
            None => list.push(new),
        }
        Ok(buffer)
    }
}
