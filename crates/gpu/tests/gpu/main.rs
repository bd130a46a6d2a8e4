//! Tests of the device, of construction and of ray tracing. Ignored without an adapter.

mod again;
mod buffers;
mod build;
mod common;
mod device;
mod instanced;
mod kernels;
mod placed;
mod trace;

use std::process::ExitCode;

use canted_fixtures::device_tests;
use canted_gpu::{Choice, Gpu};

fn main() -> ExitCode {
    let tests = [
        again::tests(),
        buffers::tests(),
        build::tests(),
        device::tests(),
        instanced::tests(),
        kernels::tests(),
        placed::tests(),
        trace::tests(),
    ];
    device_tests::run(Gpu::open(&Choice::Best), tests)
}
