//! Rays on the device compared with the CPU: no CPU hit is lost, and other hits lie within the bound stated for devices.
//!
//! Not covered here: masks (`twins_render`), rejections other than for depth, and traversals ended early (`canted-gpu`).

mod certain;
mod curves;
mod deep;
mod download;
mod driver;
mod frames;
mod moving;
mod patches;
mod segments;
mod small;
mod triangles;

pub(crate) use canted_tests::{
    device::{self as reference, gpu},
    variants as setup,
};

fn main() -> std::process::ExitCode {
    canted_tests::device::run_tests([
        certain::tests(),
        curves::tests(),
        deep::tests(),
        download::tests(),
        driver::tests(),
        frames::tests(),
        moving::tests(),
        patches::tests(),
        segments::tests(),
        small::tests(),
        triangles::tests(),
    ])
}
