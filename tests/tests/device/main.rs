//! Pictures on a device: required resources, sharing with the CPU, and failures.

mod both;
mod failures;
mod needs;
mod scenes;
mod tiles;

use canted_film::Film;
use canted_gpu::Gpu;
use canted_renderer::{
    DeviceError, DevicePicture, Levels, Monitor, SceneBvh, SceneBvhConfig, Settings, Surfaces, render,
};
use canted_scene::{Camera, Scene};
pub(crate) use canted_tests::device::gpu;
use std::sync::atomic::AtomicBool;

pub(crate) fn small() -> Settings {
    Settings { width: 40, height: 30, samples: 4, tile: 8, ..Settings::default() }
}

/// A view from the front, slightly above.
pub(crate) fn camera() -> Camera {
    Camera::pinhole([0.2, 0.7, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0)
}

/// Calls `ask` with a device picture of the scene.
pub(crate) fn with_picture<R>(
    gpu: &Gpu,
    scene: &Scene,
    levels: Levels,
    settings: &Settings,
    ask: impl FnOnce(&DevicePicture<'_>) -> R,
) -> Result<R, DeviceError> {
    let config = SceneBvhConfig { levels, ..SceneBvhConfig::default() };
    let bvh = SceneBvh::build(scene, &config).unwrap();
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    Ok(ask(&DevicePicture::new(gpu, &surfaces, &bvh, &camera(), settings)?))
}

/// The CPU's picture.
pub(crate) fn on_cpu(scene: &Scene, settings: &Settings) -> Film {
    let bvh = SceneBvh::build(scene, &SceneBvhConfig::default()).unwrap();
    render(scene, &bvh, &camera(), settings, &|_, _| (), &AtomicBool::new(false)).unwrap()
}

/// A monitor that ignores reports.
pub(crate) fn silent(cancel: &AtomicBool) -> Monitor<'_> {
    Monitor { progress: &|_, _| (), finished: &|_| (), cancel }
}

fn main() -> std::process::ExitCode {
    canted_tests::device::run_tests([both::tests(), failures::tests(), needs::tests(), tiles::tests()])
}
