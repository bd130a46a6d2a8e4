//! Rays on the device beside those on the CPU: nothing that the CPU hits is lost, and what is hit besides lies within the bound
//! that is stated for devices.
//!
//! Not covered here: masks (`twins_render`), what is refused but for its depth and what is cut short (`canted-gpu`).

mod twins_trace {
    mod deep;
    mod instances;
    mod judge;
    mod meshes;
    mod models;
    mod moving;
    #[path = "../wide/setup.rs"]
    #[expect(dead_code, reason = "the ways to build are shared, the comparison is not")]
    mod setup;
    mod walks;

    pub(crate) use canted_tests::device::gpu;
}
