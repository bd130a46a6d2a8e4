//! Counters of what goes to a device and comes back.

use std::ops::Sub;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::Gpu;

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
}

impl Sub for Traffic {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        Self {
            uploaded_bytes: self.uploaded_bytes - before.uploaded_bytes,
            n_uploads: self.n_uploads - before.n_uploads,
            n_dispatches: self.n_dispatches - before.n_dispatches,
            downloaded_bytes: self.downloaded_bytes - before.downloaded_bytes,
        }
    }
}

#[derive(Default)]
pub(crate) struct Counters {
    bytes: AtomicU64,
    uploads: AtomicU64,
    dispatches: AtomicU64,
    downloaded: AtomicU64,
}

impl Counters {
    pub(crate) fn add_dispatch(&self) {
        self.dispatches.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn add_download(&self, bytes: u64) {
        self.downloaded.fetch_add(bytes, Ordering::Relaxed);
    }
}

impl Gpu {
    /// What went to the device so far.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        let Counters { bytes, uploads, dispatches, downloaded } = &self.counters;
        Traffic {
            uploaded_bytes: bytes.load(Ordering::Relaxed),
            n_uploads: uploads.load(Ordering::Relaxed),
            n_dispatches: dispatches.load(Ordering::Relaxed),
            downloaded_bytes: downloaded.load(Ordering::Relaxed),
        }
    }

    /// Writes bytes to a buffer, before the next submission.
    pub(crate) fn upload(&self, buffer: &wgpu::Buffer, at: u64, bytes: &[u8]) {
        self.queue.write_buffer(buffer, at, bytes);
        self.counters.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        self.counters.uploads.fetch_add(1, Ordering::Relaxed);
    }
}
