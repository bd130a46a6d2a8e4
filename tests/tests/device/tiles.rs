//! The tile size only distributes work: the device renders the same bits for any size.

use canted_fixtures::device_tests::{Test, needs_device};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use canted_film::{Aov, Film, Pixel};
use canted_gpu::Gpu;
use canted_renderer::{DevicePicture, Integrator, Monitor, SceneBvh, SceneBvhConfig, Settings, Surfaces};
use canted_scene::Scene;

use super::scenes::full;
use super::{camera, gpu, small};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(tiles_do_not_change_a_bit_of_a_devices_picture),
        needs_device(tiles_do_not_change_a_bit_of_guides_and_parts),
        needs_device(tiles_do_not_change_where_samples_stop),
    ]
}

/// A size that is no multiple of tiles or cells, so that those of the last column and row are cut.
fn odd(integrator: Integrator) -> Settings {
    Settings { width: 27, height: 19, samples: 2, integrator, ..small() }
}

/// The device's picture, and its number of tiles.
fn picture(gpu: &Gpu, scene: &Scene, settings: &Settings) -> (Film, usize) {
    let bvh = SceneBvh::build(scene, &SceneBvhConfig::default()).unwrap();
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let picture = DevicePicture::new(gpu, &surfaces, &bvh, &camera(), settings).unwrap();
    let (n_tiles, cancel) = (AtomicUsize::new(0), AtomicBool::new(false));
    let progress = |_, all| n_tiles.store(all, Ordering::Relaxed);
    let monitor = Monitor { progress: &progress, finished: &|_| (), cancel: &cancel };
    let film = picture.render(vec![], &monitor).unwrap();
    (film, n_tiles.into_inner())
}

/// Tiles of 8 pixels and larger ones give the same picture; the number of tiles proves that they differ.
#[track_caller]
fn check(gpu: &Gpu, settings: &Settings) {
    let scene = full();
    let of_side = |tile| picture(gpu, &scene, &Settings { tile, ..*settings });
    let (reference, n_tiles) = of_side(8);
    assert_eq!(n_tiles, 4 * 3);
    for (tile, n_expected) in [(16, 2 * 2), (32, 1)] {
        let (film, n_tiles) = of_side(tile);
        assert_eq!(n_tiles, n_expected);
        assert!(film == reference, "{settings:?}: tiles of {tile} change the picture");
    }
    let (other, _) = picture(gpu, &scene, &Settings { seed: settings.seed + 1, ..*settings });
    assert!(other != reference, "the comparison cannot fail");
}

fn tiles_do_not_change_a_bit_of_a_devices_picture() {
    let gpu = gpu();
    for integrator in [Integrator::Hybrid, Integrator::Path] {
        check(&gpu, &odd(integrator));
    }
}

/// A separate kernel computes what camera rays hit, and partial samples keep block sums.
fn tiles_do_not_change_a_bit_of_guides_and_parts() {
    let gpu = gpu();
    let aovs = Aov::ALL.into_iter().collect();
    check(&gpu, &Settings { aovs, part: Some([1, 6]), samples: 8, ..odd(Integrator::Hybrid) });
}

/// Cells of 8 pixels stop together, independent of tile borders.
fn tiles_do_not_change_where_samples_stop() {
    let gpu = gpu();
    let settings = Settings { noise: Some(0.02), samples: 64, ..odd(Integrator::Hybrid) };
    check(&gpu, &settings);
    let (film, _) = picture(&gpu, &full(), &settings);
    let mut taken: Vec<u32> = film.pixels().iter().map(Pixel::n_taken).collect();
    taken.sort_unstable();
    taken.dedup();
    assert!(taken.len() > 1, "all pixels take {taken:?} samples");
}
