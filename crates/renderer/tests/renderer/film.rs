//! Films: merging parts, AOVs, adaptive stopping, resuming tiles.
//!
//! Not covered: files, which are tested with the program.

use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use canted_film::{Aov, Aovs, Film, Guide, Part, Tile};
use canted_renderer::{Monitor, Pattern, RenderError, Settings, Tracer, View, render, resume};
use canted_scene::{Camera, Light, Material, Scene};

use crate::common::{BruteForce, camera, cuboid, film, floor, grey, parallelogram, scene, settings, unit};

fn stage() -> (Scene, Camera) {
    let mut stage = scene(
        vec![floor(3.0, 0.0, 0), cuboid([-1.0, 0.0, -1.0], [1.0, 1.5, 0.5], 1)],
        vec![grey(0.8), Material { base_color: [0.9, 0.4, 0.1], ..Material::default() }],
    );
    stage.environment = Some([0.3, 0.4, 0.6].into());
    stage.lights = vec![Light::Sun { direction: [-0.6, -0.8, 0.0], irradiance: [2.0; 3] }];
    (stage, camera([3.0, 3.0, 4.0], [0.0, 0.5, 0.0], 60.0))
}

fn all() -> Aovs {
    Aov::ALL.into_iter().collect()
}

const SIZE: [u32; 2] = [37, 23];

fn sobol(samples: u32) -> Settings {
    Settings { pattern: Pattern::Sobol, aovs: all(), ..settings(SIZE[0], SIZE[1], samples, 1) }
}

#[test]
fn merged_parts_equal_the_film_of_all_samples() {
    let (mut stage, view) = stage();
    // Dropped samples must be counted too.
    stage.materials[1].emission = [0.0, f32::NAN, 0.0];
    let part = |start, end| {
        let film = film(&stage, &view, &Settings { part: Some([start, end]), ..sobol(13) });
        film.part().unwrap().clone()
    };
    let whole = film(&stage, &view, &sobol(13));
    assert!(whole.n_dropped() > 0 && whole.part().is_none());
    for parts in [vec![part(0, 13)], vec![part(5, 13), part(0, 5)], vec![part(12, 13), part(0, 1), part(1, 12)]] {
        let joined = Film::of_part(SIZE[0], SIZE[1], Part::join(parts).unwrap(), 0);
        assert_eq!((joined.pixels(), joined.guides()), (whole.pixels(), whole.guides()));
    }
}

#[test]
fn tiles_and_threads_do_not_change_parts_or_stopping() {
    let (stage, view) = stage();
    for settings in [Settings { part: Some([3, 9]), ..sobol(9) }, Settings { noise: Some(0.06), ..sobol(64) }] {
        let with = |threads, tile| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| film(&stage, &view, &Settings { tile, ..settings }))
        };
        let reference = with(1, 1);
        for (threads, tile) in [(2, 8), (3, 15), (2, 1000)] {
            assert!(with(threads, tile) == reference, "{threads} threads, tiles of {tile}");
        }
    }
}

/// Compared with brute force for each camera ray; sums are in a different order, so equal up to rounding.
#[test]
fn guides_match_camera_ray_hits() {
    let (stage, camera) = stage();
    let settings = sobol(4);
    let film = film(&stage, &camera, &settings);
    let view = View::new(&camera, SIZE[0], SIZE[1]).unwrap();
    let tracer = BruteForce::new(&stage);
    let axis = unit(std::array::from_fn(|k| f64::from(camera.target[k] - camera.eye[k])));
    let sampler = canted_renderer::Sampler::new(Pattern::Sobol, 4, settings.seed);
    let (mut n_misses, mut n_edges) = (0, 0);
    for (number, guide) in (0..).zip(film.guides()) {
        let mut expected = Guide::default();
        for sample in 0..4 {
            let [dx, dy] = sampler.pair(number, sample, 0).map(f64::from);
            let ray = view.ray([f64::from(number % SIZE[0]) + dx, f64::from(number / SIZE[0]) + dy]);
            let Some(hit) = tracer.closest_hit(&ray, &mut ()) else { continue };
            expected.n_hits += 1;
            expected.first = expected.first.or(Some([hit.instance.0, hit.primitive.0]));
            expected.depth += f64::from(hit.t) * (0..3).map(|k| axis[k] * f64::from(ray.direction[k])).sum::<f64>();
            let albedo = stage.materials[hit.instance.0 as usize].base_color;
            expected.albedo = std::array::from_fn(|k| expected.albedo[k] + f64::from(albedo[k]));
        }
        assert_eq!((guide.n_hits, guide.first), (expected.n_hits, expected.first), "pixel {number}");
        // Positions from barycentric weights and from t: f32 roundings of coordinates below 16 in four samples.
        assert!((guide.depth - expected.depth).abs() < 4.0 * 16.0 * 8.0 * f64::from(f32::EPSILON), "pixel {number}");
        assert_eq!(guide.albedo, expected.albedo, "sums of four 24-bit numbers are exact");
        n_misses += u32::from(guide.n_hits == 0);
        n_edges += u32::from(guide.n_hits % 4 != 0);
        for normal in [guide.normal, guide.shading_normal] {
            let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!(length <= f64::from(guide.n_hits) * (1.0 + 1e-12), "a sum of unit normals");
        }
    }
    assert!(n_misses > 10 && n_edges > 10, "{n_misses} {n_edges}");
}

/// A sphere light in front of a wall, half occluded by a disk light that shows its black side to the camera.
#[test]
fn guides_include_shape_lights() {
    let wall = parallelogram([-9.0, -9.0, -5.0], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], 0);
    let lights = vec![
        Light::Sphere { center: [0.0; 3], radius: 1.0, radiance: [5.0; 3] },
        Light::Disk { center: [0.5, 0.0, 2.0], normal: [0.0, 0.0, -1.0], radius: 0.5, radiance: [5.0; 3] },
    ];
    let stage = Scene { lights, ..scene(vec![wall], vec![grey(0.5)]) };
    // At the depth of the sphere's center, a world unit is eight pixels.
    let view = camera([0.0, 0.0, 6.0], [0.0; 3], 2.0 * (2.0_f32 / 6.0).atan().to_degrees());
    let film = film(&stage, &view, &Settings { aovs: all(), ..settings(33, 33, 1, 1) });
    let at = |x: usize, y: usize| film.guides()[33 * y + x];
    let of_light = |guide: Guide| (guide.n_hits, guide.first, guide.albedo) == (1, None, [0.0; 3]);
    let sphere = at(14, 16);
    assert!(of_light(sphere) && sphere.normal[0] < 0.0 && sphere.normal[2] > 0.9 && sphere.depth < 5.2, "{sphere:?}");
    let length = sphere.normal.iter().map(|x| x * x).sum::<f64>();
    assert!((length - 1.0).abs() < 1e-12 && sphere.normal == sphere.shading_normal, "{sphere:?}");
    let disk = at(20, 16);
    assert!(of_light(disk) && disk.normal == [0.0, 0.0, 1.0] && (disk.depth - 4.0).abs() < 1e-6, "{disk:?}");
    let wall = at(2, 2);
    assert!(wall.first == Some([0, 1]) || wall.first == Some([0, 0]), "{wall:?}");
    assert!(wall.albedo == [0.5; 3] && (wall.depth - 11.0).abs() < 1e-5, "{wall:?}");
}

#[test]
fn aovs_that_are_not_requested_are_not_stored() {
    let (stage, view) = stage();
    let plain = film(&stage, &view, &Settings { aovs: Aovs::NONE, ..sobol(4) });
    assert!(plain.guides().is_empty());
    let guided = film(&stage, &view, &sobol(4));
    assert_eq!((plain.pixels(), plain.n_rays()), (guided.pixels(), guided.n_rays()), "no ray is traced twice");
    let uncounted = film(&stage, &view, &Settings { aovs: Aovs::NONE.with(Aov::Depth), ..sobol(4) });
    assert!(uncounted.guides().iter().all(|guide| guide.tests == [0.0; 2]));
}

#[test]
fn cells_stop_at_powers_of_two_when_converged() {
    let (stage, view) = stage();
    let film = film(&stage, &view, &Settings { noise: Some(0.03), ..sobol(100) });
    let mut counts: Vec<u32> = film.pixels().iter().map(canted_film::Pixel::n_taken).collect();
    let at = |x: u32, y: u32| film.pixels()[(y * SIZE[0] + x) as usize];
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let first = at(x / 8 * 8, y / 8 * 8);
            assert_eq!(at(x, y).n_taken(), first.n_taken(), "all pixels of a cell stop together");
        }
    }
    counts.sort_unstable();
    counts.dedup();
    assert!(counts.len() > 2 && counts.iter().all(|n| [16, 32, 64, 100].contains(n)), "{counts:?}");
}

#[test]
fn finished_tiles_are_not_rendered_again() {
    let (stage, view) = stage();
    let settings = Settings { tile: 8, ..sobol(4) };
    let tracer = BruteForce::new(&stage);
    let run = |done: Vec<Tile>| {
        let finished = Mutex::new(Vec::new());
        let keep = |tile: &Tile| finished.lock().unwrap().push(tile.clone());
        let monitor = Monitor { progress: &|_, _| (), finished: &keep, cancel: &AtomicBool::new(false) };
        let film = resume(&stage, &tracer, &view, &settings, done, &monitor);
        (film, finished.into_inner().unwrap())
    };
    let (whole, mut tiles) = run(Vec::new());
    let rest = tiles.split_off(6);
    let (resumed, rendered) = run(tiles.clone());
    assert!(resumed == whole);
    assert_eq!(rendered.len(), rest.len());
    let n_tiles = 6 + rest.len();
    tiles[0].number = n_tiles;
    assert_eq!(run(tiles.clone()).0, Err(RenderError::Tile { number: n_tiles }));
    tiles[0] = Tile { pixels: Vec::new(), ..rest[0].clone() };
    assert_eq!(run(tiles).0, Err(RenderError::Tile { number: rest[0].number }));
}

#[test]
fn invalid_parts_and_noise_are_rejected() {
    let (stage, view) = stage();
    let refused = |settings: Settings| {
        let never = AtomicBool::new(false);
        render(&stage, &BruteForce::new(&stage), &view, &settings, &|_, _| (), &never).unwrap_err().to_string()
    };
    for part in [[4, 4], [5, 4], [0, 14]] {
        let expected = format!("samples {}..{} are not a part of 0..13", part[0], part[1]);
        assert_eq!(refused(Settings { part: Some(part), ..sobol(13) }), expected);
    }
    for noise in [0.0, -1.0, f32::NAN] {
        let words = refused(Settings { noise: Some(noise), ..sobol(13) });
        assert_eq!(words, format!("noise {noise} is not an error above zero"));
    }
    let words = refused(Settings { noise: Some(0.1), part: Some([0, 4]), ..sobol(13) });
    assert!(words.contains("noise"), "{words}");
}
