//! The memory that buffers take, what goes through them, and those that one frame hands to the next.

use std::collections::HashMap;
use std::ops::Sub;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{BufferDescriptor, BufferUsages};

/// Bytes in use, and their limit.
#[derive(Clone)]
pub(crate) struct Memory(Arc<Bytes>);

struct Bytes {
    taken: AtomicU64,
    most: AtomicU64,
}

/// Bytes used by a buffer until it is dropped.
pub(crate) struct Reservation {
    memory: Memory,
    n_bytes: u64,
}

impl Memory {
    /// No limit other than the driver's.
    pub(crate) fn unbounded() -> Self {
        Self(Arc::new(Bytes { taken: AtomicU64::new(0), most: AtomicU64::new(u64::MAX) }))
    }

    /// Sets the limit for new buffers.
    pub(crate) fn bound(&self, n_bytes: u64) {
        self.0.most.store(n_bytes, Ordering::Relaxed);
    }

    /// Reserves bytes; `None` if they exceed the limit.
    pub(crate) fn take(&self, n_bytes: u64) -> Option<Reservation> {
        let most = self.0.most.load(Ordering::Relaxed);
        let add = |taken: u64| taken.checked_add(n_bytes).filter(|&taken| taken <= most);
        self.0.taken.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add).ok()?;
        Some(Reservation { memory: self.clone(), n_bytes })
    }

    /// Whether more is reserved than the limit, which was lowered since.
    pub(crate) fn is_exceeded(&self) -> bool {
        self.0.taken.load(Ordering::Relaxed) > self.0.most.load(Ordering::Relaxed)
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.memory.0.taken.fetch_sub(self.n_bytes, Ordering::Relaxed);
    }
}

/// What went to a device and came back since it was opened. Differences count a part of the work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes written to buffers by the CPU.
    pub uploaded_bytes: u64,
    /// Writes of buffers by the CPU.
    pub n_uploads: u64,
    /// Dispatches.
    pub n_dispatches: u64,
    /// Bytes of buffers read by the CPU.
    pub downloaded_bytes: u64,
    /// Reads of buffers by the CPU, of which one may bring values of several.
    pub n_downloads: u64,
}

impl Sub for Traffic {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        Self {
            uploaded_bytes: self.uploaded_bytes - before.uploaded_bytes,
            n_uploads: self.n_uploads - before.n_uploads,
            n_dispatches: self.n_dispatches - before.n_dispatches,
            downloaded_bytes: self.downloaded_bytes - before.downloaded_bytes,
            n_downloads: self.n_downloads - before.n_downloads,
        }
    }
}

#[derive(Default)]
pub(crate) struct Counters {
    bytes: AtomicU64,
    uploads: AtomicU64,
    dispatches: AtomicU64,
    downloaded: AtomicU64,
    downloads: AtomicU64,
}

impl Counters {
    pub(crate) fn traffic(&self) -> Traffic {
        let Self { bytes, uploads, dispatches, downloaded, downloads } = self;
        Traffic {
            uploaded_bytes: bytes.load(Ordering::Relaxed),
            n_uploads: uploads.load(Ordering::Relaxed),
            n_dispatches: dispatches.load(Ordering::Relaxed),
            downloaded_bytes: downloaded.load(Ordering::Relaxed),
            n_downloads: downloads.load(Ordering::Relaxed),
        }
    }

    pub(crate) fn add_upload(&self, bytes: u64) {
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
        self.uploads.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn add_dispatch(&self) {
        self.dispatches.fetch_add(1, Ordering::Relaxed);
    }

    /// A piece of a download.
    pub(crate) fn add_piece(&self, bytes: u64) {
        self.downloaded.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(crate) fn add_download(&self) {
        self.downloads.fetch_add(1, Ordering::Relaxed);
    }
}

/// Least bytes of a staging buffer, and of a work buffer that is compared with what is needed, so that small ones share them.
const LEAST: u64 = 1 << 12;

/// Staging buffers that are kept: two for each of a few threads that read at once.
const KEPT: usize = 8;

/// Staging buffers that no read uses. They are kept, because a new one costs more than the copy into it.
#[derive(Default)]
pub(crate) struct Staging(Mutex<Vec<wgpu::Buffer>>);

impl Staging {
    /// A buffer of at least `size` bytes: the smallest that is free, or a new one.
    pub(crate) fn take(&self, device: &wgpu::Device, size: u64) -> wgpu::Buffer {
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
    pub(crate) fn give(&self, buffer: wgpu::Buffer) {
        let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(buffer);
        if free.len() > KEPT
            && let Some(i) = (0..free.len()).min_by_key(|&i| free[i].size())
        {
            free.swap_remove(i);
        }
    }
}

/// How many times as large as needed a work buffer may be.
const MOST_TIMES: u64 = 4;

/// Buffers whose contents serve one call, by name: those that nothing uses any more serve the next one.
#[derive(Default)]
pub(crate) struct WorkBuffers(Mutex<HashMap<String, Vec<Owned>>>);

/// A buffer and its memory.
type Owned = (wgpu::Buffer, Arc<Reservation>);

impl WorkBuffers {
    /// The smallest of at least `size` bytes, and not many times as many, that nothing uses. If there is none, those that nothing uses are freed: too
    /// small or too large ones would stay beside the new one.
    pub(crate) fn take(&self, name: &str, size: u64) -> Option<Owned> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let list = kept.get_mut(name)?;
        let is_unused = |(_, reservation): &Owned| Arc::strong_count(reservation) == 1;
        let fits = size..=MOST_TIMES * size.max(LEAST);
        let fitting = list.iter().filter(|owned| is_unused(owned) && fits.contains(&owned.0.size()));
        let found = fitting.min_by_key(|(buffer, _)| buffer.size()).cloned();
        if found.is_none() {
            list.retain(|owned| !is_unused(owned));
        }
        found
    }

    /// Keeps a buffer.
    pub(crate) fn keep(&self, name: &str, buffer: Owned) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.entry(name.to_owned()).or_default().push(buffer);
    }

    /// Frees those that nothing uses. Returns whether there were any.
    pub(crate) fn free(&self) -> bool {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut n_freed = 0;
        for list in kept.values_mut() {
            let n = list.len();
            list.retain(|(_, reservation)| Arc::strong_count(reservation) > 1);
            n_freed += n - list.len();
        }
        n_freed > 0
    }
}

/// Bytes that are compared, and uploaded, together.
pub(crate) const CHUNK: usize = 256;

/// Buffers by name, in the order in which a frame made them.
#[derive(Default)]
pub(crate) struct FrameBuffers {
    buffers: HashMap<String, Vec<FrameBuffer>>,
    /// Buffers of each name that this frame has taken.
    n_taken: HashMap<String, usize>,
}

pub(crate) struct FrameBuffer {
    pub(crate) raw: wgpu::Buffer,
    pub(crate) reservation: Arc<Reservation>,
    /// A hash of each chunk.
    pub(crate) hashes: Vec<u64>,
}

impl FrameBuffers {
    /// What the last frame did not take is not needed.
    pub(crate) fn start_frame(&mut self) {
        for (name, list) in &mut self.buffers {
            list.truncate(self.n_taken.get(name).copied().unwrap_or(0));
        }
        self.n_taken.clear();
    }

    /// The buffers of a name, and the index of the next that this frame takes.
    pub(crate) fn take(&mut self, name: &str) -> (&mut Vec<FrameBuffer>, usize) {
        let n_taken = self.n_taken.entry(name.to_owned()).or_default();
        *n_taken += 1;
        (self.buffers.entry(name.to_owned()).or_default(), *n_taken - 1)
    }
}

/// Ranges of chunks that differ.
pub(crate) fn changed(before: &[u64], after: &[u64]) -> Vec<[usize; 2]> {
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
pub(crate) fn hash(chunk: &[u8]) -> u64 {
    const FACTOR: u64 = 0xa076_1d64_78bd_642f;
    let fold = |a: u64, b: u64| {
        let product = u128::from(a) * u128::from(b);

        product as u64 ^ (product >> 64) as u64
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
    use super::*;

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
}
