//! Stages of the renderer on the device compared with those on the CPU.

mod twins_render {
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
}
