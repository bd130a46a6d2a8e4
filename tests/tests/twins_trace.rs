//! Rays on the device beside those on the CPU: nothing that the CPU hits is lost, and what is hit besides lies within the bound
//! that is stated for devices.
//!
//! Not covered here: masks (`twins_render`), what is refused and what is cut short (`canted-gpu`).

mod twins_trace {
    mod instances;
    mod judge;
    mod meshes;
    mod models;
    mod moving;
    #[path = "../wide/setup.rs"]
    #[expect(dead_code, reason = "the ways to build are shared, the comparison is not")]
    mod setup;
    mod walks;

    use canted_gpu::{Choice, Gpu};

    /// The best adapter, or the sentence of a skipped test.
    #[expect(clippy::print_stderr, reason = "a skipped test says so")]
    pub(crate) fn gpu(test: &str) -> Option<Gpu> {
        match Gpu::open(&Choice::Best) {
            Ok(gpu) => Some(gpu),
            Err(error) => {
                eprintln!("skipped {test}: {error}");
                None
            }
        }
    }
}
