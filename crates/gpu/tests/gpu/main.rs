//! Tests of the device, of construction and of ray tracing. Ignored without an adapter.

mod buffers;
mod build;
mod device;
mod instanced;
mod kernels;
mod module;
mod placed;
mod trace;

use std::process::ExitCode;

use canted_fixtures::device_tests;
use canted_gpu::{Choice, Gpu, Limits, TracedScene, block_on, wgpu};

fn main() -> ExitCode {
    let tests = [
        buffers::tests(),
        build::tests(),
        device::tests(),
        instanced::tests(),
        kernels::tests(),
        module::tests(),
        placed::tests(),
        trace::tests(),
    ];
    device_tests::run(block_on(Gpu::open(&Choice::Best)), tests)
}

/// The best adapter.
pub(crate) fn gpu() -> Gpu {
    block_on(Gpu::open(&Choice::Best)).unwrap()
}

/// The best adapter, with this maximum size of storage bindings.
pub(crate) fn lowered(most: u64) -> Gpu {
    let lower = |limits| Limits { max_storage_buffer_binding_size: most, ..limits };
    block_on(Gpu::with_limits(&Choice::Best, lower)).unwrap()
}

/// The words of a buffer of a scene, read back; `None` if the scene has no such variable.
pub(crate) fn words(gpu: &Gpu, scene: &TracedScene, variable: &str) -> Option<Vec<u32>> {
    let wgpu::BufferBinding { buffer, offset, size } = scene.buffer(variable)?;
    let size = size.unwrap().get();
    let copy = gpu.zeroed::<u32>("a copy", usize::try_from(size / 4).unwrap()).unwrap();
    let mut encoder = gpu.encoder();
    encoder.copy_buffer_to_buffer(buffer, offset, copy.wgpu(), 0, size);
    gpu.submit(encoder).unwrap();
    Some(block_on(gpu.read(&copy)).unwrap())
}
