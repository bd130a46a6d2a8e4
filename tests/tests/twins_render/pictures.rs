//! Whole pictures: the same samples on both devices.
//!
//! A device's roundings move a path a little; where that takes it over an edge it meets something else, and the sample is
//! another. So most pixels agree to roundings and some not at all: their share is bounded, and so is the difference of the
//! means, for what goes astray favours no side.

use std::sync::atomic::AtomicBool;

use canted_gpu::Gpu;
use canted_renderer::{
    DevicePicture, Film, Levels, Monitor, Prepared, Settings, StructureConfig, Surfaces, frame, prepare, render,
};
use canted_scene::{Camera, Scene};
use canted_trace::Watertight;

use super::gpu;
use super::scenes;

/// Relative difference of a pixel, above a floor of a twentieth of white, up to which only roundings differ: ten bounces of 30
/// roundings of 2⁻²³ each are `2⁻¹⁵`; lookups of textures with f32 coordinates may have eight times that.
const ROUNDING: f64 = 1.0 / 4096.0;

/// What pictures that should be equal differ in.
#[derive(Debug)]
struct Difference {
    /// Share of pixels that differ by more than [`ROUNDING`].
    astray: f64,
    /// Of the means, relative.
    of_means: f64,
}

fn prepared(scene: &Scene, levels: Levels) -> Prepared<Watertight> {
    prepare(scene, &StructureConfig { levels, ..StructureConfig::default() }).unwrap()
}

fn on_device(gpu: &Gpu, scene: &Scene, prepared: &Prepared<Watertight>, camera: &Camera, settings: &Settings) -> Film {
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let picture = DevicePicture::new(gpu, &surfaces, &prepared.structure, camera, settings).unwrap();
    let monitor = Monitor { progress: &|_, _| (), finished: &|_| (), cancel: &AtomicBool::new(false) };
    picture.render(vec![], &monitor).unwrap()
}

fn difference(ours: &Film, theirs: &Film) -> Difference {
    let mut n_astray = 0.0;
    let mut sums = [0.0; 2];
    for (a, b) in ours.pixels().iter().zip(theirs.pixels()) {
        assert_eq!(a.n_taken(), b.n_taken());
        let (a, b) = (a.mean(), b.mean());
        let is_astray = (0..3).any(|k| (a[k] - b[k]).abs() > ROUNDING * (b[k].abs() + 0.05));
        n_astray += f64::from(u8::from(is_astray));
        sums[0] += a.iter().sum::<f64>();
        sums[1] += b.iter().sum::<f64>();
    }
    #[expect(clippy::cast_precision_loss, reason = "few pixels")]
    let n = theirs.pixels().len() as f64;
    Difference { astray: n_astray / n, of_means: (sums[0] / sums[1] - 1.0).abs() }
}

/// Both pictures of a scene, compared.
fn compared(gpu: &Gpu, scene: &Scene, camera: &Camera, levels: Levels, settings: &Settings) -> Difference {
    let prepared = prepared(scene, levels);
    let ours = on_device(gpu, scene, &prepared, camera, settings);
    let theirs = render(scene, &prepared.structure, camera, settings, &|_, _| (), &AtomicBool::new(false)).unwrap();
    difference(&ours, &theirs)
}

/// Most pixels that may go astray, and how far the means may be apart.
#[track_caller]
fn check(name: &str, found: &Difference, [astray, of_means]: [f64; 2]) {
    println!("{name}: {found:?}");
    assert!(found.astray <= astray && found.of_means <= of_means, "{name}: {found:?}");
}

fn small(samples: u32) -> Settings {
    Settings { width: 64, height: 36, samples, ..Settings::default() }
}

#[test]
fn the_built_in_scene() {
    let Some(gpu) = gpu("the_built_in_scene") else { return };
    let scene = canted_scene::builtin();
    let camera = frame_of(&scene);
    check("built-in", &compared(&gpu, &scene, &camera, Levels::Auto, &small(4)), [0.2, 0.005]);
}

fn frame_of(scene: &Scene) -> Camera {
    let prepared = prepared(scene, Levels::Auto);
    scene.cameras.first().copied().unwrap_or_else(|| frame(scene, &prepared.structure, 64.0 / 36.0))
}

#[test]
fn a_room_with_all_kinds_of_light() {
    let Some(gpu) = gpu("a_room_with_all_kinds_of_light") else { return };
    let (scene, camera) = scenes::room();
    for levels in [Levels::One, Levels::Two] {
        check("room", &compared(&gpu, &scene, &camera, levels, &small(4)), [0.1, 0.005]);
    }
}

#[test]
fn the_comparison_sees_another_light() {
    let Some(gpu) = gpu("the_comparison_sees_another_light") else { return };
    let (scene, camera) = scenes::room();
    let prepared = prepared(&scene, Levels::One);
    let ours = on_device(&gpu, &scene, &prepared, &camera, &small(2));
    let mut brighter = scene.clone();
    brighter.materials[0].base_color[1] += 0.01;
    let settings = small(2);
    let theirs =
        render(&brighter, &prepared.structure, &camera, &settings, &|_, _| (), &AtomicBool::new(false)).unwrap();
    let found = difference(&ours, &theirs);
    assert!(found.astray > 0.5 && found.of_means > 0.001, "{found:?}");
}
