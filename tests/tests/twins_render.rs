//! The renderer's stations on the device beside those on the CPU.

mod twins_render {
    mod compared;
    mod guides;
    mod models;
    mod paths;
    mod pictures;
    mod raster;
    mod sampler;
    mod scenes;

    pub(crate) use canted_tests::device::gpu;
}
