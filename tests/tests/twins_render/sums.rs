//! Samples that the device sums compared with the same samples summed by the host.

use std::ops::Add;
use std::sync::atomic::AtomicBool;

use bytemuck::{Pod, Zeroable};
use canted_film::{Aov, Aovs, Components, Dyadic, Film, Filter, Guide, Part, Pixel};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{Gpu, GpuError, NamedBinding, TracedScene, Traffic, Variant, block_on, choice, wgsl};
use canted_renderer::{
    DeviceError, DevicePicture, Integrator, Levels, Monitor, Pattern, SampleSums, Sampler, SceneBvh, Settings,
    Surfaces, traced_scene,
};
use canted_scene::{Camera, Scene};
use canted_tests::device::lowered;

use crate::{
    gpu,
    scenes::{self, on_cpu, on_device, scene_bvh},
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(sums_of_the_device_are_those_of_the_host),
        needs_device(a_picture_downloads_each_pixel_once),
        needs_device(pictures_larger_than_buffers_have_the_same_bits),
        needs_device(another_order_is_detected),
        needs_device(sums_of_any_numbers_have_the_bits_of_the_host),
        needs_device(parts_of_any_numbers_have_the_bits_of_the_host),
        needs_device(parts_join),
        needs_device(noise_and_channels_are_those_of_the_host),
        needs_device(the_cpu_takes_unfinished_samples),
        needs_device(random_numbers_have_the_same_bits),
    ]
}

fn settings(integrator: Integrator, samples: u32) -> Settings {
    Settings { width: 21, height: 13, samples, integrator, bounces: 2, ..Settings::default() }
}

pub(super) fn monitored<T>(then: impl FnOnce(&Monitor) -> T) -> T {
    then(&Monitor::quiet(&AtomicBool::new(false)))
}

/// AOVs of what camera rays hit first.
fn first_hits() -> Aovs {
    let all = [Aov::Depth, Aov::Normal, Aov::ShadingNormal, Aov::Albedo, Aov::Instance, Aov::Primitive, Aov::Tests];
    all.into_iter().collect()
}

/// Numbers of samples of each pixel: summed, negative, dropped.
fn counts(film: &Film) -> Vec<[u32; 3]> {
    film.pixels().iter().map(|pixel| [pixel.n_samples, pixel.n_negative, pixel.n_dropped]).collect()
}

fn sums_of_the_device_are_those_of_the_host() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    for integrator in [Integrator::Hybrid, Integrator::Path] {
        let of_box = [1, 3, 64, 100].map(|n| (n, Filter::BOX));
        for (samples, filter) in of_box.into_iter().chain([37, 128].map(|n| (n, Filter::MITCHELL))) {
            let aovs = match samples {
                1 | 64 => Aovs::NONE,
                3 | 100 => first_hits(),
                _ => integrator.aovs(),
            };
            let host = Settings { filter, aovs, ..settings(integrator, samples) };
            let theirs = on_device(&gpu, &scene, &bvh, &camera, &host);
            assert_eq!(theirs.guides().iter().any(|guide| guide.n_hits > 1 && guide.first.is_some()), !aovs.is_empty());
            assert_eq!(!theirs.components().is_empty(), aovs.has_components());
            let device = Settings { sums: SampleSums::Device, ..host };
            let name = format!("{integrator:?}, {samples} samples, {filter}");
            assert_eq!(theirs.pixels().iter().any(|pixel| pixel.n_negative > 0), filter == Filter::MITCHELL);
            // Cells end between tiles of another size, and dispatches between cells.
            for tile in [host.tile, 8, 16] {
                let film = on_device(&gpu, &scene, &bvh, &camera, &Settings { tile, ..device });
                assert!(film == theirs, "{name}, tiles of {tile}");
            }
        }
    }
}

/// Each pixel comes back once, for any number of samples.
fn a_picture_downloads_each_pixel_once() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    // Of whole cells.
    let n_pixels = 24 * 16;
    let (none, guides) = ((Aovs::NONE, 64), (first_hits(), 64 + 112));
    let parts = (Aovs::NONE.with(Aov::Direct), 64 + 112 + 72);
    let all = (Integrator::Hybrid.aovs(), 64 + 112 + 72 + 96);
    for (samples, (aovs, n_bytes)) in
        [(1, none), (3, guides), (64, none), (64, parts), (3, all), (100, all), (1000, none)]
    {
        let settings = Settings { sums: SampleSums::Device, aovs, ..settings(Integrator::Hybrid, samples) };
        let before = gpu.traffic();
        on_device(&gpu, &scene, &bvh, &camera, &settings);
        let Traffic { downloaded_bytes, n_downloads, .. } = gpu.traffic() - before;
        // And some words for each dispatch: how many samples the CPU must take, and what streams count.
        let words = downloaded_bytes - n_bytes * n_pixels;
        assert!(
            words <= 4 * 256 * n_downloads,
            "{samples} samples: {downloaded_bytes} bytes in {n_downloads} downloads"
        );
    }
}

/// Cells are summed one part after the other where bindings are too small for the sums of all, and fewer samples are taken at once where memory is.
fn pictures_larger_than_buffers_have_the_same_bits() {
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    for (integrator, aovs, are_streams) in
        [(Integrator::Hybrid, Integrator::Hybrid.aovs(), false), (Integrator::Path, first_hits(), true)]
    {
        let device = Settings { sums: SampleSums::Device, aovs, ..settings(integrator, 40) };
        let device = Settings { width: 40, height: 30, ..device };
        let surfaces = Surfaces::with_lod(&scene, device.lod);
        let rendered = |gpu: &Gpu| {
            let picture = DevicePicture::new(gpu, &surfaces, &bvh, &camera, &device)?.with_streams(are_streams)?;
            monitored(|monitor| picture.render(vec![], monitor))
        };
        let gpu = gpu();
        let whole = rendered(&gpu).unwrap();
        // All samples at once, 40 of each pixel of 20 cells, are 8.4 MB with parts of the light, and 20 MB as streams.
        gpu.limit_memory(6 << 20);
        assert!(rendered(&gpu).unwrap() == whole, "{integrator:?} with little memory");
        gpu.limit_memory(1 << 20);
        let error = rendered(&gpu).unwrap_err();
        assert!(matches!(error, DeviceError::Gpu(GpuError::OutOfMemory { .. })), "{error}");
        // The sums of a cell are 43,008 bytes: six lengths of blocks of 64 pixels, 112 bytes each.
        let film = rendered(&lowered(48 << 10)).unwrap();
        assert!(film == whole, "{integrator:?} with small bindings");
    }
}

/// The sums of samples that are added in another order have other bits.
fn another_order_is_detected() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    let device = Settings { sums: SampleSums::Device, ..settings(Integrator::Path, 16) };
    let ours = on_device(&gpu, &scene, &bvh, &camera, &device);
    let each: Vec<Film> = (0..device.samples)
        .map(|k| on_device(&gpu, &scene, &bvh, &camera, &Settings { part: Some([k, k + 1]), ..device }))
        .collect();
    let in_order = |pixel: usize| each.iter().map(|film| film.pixels()[pixel]).reduce(|a, b| a + b).unwrap();
    let n = ours.pixels().len();
    let n_apart = (0..n).filter(|&pixel| in_order(pixel) != ours.pixels()[pixel]).count();
    assert!(n_apart > n / 4 && n_apart < n, "{n_apart} of {n}");
}

/// Parts of any split join to the bits of the whole, wherever they are summed.
fn parts_join() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    let aovs = Integrator::Hybrid.aovs();
    let device = Settings { sums: SampleSums::Device, aovs, ..settings(Integrator::Hybrid, 100) };
    let whole = on_device(&gpu, &scene, &bvh, &camera, &device);
    let joined = |at: u32, sums: [SampleSums; 2]| {
        let of = |(range, sums): ([u32; 2], SampleSums)| {
            let film = on_device(&gpu, &scene, &bvh, &camera, &Settings { part: Some(range), sums, ..device });
            (film.part().unwrap().clone(), film.n_rays())
        };
        let parts = [of(([0, at], sums[0])), of(([at, 100], sums[1]))];
        let n_rays = parts.iter().map(|(_, n)| n).sum();
        let part = Part::join(parts.map(|(part, _)| part).to_vec()).unwrap();
        Film::of_part(device.width, device.height, part, n_rays).without_part()
    };
    for at in [64, 37] {
        assert!(joined(at, [SampleSums::Device; 2]) == whole, "at {at}");
        assert!(joined(at, [SampleSums::Device, SampleSums::Host]) == whole, "at {at}");
    }
}

fn noise_and_channels_are_those_of_the_host() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    // The last samples of a noisy pixel, 64 to 99, are two blocks.
    let host =
        Settings { noise: Some(0.05), aovs: Aov::ALL.into_iter().collect(), ..settings(Integrator::Hybrid, 100) };
    let theirs = on_device(&gpu, &scene, &bvh, &camera, &host);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &Settings { sums: SampleSums::Device, ..host });
    assert!(counts(&theirs).iter().any(|[n, ..]| *n == 100) && counts(&theirs).iter().any(|[n, ..]| *n < 100));
    assert!(ours == theirs);
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

/// The CPU takes the samples that the device does not finish.
fn the_cpu_takes_unfinished_samples() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    let device = Settings {
        sums: SampleSums::Device,
        aovs: [Aov::Depth].into_iter().collect(),
        filter: Filter::MITCHELL,
        ..settings(Integrator::Path, 6)
    };
    let theirs = on_cpu(&scene, &bvh, &camera, &device);
    // No ray is finished: each sample is the CPU's.
    let none = summed(&gpu, (&scene, &camera), &bvh, &device, |traced| traced.with_max_iterations(0));
    assert!(none.pixels() == theirs.pixels() && none.n_rays() == theirs.n_rays());
    // Of single samples, AOVs are kept in f32.
    let depths = |guide: &Guide| (guide.n_hits, guide.first, guide.depth as f32);
    let are_near = |(a, b): (&Guide, &Guide)| {
        let ((n, first, depth), (n_theirs, first_theirs, of_theirs)) = (depths(a), depths(b));
        (n, first) == (n_theirs, first_theirs) && (depth - of_theirs).abs() <= 2e-7 * of_theirs.abs()
    };
    assert!(none.guides().iter().zip(theirs.guides()).all(are_near));
    // Some are.
    let host = Settings { sums: SampleSums::Host, ..device };
    let few =
        |settings: &Settings| summed(&gpu, (&scene, &camera), &bvh, settings, |traced| traced.with_max_iterations(30));
    let (ours, some) = (few(&device), few(&host));
    assert!(ours == some);
    assert!(some != theirs && some != on_device(&gpu, &scene, &bvh, &camera, &host));
}

/// Pixels in two cells, all of them in the picture.
const N_PLACES: u32 = 128;

/// What the kernels alone make of samples that `of` returns for the number of a work-group, of two cells with `n` each, and of a pixel: a sum of each
/// pixel. They are bound by `name`, and taken in dispatches of `step` work-groups.
fn sums_by_kernels<T: Pod, S: Pod>(
    gpu: &Gpu,
    (summed, name): (choice::Summed, &'static str),
    [n, step]: [u32; 2],
    of: &dyn Fn(u32, u32) -> T,
) -> Vec<S> {
    let variant = Variant::none().with(choice::Pattern::Random).with(choice::Filter::Box);
    let variant = variant.with(choice::View::Perspective).with(choice::Lens::Pinhole).with(summed);
    let kernels = [wgsl::render::sum::BLOCKS, wgsl::render::sum::PIXELS]
        .map(|name| gpu.kernel(name, &variant.of_kernel(name).unwrap()).unwrap());
    let mut picture = [0_u32; 36];
    (picture[16], picture[17]) = (16, 8);
    let picture = gpu.uniform("picture", &picture).unwrap();
    let cells = gpu.buffer("cells", &[0_u32, 1]).unwrap();
    let samples = gpu.zeroed::<T>("samples", 64 * step as usize).unwrap();
    let n_unfinished = gpu.zeroed::<u32>("n_unfinished", 1).unwrap();
    let blocks = gpu.zeroed::<S>("blocks", step as usize).unwrap();
    let waiting = gpu.zeroed::<S>("waiting", 9 * N_PLACES as usize).unwrap();
    let sums = gpu.zeroed::<S>("sums", N_PLACES as usize).unwrap();
    for first in (0..2 * n).step_by(step as usize) {
        let end = (first + step).min(2 * n);
        let taken: Vec<_> = (first..end).flat_map(|group| (0..64).map(move |pixel| (group, pixel))).collect();
        gpu.write(&samples, &taken.iter().map(|&(group, pixel)| of(group, pixel)).collect::<Vec<_>>());
        // The first work-group of a dispatch counts from its first cell.
        let cell = first / n;
        let slice = [first - cell * n, end - cell * n, 0, n, cell];
        let slice = gpu.uniform("slice", &slice).unwrap();
        let window = gpu.buffer("cells", &[cell, 1]).unwrap();
        let bound: [NamedBinding<'_>; 8] = [
            ("picture", &picture),
            ("slice", &slice),
            ("cells", if cell == 0 { &cells } else { &window }),
            (name, &samples),
            ("n_unfinished", &n_unfinished),
            ("blocks", &blocks),
            ("waiting", &waiting),
            ("sums", &sums),
        ];
        let mut commands = gpu.commands();
        let of_cells = (end - cell * n).div_ceil(n);
        for (kernel, groups) in kernels.iter().zip([end - first, of_cells]) {
            commands.dispatch(kernel, &bound, kernel.groups(64 * groups)).unwrap();
        }
        block_on(commands.run()).unwrap();
    }
    block_on(gpu.read(&sums)).unwrap()
}

/// Numbers of any kind, of which many are of similar size, so that their sums round.
fn number(k: u32, salt: u32) -> f32 {
    let bits = scattered(k, salt);
    match k % 7 {
        0..4 => f32::from_bits((bits & 0x83ff_ffff) | 0x3c00_0000),
        4 => f32::from_bits(bits),
        // Below the normal ones.
        5 => f32::from_bits(bits & 0x807f_ffff),
        _ => [0.0, -0.0, f32::INFINITY, f32::NAN, f32::MAX, -f32::MAX, f32::MIN_POSITIVE][bits as usize % 7],
    }
}

/// The same sums of the host, of one sample after the other.
fn sums_in_order<T: Default + Add<Output = T>>(n: u32, of: impl Fn(u32, u32) -> T) -> Vec<T> {
    let sum = |place: u32| (0..n).map(|k| of(place / 64 * n + k, place % 64)).reduce(T::add).unwrap_or_default();
    (0..N_PLACES).map(sum).collect()
}

/// What the host makes of the same samples.
fn sums_by_host<T: Copy + Default + Add<Output = T>>(n: u32, of: impl Fn(u32, u32) -> T) -> Vec<T> {
    let sum = |place: u32| {
        let mut sum = Dyadic::default();
        (0..n).for_each(|k| sum.push_sample(k, of(place / 64 * n + k, place % 64)));
        sum.total()
    };
    (0..N_PLACES).map(sum).collect()
}

/// The kernels alone: bits of sums of any numbers, of dispatches of any size.
fn sums_of_any_numbers_have_the_bits_of_the_host() {
    let gpu = gpu();
    for n in [1, 2, 3, 63, 64, 65, 127, 128, 192, 200, 389] {
        let sample = |group: u32, pixel: u32| {
            let first = 3 * (64 * group + pixel);
            let [red, green, blue] = [first, first + 1, first + 2].map(|k| number(k, n));
            [red, green, blue, f32::from(group as u8)]
        };
        // What the host sums, and what it would of numbers that differ in a bit.
        let by_host = |flipped: u32| {
            let sums = sums_by_host(n, |group, pixel| {
                let [red, green, blue, _] = sample(group, pixel);
                Pixel::of([f32::from_bits(red.to_bits() ^ flipped), green, blue])
            });
            let bits = |pixel: Pixel| {
                let all = pixel.sum.into_iter().chain(pixel.sum_of_squares).map(f64::to_bits);
                (all.collect::<Vec<_>>(), [pixel.n_samples, pixel.n_negative, pixel.n_dropped])
            };
            sums.into_iter().map(bits).collect::<Vec<_>>()
        };
        let (theirs, others) = (by_host(0), by_host(1));
        for step in [1, 50, 64, 150, 2 * n] {
            let found: Vec<[u64; 8]> = sums_by_kernels(&gpu, (choice::Summed::Light, "samples"), [n, step], &sample);
            let ours = found.iter().map(|words| {
                let dropped = (words[6] >> 32) as u32;
                (words[..6].to_vec(), [n - dropped, words[6] as u32, dropped])
            });
            let ours: Vec<_> = ours.collect();
            assert!(ours == theirs, "{n} samples in dispatches of {step}");
            let n_rays = (0..n).map(|k| u64::from(k as u8)).sum::<u64>();
            assert_eq!(found[5][7], n_rays, "{n} samples");
            let apart = others.iter().zip(&ours).filter(|(theirs, ours)| theirs != ours).count();
            assert!(2 * apart > N_PLACES as usize, "{apart} of {N_PLACES}");
        }
    }
}

/// The same of parts of the light, of which no part counts where a number is not finite.
fn parts_of_any_numbers_have_the_bits_of_the_host() {
    let gpu = gpu();
    for n in [1, 3, 64, 65, 200] {
        // Most samples are finite.
        let part = |group: u32, pixel: u32, k: u32| {
            let at = 21 * (64 * group + pixel);
            [0, 1, 2]
                .map(|c| number(if pixel.is_multiple_of(5) { at + 3 * k + c } else { 7 * (at + 3 * k + c) + c }, n))
        };
        let parts_of = |group: u32, pixel: u32| [0, 1, 2].map(|k| part(group, pixel, k));
        let first_of = |group: u32, pixel: u32| [3, 4, 5, 6].map(|k| part(group, pixel, k));
        let sums_of = |flipped: u32| {
            sums_by_host(n, |group, pixel| {
                let mut parts = parts_of(group, pixel);
                parts[0][0] = f32::from_bits(parts[0][0].to_bits() ^ flipped);
                Components::weighted(parts, Some(first_of(group, pixel)), 1.0)
            })
        };
        let bits = |parts: &[[f64; 3]]| parts.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let (theirs, others) = (sums_of(0), sums_of(1));
        // Sums in another order have other bits.
        let in_order = sums_in_order(n, |group, pixel| {
            Components::weighted(parts_of(group, pixel), Some(first_of(group, pixel)), 1.0)
        });
        let n_apart = in_order.iter().zip(&theirs).filter(|(a, b)| a.sums != b.sums && a.first != b.first).count();
        assert!(n < 200 || n_apart > 3, "{n_apart} of {N_PLACES}");
        for step in [1, 50, 64, 150] {
            let ours: Vec<[[f64; 3]; 3]> =
                sums_by_kernels(&gpu, (choice::Summed::Components, "components"), [n, step], &parts_of);
            let first: Vec<[[f64; 3]; 4]> =
                sums_by_kernels(&gpu, (choice::Summed::FirstLight, "first_light"), [n, step], &first_of);
            for ((ours, first), theirs) in ours.iter().zip(&first).zip(&theirs) {
                assert_eq!(bits(ours), bits(&theirs.sums), "{n} samples in dispatches of {step}");
                assert_eq!(bits(first), bits(&theirs.first.unwrap()), "{n} samples in dispatches of {step}");
            }
            let apart = others.iter().zip(&ours).filter(|(theirs, ours)| bits(&theirs.sums) != bits(&ours[..])).count();
            assert!(2 * apart > N_PLACES as usize, "{apart} of {N_PLACES}");
        }
    }
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
