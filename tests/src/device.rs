//! Devices, which are optional: without one a test is skipped with a message.

use canted_fixtures::or_skip;
use canted_gpu::{Choice, Gpu, Limits};

/// The best adapter.
#[must_use]
pub fn gpu(test: &str) -> Option<Gpu> {
    or_skip(test, Gpu::open(&Choice::Best))
}

/// The best adapter with storage bindings limited to this many bytes.
#[must_use]
pub fn lowered(test: &str, most: u64) -> Option<Gpu> {
    let lower = |limits| Limits { max_storage_buffer_binding_size: most, ..limits };
    or_skip(test, Gpu::with_limits(&Choice::Best, lower))
}
