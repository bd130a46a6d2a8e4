//! A picture by the device and the CPU together: each tile has the bits of one of them.

use canted_fixtures::device_tests::{Test, needs_device};
use std::sync::atomic::AtomicBool;

use canted_film::Film;
use canted_renderer::{DeviceError, Levels, Monitor, RenderError, Settings};

use super::scenes::full;
use super::{gpu, on_cpu, silent, small, with_picture};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(every_tile_comes_from_one_of_both),
        needs_device(the_cpu_finishes_after_a_lost_device),
        needs_device(cancelled_work_keeps_reported_tiles),
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
    let monitor = Monitor { progress: &|_, _| (), finished: &finished, cancel: &cancel };
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
