//! Buffers that one frame hands to the next, so that only what changed is uploaded.

use std::collections::HashMap;
use std::sync::{Arc, PoisonError};

use bytemuck::Pod;

use crate::memory::Share;
use crate::{Buffer, Gpu, GpuError};

/// Bytes that are compared, and uploaded, together.
const CHUNK: usize = 256;

/// Buffers by name, in the order in which a frame made them.
#[derive(Default)]
pub(crate) struct KeptBuffers {
    buffers: HashMap<String, Vec<KeptBuffer>>,
    /// Buffers of each name that this frame has taken.
    n_taken: HashMap<String, usize>,
}

struct KeptBuffer {
    raw: wgpu::Buffer,
    share: Arc<Share>,
    /// A hash of each chunk.
    hashes: Vec<u64>,
}

impl Gpu {
    /// Starts a frame of a sequence: buffers that [`Gpu::read_only`] makes from now on replace those of the last frame, in the same order.
    /// Where a buffer has the same name and size, only the parts that differ are uploaded.
    pub fn start_frame(&self) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        match &mut *kept {
            None => *kept = Some(KeptBuffers::default()),
            Some(kept) => {
                let KeptBuffers { buffers, n_taken } = kept;
                // What the last frame did not take is not needed.
                for (name, list) in &mut *buffers {
                    list.truncate(n_taken.get(name).copied().unwrap_or(0));
                }
                n_taken.clear();
            }
        }
    }

    /// Whether this is a frame of a sequence.
    pub(crate) fn keeps_buffers(&self) -> bool {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Creates a storage buffer that holds `values`, and that kernels only read. Between [frames](Gpu::start_frame), the buffer of the
    /// last frame is updated, unless something still holds it.
    ///
    /// # Errors
    /// As for [`Gpu::buffer`].
    pub fn read_only<T: Pod>(&self, what: &str, values: &[T]) -> Result<Buffer<T>, GpuError> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(kept) = &mut *kept else { return self.buffer(what, values) };
        self.check()?;
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let hashes: Vec<u64> = bytes.chunks(CHUNK).map(hash).collect();
        let number = kept.n_taken.entry(what.to_owned()).or_default();
        let list = kept.buffers.entry(what.to_owned()).or_default();
        *number += 1;
        if let Some(old) = list.get_mut(*number - 1)
            && Arc::strong_count(&old.share) == 1
            && old.raw.size() == Self::n_bytes_of::<T>(values.len())
            && old.hashes.len() == hashes.len()
        {
            for [first, end] in changed(&old.hashes, &hashes) {
                let (first, end) = (first * CHUNK, (end * CHUNK).min(bytes.len()));
                self.upload(&old.raw, first as u64, &bytes[first..end]);
            }
            old.hashes = hashes;
            return Ok(Buffer::of_parts(old.raw.clone(), values.len(), old.share.clone()));
        }
        let buffer = self.buffer(what, values)?;
        let (raw, share) = buffer.parts();
        let new = KeptBuffer { raw, share, hashes };
        match list.get_mut(*number - 1) {
            Some(old) => *old = new,
            None => list.push(new),
        }
        Ok(buffer)
    }
}

/// Ranges of chunks that differ.
fn changed(before: &[u64], after: &[u64]) -> Vec<[usize; 2]> {
    let mut ranges: Vec<[usize; 2]> = vec![];
    for (chunk, _) in before.iter().zip(after).enumerate().filter(|(_, (a, b))| a != b) {
        match ranges.last_mut() {
            Some([_, end]) if *end == chunk => *end += 1,
            _ => ranges.push([chunk, chunk + 1]),
        }
    }
    ranges
}

/// A hash of a chunk: different ones are equal with a probability of about 2^-64. Source: the folded products of wyhash.
fn hash(chunk: &[u8]) -> u64 {
    const FACTOR: u64 = 0xa076_1d64_78bd_642f;
    let fold = |a: u64, b: u64| {
        let product = u128::from(a) * u128::from(b);
        #[expect(clippy::cast_possible_truncation, reason = "both halves are used")]
        let folded = product as u64 ^ (product >> 64) as u64;
        folded
    };
    let mut state = FACTOR ^ chunk.len() as u64;
    for (number, word) in (1_u64..).zip(chunk.chunks(8)) {
        let mut bytes = [0; 8];
        bytes[..word.len()].copy_from_slice(word);
        // The number of the word keeps products of zero apart.
        state =
            fold(state ^ u64::from_le_bytes(bytes), FACTOR).wrapping_add(number.wrapping_mul(0xe703_7ed1_a0b4_28db));
    }
    fold(state, FACTOR)
}

#[cfg(test)]
mod tests {
    use canted_fixtures::or_skip;

    use super::*;
    use crate::{Choice, Traffic};

    #[test]
    fn neighboring_changes_are_one_range() {
        assert_eq!(changed(&[1, 2, 3, 4, 5], &[1, 0, 0, 4, 0]), [[1, 3], [4, 5]]);
        assert!(changed(&[7; 3], &[7; 3]).is_empty());
    }

    #[test]
    fn hashes_depend_on_every_byte_and_on_the_length() {
        let mut found: Vec<u64> = (0..=CHUNK).map(|n| hash(&vec![0; n])).collect();
        for at in 0..CHUNK {
            for bit in 0..8 {
                let mut chunk = vec![0_u8; CHUNK];
                chunk[at] = 1 << bit;
                found.push(hash(&chunk));
            }
        }
        let n = found.len();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), n);
    }

    #[test]
    fn only_changed_parts_are_uploaded() {
        let Some(gpu) = or_skip("only_changed_parts_are_uploaded", Gpu::open(&Choice::Best)) else { return };
        let uploaded = |values: &[u32]| {
            gpu.start_frame();
            let before = gpu.traffic();
            let buffer = gpu.read_only("values", values).unwrap();
            let Traffic { uploaded_bytes, .. } = gpu.traffic() - before;
            assert_eq!(gpu.read(&buffer).unwrap(), values);
            uploaded_bytes
        };
        let mut values: Vec<u32> = (0..1000).collect();
        assert_eq!(uploaded(&values), 4000);
        assert_eq!(uploaded(&values), 0);
        values[70] = 5;
        assert_eq!(uploaded(&values), 256);
        values[999] = 5;
        assert_eq!(uploaded(&values), 4000 - 15 * 256);
        values.push(1);
        assert_eq!(uploaded(&values), 4004);
        // A buffer that is still in use is not overwritten.
        gpu.start_frame();
        let first = gpu.read_only("values", &values).unwrap();
        let second = gpu.read_only("values", &[3_u32; 1001]).unwrap();
        gpu.start_frame();
        let third = gpu.read_only("values", &[4_u32; 1001]).unwrap();
        assert_eq!(gpu.read(&first).unwrap(), values);
        assert_eq!([gpu.read(&second).unwrap(), gpu.read(&third).unwrap()], [vec![3; 1001], vec![4; 1001]]);
    }
}
