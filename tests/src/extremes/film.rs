//! Sample sums: invalid, very bright, many and few samples; any number of threads and order of parts; signed zeros in files.

use std::{fs, path::Path, sync::atomic::AtomicBool};

use canted_film::{Film, Part, Picture, Pixel, write_exr, write_png};
use canted_fixtures::{icosphere, thin_box};
use canted_obb::Affine;
use canted_renderer::{SceneBvh, SceneBvhConfig, Settings, render};
use canted_scene::{Camera, Instance, Light, Material, MaterialId, Mesh, MeshId, Part as MeshPart, Scene};

use super::{Oracle, Promise, Row};

const fn promise(case: &'static str, promise: &'static str, bound: f64, unit: &'static str) -> Promise {
    Promise { stage: "film", case, promise, oracle: Oracle::Known, bound, unit }
}

/// Sizes of the thread pools.
const N_THREADS: [usize; 4] = [1, 2, 3, 4];
/// Tile sizes.
const TILES: [u32; 2] = [8, 32];
/// Number of samples in the firefly's pixel.
const N_OF_FIREFLY: u32 = 1000;

pub(super) fn rows() -> Vec<Row> {
    const FIREFLY: Promise = promise(
        "one sample of 1e30 or f32::MAX among 999 samples of 1",
        "not clamped; mean and variance are finite",
        // One f64 rounding for each addition, plus those of the quotient and of this oracle.
        (N_OF_FIREFLY as f64 + 4.0) * 0.5 * f64::EPSILON,
        "relative error of the mean",
    );
    const ZEROS: Promise = Promise {
        oracle: Oracle::Same,
        ..promise("a picture with -0.0", "the same file as for +0.0, byte for byte", 0.0, "files differ")
    };
    const ORDER: Promise = Promise {
        oracle: Oracle::Same,
        ..promise("1 to 4 threads, tiles of 8 and 32 pixels", "the same sums, bit for bit", 0.0, "pictures differ")
    };
    const PARTS: Promise = Promise {
        oracle: Oracle::Same,
        ..promise("samples in three parts, two orders", "the sums of one part, bit for bit", 0.0, "pictures differ")
    };
    const BAD: Promise =
        promise("a NaN or infinite sample", "counted, and excluded from all sums", 0.0, "samples counted wrongly");
    const LONG: Promise = promise(
        "2^24 samples, then a million more",
        "the sum keeps growing",
        // A million and more additions of exact numbers below 2^53.
        0.0,
        "error of the mean",
    );
    const FEW: Promise =
        promise("no sample; one sample", "mean and variance are finite, the error is unknown", 0.0, "that are wrong");
    const NEAR: Promise = promise(
        "a million samples of 1e4, varying by 1e-3",
        "the variance of the mean is non-negative and close to the true one",
        // The squares sum to 1e14, where f64 values are 2^-6 apart. Relative to the true sum of squared differences (about 1),
        // n roundings of the sum can add up to 1; summed pairwise they are 40 · 2^-53 · 1e14 = 0.45.
        0.45,
        "relative error",
    );
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let wrong = bad.iter().filter(|&&x| {
        let pixel = Pixel::of([0.5; 3]) + Pixel::of([0.25, x, 0.25]);
        (pixel.n_samples, pixel.n_dropped) != (1, 1) || pixel.mean() != [0.5; 3]
    });
    let n_more: u32 = 1 << 20;
    let start = Pixel { sum: [16_777_216.0; 3], n_samples: 1 << 24, ..Pixel::default() };
    let long = (0..n_more).fold(start, |sum, _| sum + Pixel::of([1.0; 3]));
    let few = [Pixel::default(), Pixel::of([2.0, 0.0, -0.0]), Pixel { n_dropped: 1, ..Pixel::default() }];
    let is_wrong = |pixel: &&Pixel| {
        let numbers = [pixel.mean(), pixel.variance_of_mean()].concat();
        numbers.iter().any(|x| !x.is_finite()) || pixel.squared_error() != f64::INFINITY
    };
    vec![
        BAD.count("Pixel", bad.len(), wrong.count()),
        LONG.row("Pixel", 1, (long.mean()[0] - 1.0).abs()),
        FEW.count("Pixel", few.len(), few.iter().filter(is_wrong).count()),
        NEAR.row("Pixel, pairwise", 1, variance_error()),
        FIREFLY.row("Pixel", fireflies().len(), firefly_error()),
        ZEROS.count("write_exr, write_png", 2, zeros()),
        ORDER.count("render", N_THREADS.len() * TILES.len(), n_other_pictures()),
        PARTS.count("Part::join", 2, n_other_joins()),
    ]
}

/// Relative error of the variance of the mean of 2^20 samples of 1e4, half of them larger by 2^-10; summed pairwise.
fn variance_error() -> f64 {
    let step = 2.0f32.powi(-10);
    let mut sums: Vec<Pixel> =
        (0..1u32 << 20).map(|i| Pixel::of([1e4 + if i % 2 == 0 { step } else { 0.0 }; 3])).collect();
    while sums.len() > 1 {
        sums = sums.chunks(2).map(|pair| pair.iter().copied().reduce(|a, b| a + b).unwrap_or_default()).collect();
    }
    let n = f64::from(1u32 << 20);
    // Each sample is half a step from the mean.
    let truth = (0.5 * f64::from(step)).powi(2) / (n - 1.0);
    (sums[0].variance_of_mean()[0] / truth - 1.0).abs()
}

/// Values of the bright sample.
fn fireflies() -> [f32; 2] {
    [1e30, f32::MAX]
}

/// Worst relative error of the mean of a firefly and ones; infinite if mean or variance is not finite.
fn firefly_error() -> f64 {
    let error = |bright: f32| {
        let pixel = (1..N_OF_FIREFLY).fold(Pixel::of([bright; 3]), |sum, _| sum + Pixel::of([1.0; 3]));
        let truth = (f64::from(bright) + f64::from(N_OF_FIREFLY - 1)) / f64::from(N_OF_FIREFLY);
        let is_sound = pixel.n_dropped == 0 && pixel.variance_of_mean().iter().all(|x| x.is_finite());
        if is_sound { (pixel.mean()[0] / truth - 1.0).abs() } else { f64::INFINITY }
    };
    fireflies().map(error).into_iter().fold(0.0, f64::max)
}

/// Writes a picture to a file.
type Write = fn(&Path, &Picture);

/// Number of formats whose file differs between negative and positive zeros.
fn zeros() -> usize {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let bytes = |zero: f32, write: Write| {
        let path = folder.path().join("zeros");
        write(&path, &Picture { width: 3, height: 2, pixels: vec![[zero, 0.5, zero]; 6] });
        fs::read(path).expect("the file was written")
    };
    let exr = |path: &Path, picture: &Picture| write_exr(path, picture).expect("the folder is writable");
    let png = |path: &Path, picture: &Picture| write_png(path, picture).expect("the folder is writable");
    [exr as Write, png].into_iter().filter(|&write| bytes(-0.0, write) != bytes(0.0, write)).count()
}

/// A sphere above a plate with a point light and a constant environment.
fn scene() -> Scene {
    let mesh = |mesh: canted_fixtures::Mesh| {
        let parts = vec![MeshPart { first_triangle: 0, material: MaterialId(0) }];
        Mesh { positions: mesh.positions, triangles: mesh.triangles, parts, ..Mesh::default() }
    };
    let still = |mesh: u32, first_primitive: u32, shift: [f32; 3], size: f32| Instance {
        mesh: MeshId(mesh),
        world_from_object: Affine::scale([size; 3]).then(&Affine::translation(shift)),
        world_from_object_close: None,
        first_primitive,
    };
    let meshes = vec![mesh(icosphere(1)), mesh(thin_box(0.1))];
    let first_of_plate = u32::try_from(meshes[0].triangles.len()).expect("a small mesh");
    Scene {
        meshes,
        instances: vec![still(0, 0, [0.0; 3], 1.0), still(1, first_of_plate, [0.0, 0.0, -1.2], 5.0)],
        materials: vec![Material { base_color: [0.7, 0.5, 0.3], ..Material::default() }],
        lights: vec![Light::Point { position: [-2.0, 1.0, 4.0], intensity: [5.0, 6.0, 8.0] }],
        environment: Some([0.3, 0.4, 0.6].into()),
        ..Scene::default()
    }
}

fn settings() -> Settings {
    Settings { width: 48, height: 40, samples: 7, tile: 8, ..Settings::default() }
}

/// The scene's sample sums, rendered on `n_threads` threads.
fn film(n_threads: usize, settings: &Settings) -> Film {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("a few threads");
    let camera = Camera::pinhole([3.0, -4.0, 2.0], [0.0, 0.0, -0.2], [0.0, 0.0, 1.0], 45.0);
    pool.install(|| {
        let scene = scene();
        let bvh = SceneBvh::build(&scene, &SceneBvhConfig::default()).expect("a valid scene");
        render(&scene, &bvh, &camera, settings, &|_, _| (), &AtomicBool::new(false))
            .expect("the render is not cancelled")
    })
}

/// Number of combinations of threads and tile size whose sums differ from those of one thread.
fn n_other_pictures() -> usize {
    let want = film(1, &settings());
    let pairs = N_THREADS.iter().flat_map(|&n_threads| TILES.map(|tile| (n_threads, tile)));
    let is_other =
        |&(n_threads, tile): &(usize, u32)| film(n_threads, &Settings { tile, ..settings() }).pixels() != want.pixels();
    pairs.filter(is_other).count()
}

/// Number of orders of three parts whose joined sums differ from a render in one part.
fn n_other_joins() -> usize {
    let want = film(1, &settings());
    let parts = [[0, 2], [2, 5], [5, 7]].map(|part| {
        let film = film(2, &Settings { part: Some(part), ..settings() });
        film.part().expect("the settings request a part").clone()
    });
    let of = |order: [usize; 3]| {
        let joined = Part::join(order.map(|i| parts[i].clone()).to_vec()).expect("adjacent parts");
        Film::of_part(settings().width, settings().height, joined, 0)
    };
    [[0, 1, 2], [2, 0, 1]].into_iter().filter(|&order| of(order).pixels() != want.pixels()).count()
}
