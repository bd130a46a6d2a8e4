//! Buffers through which results come back from the device. They are kept, because a new one costs more than the copy; a long result comes in
//! pieces, of which one is copied out while the device fills the next.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use bytemuck::Pod;
use wgpu::{BufferAsyncError, BufferDescriptor, BufferUsages, MapMode, SubmissionIndex};

use crate::wait::{Receiver, slot};
use crate::{Buffer, Gpu, GpuError};

/// Most bytes of a piece.
const PIECE: usize = 8 << 20;

/// Least bytes of a staging buffer, so that small results share them.
const LEAST: u64 = 1 << 12;

/// Staging buffers that are kept: two for each of a few threads that read at once.
const KEPT: usize = 8;

/// Staging buffers that no read uses.
#[derive(Default)]
pub(crate) struct Staging(Mutex<Vec<wgpu::Buffer>>);

impl Staging {
    /// A buffer of at least `size` bytes: the smallest that is free, or a new one.
    fn take(&self, device: &wgpu::Device, size: u64) -> wgpu::Buffer {
        let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = free.iter().enumerate().filter(|(_, buffer)| buffer.size() >= size);
        if let Some((i, _)) = fits.min_by_key(|(_, buffer)| buffer.size()) {
            return free.swap_remove(i);
        }
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let size = size.next_power_of_two().max(LEAST);
        device.create_buffer(&BufferDescriptor { label: Some("read-back"), size, usage, mapped_at_creation: false })
    }

    /// Keeps a buffer for later reads, in place of the smallest where there are many.
    fn give(&self, buffer: wgpu::Buffer) {
        let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(buffer);
        if free.len() > KEPT
            && let Some(i) = (0..free.len()).min_by_key(|&i| free[i].size())
        {
            free.swap_remove(i);
        }
    }
}

/// Part of a result on its way.
struct Piece {
    staging: wgpu::Buffer,
    n_bytes: usize,
    submission: SubmissionIndex,
    mapped: Receiver<Result<(), BufferAsyncError>>,
}

/// The values of each piece of `len` values of `size` bytes.
fn pieces(len: usize, size: usize) -> impl Iterator<Item = Range<usize>> {
    // Copies start at multiples of four bytes.
    let step = (PIECE / size.max(1)).next_multiple_of(4);
    (0..len).step_by(step).map(move |first| first..(first + step).min(len))
}

impl Gpu {
    /// The first `len` values of `buffer`, after all submitted work.
    pub(crate) async fn download<T: Pod>(&self, buffer: &Buffer<T>, len: usize) -> Result<Vec<T>, GpuError> {
        let mut values = Vec::with_capacity(len);
        let mut waiting = None;
        for values_of in pieces(len, size_of::<T>()) {
            let next = self.start(buffer, values_of)?;
            if let Some(piece) = waiting.replace(next) {
                self.finish_piece(piece, &mut values).await?;
            }
        }
        if let Some(piece) = waiting {
            self.finish_piece(piece, &mut values).await?;
        }
        Ok(values)
    }

    /// Starts the copy of a piece.
    fn start<T: Pod>(&self, buffer: &Buffer<T>, values: Range<usize>) -> Result<Piece, GpuError> {
        self.check()?;
        let n_bytes = values.len() * size_of::<T>();
        let size = n_bytes.next_multiple_of(4) as u64;
        let staging = self.staging.take(&self.device, size);
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&buffer.raw, (values.start * size_of::<T>()) as u64, &staging, 0, size);
        let submission = self.queue.submit([encoder.finish()]);
        let (sender, mapped) = slot();
        staging.map_async(MapMode::Read, ..size, move |result| sender.send(result));
        self.counters.add_download(size);
        Ok(Piece { staging, n_bytes, submission, mapped })
    }

    /// Waits for a piece and appends its values.
    async fn finish_piece<T: Pod>(&self, piece: Piece, values: &mut Vec<T>) -> Result<(), GpuError> {
        let Piece { staging, n_bytes, submission, mapped } = piece;
        self.wait(submission).await?;
        match mapped.receive().await {
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(GpuError::Lost { message: error.to_string() }),
            None => return Err(GpuError::Lost { message: "a buffer is never mapped".to_owned() }),
        }
        let range = ..n_bytes.next_multiple_of(4) as u64;
        let view = staging.get_mapped_range(range).map_err(|error| GpuError::Lost { message: error.to_string() })?;
        match bytemuck::try_cast_slice(&view[..n_bytes]) {
            Ok(aligned) => values.extend_from_slice(aligned),
            Err(_) => values.extend(bytemuck::pod_collect_to_vec::<u8, T>(&view[..n_bytes])),
        }
        drop(view);
        staging.unmap();
        self.staging.give(staging);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_all_values_and_start_at_words() {
        for (len, size) in [(0, 4), (1, 4), (5, 20), (3 << 20, 20), (20 << 20, 1), (4 << 20, 16)] {
            let all: Vec<_> = pieces(len, size).collect();
            assert_eq!(all.iter().map(ExactSizeIterator::len).sum::<usize>(), len);
            let mut end = 0;
            for piece in all {
                assert_eq!(piece.start, end);
                assert!(piece.start * size % 4 == 0 && piece.len() * size <= PIECE + 4 * size);
                end = piece.end;
            }
        }
    }
}
