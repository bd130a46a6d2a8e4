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

    use canted_gpu::{Choice, Gpu};

    /// The best adapter, or the sentence of a skipped test.
    #[expect(clippy::print_stderr, reason = "a skipped test says so")]
    pub(crate) fn gpu(test: &str) -> Option<Gpu> {
        match Gpu::open(&Choice::Best) {
            Ok(gpu) => Some(gpu),
            Err(error) => {
                eprintln!("skipped: {test}: {error}");
                None
            }
        }
    }
}
