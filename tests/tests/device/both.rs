//! A picture by the device and the CPU together: each tile has the bits of one of them.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use canted_film::{Aov, Film, Pixel};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::Gpu;
use canted_renderer::{
    DeviceError, DevicePicture, Integrator, Levels, Monitor, RenderError, SceneBvh, SceneBvhConfig, Settings, Surfaces,
};
use canted_scene::Scene;

use crate::{camera, full, gpu, on_cpu, silent, small, with_picture};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(every_tile_comes_from_one_of_both),
        needs_device(the_cpu_finishes_after_a_lost_device),
        needs_device(cancelled_work_keeps_reported_tiles),
        needs_device(tiles_do_not_change_a_bit_of_a_devices_picture),
        needs_device(tiles_do_not_change_a_bit_of_guides_and_parts),
        needs_device(tiles_do_not_change_where_samples_stop),
    ]
}

/// The pixels of each tile.
fn tiles(film: &Film, settings: &Settings) -> Vec<Vec<[f64; 3]>> {
    let side = settings.tile as usize;
    let [width, height] = [settings.width, settings.height].map(|n| n as usize);
    let mut tiles = vec![vec![]; width.div_ceil(side) * height.div_ceil(side)];
    for (i, pixel) in film.pixels().iter().enumerate() {
        tiles[i / width / side * width.div_ceil(side) + i % width / side].push(pixel.mean());
    }
    tiles
}

fn every_tile_comes_from_one_of_both() {
    let gpu = gpu();
    let (scene, settings) = (full(), Settings { samples: 16, ..small() });
    let cancel = AtomicBool::new(false);
    let theirs = tiles(&on_cpu(&scene, &settings), &settings);
    let (ours, shared) = with_picture(&gpu, &scene, Levels::Auto, &settings, |picture| {
        let ours = picture.render(vec![], &silent(&cancel)).unwrap();
        (ours, picture.render_with_cpu(vec![], &silent(&cancel)).unwrap())
    })
    .unwrap();
    let ours = tiles(&ours, &settings);
    assert!(ours.iter().zip(&theirs).any(|(a, b)| a != b), "the pictures are equal, so the test proves nothing");
    assert!(shared.stopped.is_none());
    let of_one = |tile: usize, pixels: &Vec<[f64; 3]>| *pixels == ours[tile] || *pixels == theirs[tile];
    for (tile, pixels) in tiles(&shared.film, &settings).iter().enumerate() {
        assert!(of_one(tile, pixels), "tile {tile} matches neither");
    }
    assert!(shared.n_tiles_of_device <= theirs.len());
}

fn the_cpu_finishes_after_a_lost_device() {
    let gpu = gpu();
    let (scene, settings) = (full(), small());
    let cancel = AtomicBool::new(false);
    let shared = with_picture(&gpu, &scene, Levels::Auto, &settings, |picture| {
        gpu.lose();
        picture.render_with_cpu(vec![], &silent(&cancel)).unwrap()
    })
    .unwrap();
    assert_eq!(shared.n_tiles_of_device, 0);
    assert!(shared.stopped.unwrap().to_string().contains("lost"));
    assert!(shared.film.pixels() == on_cpu(&scene, &settings).pixels(), "differs from the CPU's picture");
}

fn cancelled_work_keeps_reported_tiles() {
    let gpu = gpu();
    let (scene, settings) = (full(), small());
    let cancel = AtomicBool::new(false);
    let reported = std::sync::Mutex::new(vec![]);
    let finished = |tile: &canted_film::Tile| {
        reported.lock().unwrap().push(tile.clone());
        cancel.store(true, std::sync::atomic::Ordering::Relaxed);
    };
    let monitor = Monitor { finished: &finished, ..Monitor::quiet(&cancel) };
    with_picture(&gpu, &scene, Levels::Auto, &settings, |picture| {
        let ended = picture.render_with_cpu(vec![], &monitor).map(|shared| shared.n_tiles_of_device);
        assert_eq!(ended, Err(DeviceError::Render(RenderError::Cancelled)));
        let done = std::mem::take(&mut *reported.lock().unwrap());
        assert!(!done.is_empty());
        cancel.store(false, std::sync::atomic::Ordering::Relaxed);
        let n_done = done.len();
        let again = AtomicBool::new(false);
        let shared = picture.render_with_cpu(done, &silent(&again)).unwrap();
        assert!(shared.n_tiles_of_device + n_done <= 20);
        assert!(shared.film.pixels().iter().all(|pixel| pixel.n_taken() == settings.samples));
    })
    .unwrap();
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
    let monitor = Monitor { progress: &progress, ..Monitor::quiet(&cancel) };
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
