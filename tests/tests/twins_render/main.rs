//! Stages of the renderer on the device compared with those on the CPU.

mod compared;
mod frames;
mod guides;
mod models;
mod paths;
mod pictures;
mod raster;
mod sampler;
mod scenes;
mod sums;

pub(crate) use canted_tests::device::gpu;

fn main() -> std::process::ExitCode {
    canted_tests::device::run_tests([
        frames::tests(),
        guides::tests(),
        models::tests(),
        paths::tests(),
        pictures::tests(),
        raster::tests(),
        sampler::tests(),
        sums::tests(),
    ])
}
