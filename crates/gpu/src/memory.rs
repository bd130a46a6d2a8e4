//! Accounting of the device memory used by buffers.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

/// Bytes in use, and their limit.
#[derive(Clone)]
pub(crate) struct Memory(Arc<Bytes>);

struct Bytes {
    taken: AtomicU64,
    most: AtomicU64,
}

/// Bytes used by a buffer until it is dropped.
pub(crate) struct Share {
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
    pub(crate) fn take(&self, n_bytes: u64) -> Option<Share> {
        let most = self.0.most.load(Ordering::Relaxed);
        let add = |taken: u64| taken.checked_add(n_bytes).filter(|&taken| taken <= most);
        self.0.taken.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add).ok()?;
        Some(Share { memory: self.clone(), n_bytes })
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        self.memory.0.taken.fetch_sub(self.n_bytes, Ordering::Relaxed);
    }
}
