//! Devices, for test programs whose tests are reported as ignored without one.

use std::process::ExitCode;

use canted_fixtures::device_tests::{self, Test};
use canted_gpu::{Choice, Gpu, Limits};

/// Runs the tests of a program.
pub fn run_tests(tests: impl IntoIterator<Item = Vec<Test>>) -> ExitCode {
    device_tests::run(Gpu::open(&Choice::Best), tests)
}

/// The best adapter.
///
/// # Panics
/// There is none.
#[must_use]
pub fn gpu() -> Gpu {
    Gpu::open(&Choice::Best).unwrap_or_else(|error| panic!("{error}"))
}

/// The best adapter with storage bindings limited to this many bytes.
///
/// # Panics
/// There is none.
#[must_use]
pub fn lowered(most: u64) -> Gpu {
    let lower = |limits| Limits { max_storage_buffer_binding_size: most, ..limits };
    Gpu::with_limits(&Choice::Best, lower).unwrap_or_else(|error| panic!("{error}"))
}
