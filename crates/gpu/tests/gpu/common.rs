//! Devices for tests; reports a skipped test if there is none.

use canted_fixtures::or_skip;
use canted_gpu::{Choice, Gpu, Limits};

/// The best adapter.
pub(crate) fn gpu(test: &str) -> Option<Gpu> {
    or_skip(test, Gpu::open(&Choice::Best))
}

/// The best adapter, with this maximum size of storage bindings.
pub(crate) fn lowered(test: &str, most: u64) -> Option<Gpu> {
    let lower = |limits| Limits { max_storage_buffer_binding_size: most, ..limits };
    or_skip(test, Gpu::with_limits(&Choice::Best, lower))
}
