//! Samples that the device sums compared with the same samples summed by the host.
//!
//! Not covered: samples that are not finite, which kernels do not make.

use std::sync::atomic::AtomicBool;

use bytemuck::{Pod, Zeroable};
use canted_film::{Aov, Film, Filter, Part, Pixel};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{Gpu, TracedScene, Variant, block_on, choice, wgsl};
use canted_renderer::{
    DevicePicture, Integrator, Levels, Monitor, Pattern, SampleSums, Sampler, SceneBvh, Settings, Surfaces,
    traced_scene,
};
use canted_scene::{Camera, Environment, Scene};

use crate::{
    gpu,
    scenes::{self, difference, on_cpu, on_device, scene_bvh},
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(sums_of_the_device_are_those_of_the_host),
        needs_device(a_missing_sample_is_detected),
        needs_device(parts_join),
        needs_device(noise_and_channels_are_those_of_the_host),
        needs_device(the_cpu_takes_unfinished_samples),
        needs_device(random_numbers_have_the_same_bits),
    ]
}

/// Relative rounding error of `n` operations in `f32` that round in any direction (Higham 2002, section 3.1).
fn gamma(n: f64) -> f64 {
    let u = f64::from(f32::EPSILON);
    n * u / (1.0 - n * u)
}

/// Additions on the way of each of 64 samples, which bound the error of a sum relative to the sum of absolute values.
const SUM: f64 = 6.0;

/// Roundings of a sum of squares, relative to it. Each of six merges takes means, which have at most 12 roundings, and whose squared difference is
/// at most four times the squares below it: `6 * 4 * 12`. The film adds the square of the mean, which has as many.
const SQUARES: f64 = 300.0;

fn settings(integrator: Integrator, samples: u32) -> Settings {
    Settings { width: 21, height: 13, samples, integrator, bounces: 2, ..Settings::default() }
}

pub(super) fn monitored<T>(then: impl FnOnce(&Monitor) -> T) -> T {
    then(&Monitor::quiet(&AtomicBool::new(false)))
}

/// Pixels whose sums differ by more than the roundings of the device's sums.
fn n_apart(ours: &Film, theirs: &Film) -> usize {
    assert_eq!((ours.pixels().len(), ours.width()), (theirs.pixels().len(), theirs.width()));
    let is_apart = |a: &Pixel, b: &Pixel| {
        (0..3).any(|k| {
            // At least the sum of absolute values (Cauchy-Schwarz); radiance itself is not negative.
            let absolute = match b.n_negative {
                0 => b.sum[k],
                _ => (f64::from(b.n_samples) * b.sum_of_squares[k]).sqrt(),
            };
            let squares = (a.sum_of_squares[k] - b.sum_of_squares[k]).abs();
            (a.sum[k] - b.sum[k]).abs() > gamma(SUM) * absolute || squares > gamma(SQUARES) * b.sum_of_squares[k]
        })
    };
    ours.pixels().iter().zip(theirs.pixels()).filter(|(a, b)| is_apart(a, b)).count()
}

/// Numbers of samples of each pixel: summed, negative, dropped.
fn counts(film: &Film) -> Vec<[u32; 3]> {
    film.pixels().iter().map(|pixel| [pixel.n_samples, pixel.n_negative, pixel.n_dropped]).collect()
}

/// Whether two films are the same but for the roundings of the device's sums.
#[track_caller]
fn check(ours: &Film, theirs: &Film, name: &str) {
    assert_eq!(counts(ours), counts(theirs), "{name}");
    assert_eq!(ours.n_rays(), theirs.n_rays(), "{name}");
    assert_eq!(n_apart(ours, theirs), 0, "{name}");
}

fn sums_of_the_device_are_those_of_the_host() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    for integrator in [Integrator::Hybrid, Integrator::Path] {
        for (samples, filter) in [1, 3, 64, 100].map(|n| (n, Filter::BOX)).into_iter().chain([(37, Filter::MITCHELL)]) {
            let host = Settings { filter, ..settings(integrator, samples) };
            let theirs = on_device(&gpu, &scene, &bvh, &camera, &host);
            let device = Settings { sums: SampleSums::Device, ..host };
            let ours = on_device(&gpu, &scene, &bvh, &camera, &device);
            let name = format!("{integrator:?}, {samples} samples, {filter}");
            check(&ours, &theirs, &name);
            assert_eq!(ours == theirs, samples == 1, "{name}: only single samples are not summed");
            assert_eq!(theirs.pixels().iter().any(|pixel| pixel.n_negative > 0), filter == Filter::MITCHELL);
            if samples == 64 {
                // Cells end between tiles of another size, and dispatches between cells.
                for tile in [8, 16] {
                    let film = on_device(&gpu, &scene, &bvh, &camera, &Settings { tile, ..device });
                    assert!(film == ours, "{name}, tiles of {tile}");
                }
            }
        }
    }
}

fn a_missing_sample_is_detected() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    for integrator in [Integrator::Hybrid, Integrator::Path] {
        let host = settings(integrator, 64);
        let theirs = on_device(&gpu, &scene, &bvh, &camera, &host);
        let without_last = Settings { part: Some([0, 63]), sums: SampleSums::Device, ..host };
        let ours = on_device(&gpu, &scene, &bvh, &camera, &without_last);
        let n = n_apart(&ours, &theirs);
        assert!(2 * n > theirs.pixels().len(), "{integrator:?}: {n} of {}", theirs.pixels().len());
    }
}

/// Parts that start at multiples of 64 join to the bits of the whole, others but for rounding.
fn parts_join() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    let device = Settings { sums: SampleSums::Device, ..settings(Integrator::Hybrid, 100) };
    let whole = on_device(&gpu, &scene, &bvh, &camera, &device);
    let joined = |at: u32| {
        let parts = [[0, at], [at, 100]].map(|range| {
            let film = on_device(&gpu, &scene, &bvh, &camera, &Settings { part: Some(range), ..device });
            (film.part().unwrap().clone(), film.n_rays())
        });
        let n_rays = parts.iter().map(|(_, n)| n).sum();
        let part = Part::join(parts.map(|(part, _)| part).to_vec()).unwrap();
        Film::of_part(device.width, device.height, part, n_rays).without_part()
    };
    assert!(joined(64) == whole);
    let other = joined(37);
    check(&other, &whole, "parts of 37 and 63 samples");
    assert!(other != whole);
}

fn noise_and_channels_are_those_of_the_host() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    let host =
        Settings { noise: Some(0.05), aovs: Aov::ALL.into_iter().collect(), ..settings(Integrator::Hybrid, 128) };
    let theirs = on_device(&gpu, &scene, &bvh, &camera, &host);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &Settings { sums: SampleSums::Device, ..host });
    check(&ours, &theirs, "noise");
    assert!(counts(&theirs).iter().any(|[n, ..]| *n == 128) && counts(&theirs).iter().any(|[n, ..]| *n < 128));
    assert!(ours.guides() == theirs.guides());
}

/// A film with sums of the device over BVHs that `make` changes.
pub(super) fn summed(
    gpu: &Gpu,
    (scene, camera): (&Scene, &Camera),
    bvh: &SceneBvh,
    settings: &Settings,
    make: impl FnOnce(TracedScene) -> TracedScene,
) -> Film {
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let of = |scene: &Scene| Ok(make(traced_scene(gpu, scene, bvh)?));
    let picture = DevicePicture::over(gpu, &surfaces, bvh, camera, settings, of).unwrap();
    monitored(|monitor| picture.render(vec![], monitor)).unwrap()
}

/// The CPU takes the samples that the device does not finish, and those too large for squares in `f32`.
fn the_cpu_takes_unfinished_samples() {
    let gpu = gpu();
    let (mut scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    let device = Settings {
        sums: SampleSums::Device,
        aovs: [Aov::Depth].into_iter().collect(),
        ..settings(Integrator::Path, 6)
    };
    let theirs = on_cpu(&scene, &bvh, &camera, &device);
    // No ray is finished: each sample is the CPU's.
    let none = summed(&gpu, (&scene, &camera), &bvh, &device, |traced| traced.with_max_iterations(0));
    assert!(none == theirs);
    // Some are.
    let host = Settings { sums: SampleSums::Host, ..device };
    let few =
        |settings: &Settings| summed(&gpu, (&scene, &camera), &bvh, settings, |traced| traced.with_max_iterations(30));
    let (ours, some) = (few(&device), few(&host));
    check(&ours, &some, "some samples");
    assert!(ours.guides() == some.guides());
    assert!(some != theirs && some != on_device(&gpu, &scene, &bvh, &camera, &host));
    // Brighter than 2^56. The others are summed on the device.
    scene.environment = Some(Environment::Constant([1e20; 3]));
    scene.lights.clear();
    let bright = settings(Integrator::Hybrid, 6);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &Settings { sums: SampleSums::Device, ..bright });
    let theirs = on_cpu(&scene, &bvh, &camera, &bright);
    assert_eq!(counts(&ours), counts(&theirs));
    let n_equal = ours.pixels().iter().zip(theirs.pixels()).filter(|(a, b)| a == b && a.sum[0] > 1e18).count();
    assert!(2 * n_equal > theirs.pixels().len(), "{n_equal} of {}", theirs.pixels().len());
    // Where rounding sends a path elsewhere, a dark sample of the device may be a bright one of the CPU, but not the other way round.
    let found = difference(&ours, &theirs);
    assert!(found.astray < 0.2 && found.of_means < 0.005, "{found:?}");
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Ask {
    pixel: u32,
    sample: u32,
    dimension: u32,
    seed: u32,
    columns: u32,
    rows: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
struct Answer {
    pair: [f32; 2],
    single: f32,
    bits: u32,
}

fn of_device(gpu: &Gpu, pattern: choice::Pattern, asks: &[Ask]) -> Vec<Answer> {
    let part = Variant::none().with(pattern);
    let kernel = gpu.kernel(wgsl::check::SAMPLER, &part).unwrap();
    let asked = gpu.buffer("queries", asks).unwrap();
    let answers = gpu.zeroed::<Answer>("answers", asks.len()).unwrap();
    let mut commands = gpu.commands();
    let groups = kernel.groups(u32::try_from(asks.len()).unwrap());
    commands.dispatch(&kernel, &[("queries", &asked), ("answers", &answers)], groups).unwrap();
    block_on(commands.run()).unwrap();
    block_on(gpu.read(&answers)).unwrap()
}

/// A hash unrelated to the sampler's.
fn scattered(i: u32, salt: u32) -> u32 {
    (i ^ salt.wrapping_mul(0x9e37_79b1)).wrapping_mul(0x85eb_ca6b).rotate_left(13).wrapping_mul(0xc2b2_ae35)
}

fn random_numbers_have_the_same_bits() {
    let gpu = gpu();
    let counts = [1, 2, 3, 7, 16, 24, 97, 256, 1000, 4096, 65_535, 1 << 20];
    for (twin, pattern) in [
        (choice::Pattern::Random, Pattern::Random),
        (choice::Pattern::Stratified, Pattern::Stratified),
        (choice::Pattern::Sobol, Pattern::Sobol),
    ] {
        let mut asks = vec![];
        let mut answers = vec![];
        for n in counts {
            for i in 0..200 {
                let [pixel, dimension, seed] = [1, 2, 3].map(|salt| scattered(i, salt) >> (i % 32));
                // Beyond the sample count, too.
                let sample = scattered(i, 4) % (n + n / 2 + 1);
                let sampler = Sampler::new(pattern, n, seed);
                answers.push(Answer {
                    pair: sampler.pair(pixel, sample, dimension),
                    single: sampler.single(pixel, sample, dimension),
                    bits: sampler.bits(pixel, sample, dimension),
                });
                let [columns, rows] = sampler.grid();
                asks.push(Ask { pixel, sample, dimension, seed, columns, rows });
            }
        }
        let found = of_device(&gpu, twin, &asks);
        for (i, (found, expected)) in found.iter().zip(&answers).enumerate() {
            assert_eq!(found, expected, "{twin:?}, ask {i}");
        }
        // The check detects a single bit.
        asks[17].seed ^= 1 << 31;
        assert_ne!(of_device(&gpu, twin, &asks[17..18])[0], answers[17]);
    }
}
