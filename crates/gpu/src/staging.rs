//! Results come back from the device through staging buffers. A long one comes in pieces, of which one is copied out while the device fills
//! the next.

use std::ops::Range;

use bytemuck::Pod;
use wgpu::{BufferAsyncError, MapMode, SubmissionIndex};

use crate::buffer::Slot;
use crate::wait::{Receiver, slot};
use crate::{Buffer, Gpu, GpuError};

/// Most bytes of a piece.
const PIECE: usize = 8 << 20;

/// Part of a result on its way.
struct Piece {
    staging: wgpu::Buffer,
    n_bytes: usize,
    /// Bytes of words after it.
    n_beside: usize,
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
    /// The first `len` values of `buffer`, and words beside them, after all submitted work.
    pub(crate) async fn download<T: Pod>(
        &self,
        buffer: &Buffer<T>,
        len: usize,
        beside: &[Slot<'_>],
    ) -> Result<(Vec<T>, Vec<u32>), GpuError> {
        if len == 0 {
            return Ok((vec![], self.download_words(beside).await?));
        }
        let (mut values, mut words) = (Vec::with_capacity(len), vec![]);
        let mut waiting = None;
        let mut all = pieces(len, size_of::<T>()).peekable();
        while let Some(values_of) = all.next() {
            let first_byte = buffer.first_byte + (values_of.start * size_of::<T>()) as u64;
            let n_bytes = (values_of.len() * size_of::<T>()) as u64;
            let of_values = Slot { buffer: &buffer.raw, first_byte, n_bytes };
            let next = self.start(Some(of_values), if all.peek().is_none() { beside } else { &[] })?;
            if let Some(piece) = waiting.replace(next) {
                self.finish_piece(piece, &mut values, &mut words).await?;
            }
        }
        if let Some(piece) = waiting {
            self.finish_piece(piece, &mut values, &mut words).await?;
            self.counters.add_download();
        }
        Ok((values, words))
    }

    /// The words of all slots, after all submitted work.
    pub(crate) async fn download_words(&self, slots: &[Slot<'_>]) -> Result<Vec<u32>, GpuError> {
        let mut words = vec![];
        if !slots.is_empty() {
            let piece = self.start(None, slots)?;
            self.finish_piece(piece, &mut Vec::<u32>::new(), &mut words).await?;
            self.counters.add_download();
        }
        Ok(words)
    }

    /// Starts the copy of a piece of values, and of words beside it.
    fn start(&self, values: Option<Slot<'_>>, beside: &[Slot<'_>]) -> Result<Piece, GpuError> {
        self.check()?;
        let n_bytes = values.as_ref().map_or(0, |values| values.n_bytes) as usize;
        let n_beside = beside.iter().map(|words| words.n_bytes).sum::<u64>();
        let size = n_bytes.next_multiple_of(4) as u64 + n_beside;
        let staging = self.staging.take(&self.device, size);
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut end = 0;
        for Slot { buffer, first_byte, n_bytes } in values.iter().chain(beside) {
            let n_bytes = n_bytes.next_multiple_of(4);
            encoder.copy_buffer_to_buffer(buffer, *first_byte, &staging, end, n_bytes);
            end += n_bytes;
        }
        let submission = self.queue.submit([encoder.finish()]);
        let (sender, mapped) = slot();
        staging.map_async(MapMode::Read, ..size, move |result| sender.send(result));
        self.counters.add_piece(size);
        Ok(Piece { staging, n_bytes, n_beside: n_beside as usize, submission, mapped })
    }

    /// Waits for a piece, and appends its values and the words beside them.
    async fn finish_piece<T: Pod>(
        &self,
        piece: Piece,
        values: &mut Vec<T>,
        words: &mut Vec<u32>,
    ) -> Result<(), GpuError> {
        let Piece { staging, n_bytes, n_beside, submission, mapped } = piece;
        self.wait(submission).await?;
        match mapped.receive().await {
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(GpuError::Lost { message: error.to_string() }),
            None => return Err(GpuError::Lost { message: "a buffer is never mapped".to_owned() }),
        }
        let first_beside = n_bytes.next_multiple_of(4);
        let range = ..(first_beside + n_beside) as u64;
        let view = staging.get_mapped_range(range).map_err(|error| GpuError::Lost { message: error.to_string() })?;
        match bytemuck::try_cast_slice(&view[..n_bytes]) {
            Ok(aligned) => values.extend_from_slice(aligned),
            Err(_) => values.extend(bytemuck::pod_collect_to_vec::<u8, T>(&view[..n_bytes])),
        }
        words.extend(bytemuck::pod_collect_to_vec::<u8, u32>(&view[first_beside..first_beside + n_beside]));
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
