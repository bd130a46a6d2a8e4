//! Rays on the device compared with the CPU: no CPU hit is lost, and other hits lie within the bound stated for devices.
//!
//! Not covered here: masks (`twins_render`), rejections other than for depth, and traversals ended early (`canted-gpu`).

mod twins_trace {
    mod binary;
    mod built_wide;
    mod deep;
    mod frames;
    mod instances;
    mod meshes;
    mod models;
    mod moving;
    mod placed;
    mod small;
    mod traversals;

    pub(crate) use canted_tests::{device::gpu, judge as reference, variants as setup};
}
