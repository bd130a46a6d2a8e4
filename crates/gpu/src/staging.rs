//! Results come back from the device through staging buffers. A long one comes in pieces, of which one is copied out while the device fills
//! the next.

use std::ops::Range;

use bytemuck::Pod;
use wgpu::{BufferAsyncError, MapMode, SubmissionIndex};

use crate::wait::{Receiver, slot};
use crate::{Buffer, Gpu, GpuError};

/// Most bytes of a piece.
const PIECE: usize = 8 << 20;

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
        let first_byte = buffer.first_byte + (values.start * size_of::<T>()) as u64;
        encoder.copy_buffer_to_buffer(&buffer.raw, first_byte, &staging, 0, size);
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
