//! Stages of the renderer on the device compared with those on the CPU.

mod components;
mod curves;
mod frames;
mod patches;
mod paths;
mod raster;
mod scenes;
mod streams;
mod sums;

pub(crate) use canted_tests::device::gpu;

fn main() -> std::process::ExitCode {
    canted_tests::device::run_tests([
        components::tests(),
        curves::tests(),
        frames::tests(),
        patches::tests(),
        paths::tests(),
        raster::tests(),
        streams::tests(),
        sums::tests(),
    ])
}
