//! Films: merging parts, AOVs, adaptive stopping, resuming tiles.
//!
//! Not covered: files, which are tested with the program.

use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use canted_film::{Aov, Aovs, Film, Filter, FilterSampler, Guide, Part, Tile};
use canted_renderer::{Monitor, Pattern, RenderError, Sampler, Settings, View, render, resume};
use canted_scene::{Light, Material, MaterialId, Mesh, Part as MeshPart, Scene};
use canted_trace::Intersect;

use crate::common::{BruteForce, box_on_floor, camera, film, gray, parallelogram, scene, settings, unit};

fn all() -> Aovs {
    Aov::ALL.into_iter().collect()
}

const SIZE: [u32; 2] = [37, 23];

fn sobol(samples: u32) -> Settings {
    Settings { pattern: Pattern::Sobol, aovs: all(), ..settings(SIZE[0], SIZE[1], samples, 1) }
}

#[test]
fn merged_parts_equal_the_film_of_all_samples() {
    let (mut stage, view) = box_on_floor(3.0, 60.0);
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
        assert!(!whole.components().is_empty() && joined.components() == whole.components());
        assert!(whole.components().iter().any(|components| components.first.is_some_and(|first| first[1][0] > 0.0)));
    }
}

#[test]
fn tiles_and_threads_do_not_change_parts_or_stopping() {
    let (stage, view) = box_on_floor(3.0, 60.0);
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
    let (stage, camera) = box_on_floor(3.0, 60.0);
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
            let Some(hit) = tracer.closest_hit(&ray) else { continue };
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
    let stage = Scene { lights, ..scene(vec![wall], vec![gray(0.5)]) };
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
    let (stage, view) = box_on_floor(3.0, 60.0);
    let plain = film(&stage, &view, &Settings { aovs: Aovs::NONE, ..sobol(4) });
    assert!(plain.guides().is_empty());
    let guided = film(&stage, &view, &sobol(4));
    assert_eq!((plain.pixels(), plain.n_rays()), (guided.pixels(), guided.n_rays()), "no ray is traced twice");
    let uncounted = film(&stage, &view, &Settings { aovs: Aovs::NONE.with(Aov::Depth), ..sobol(4) });
    assert!(uncounted.guides().iter().all(|guide| guide.tests == [0.0; 2]));
    assert!(uncounted.components().is_empty() && guided.components().len() == guided.pixels().len());
}

#[test]
fn cells_stop_at_powers_of_two_when_converged() {
    let (stage, view) = box_on_floor(3.0, 60.0);
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
    let (stage, view) = box_on_floor(3.0, 60.0);
    let settings = Settings { tile: 8, ..sobol(4) };
    let tracer = BruteForce::new(&stage);
    let run = |done: Vec<Tile>| {
        let finished = Mutex::new(Vec::new());
        let keep = |tile: &Tile| finished.lock().unwrap().push(tile.clone());
        let cancel = AtomicBool::new(false);
        let monitor = Monitor { finished: &keep, ..Monitor::quiet(&cancel) };
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
    let (stage, view) = box_on_floor(3.0, 60.0);
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

const FILTERS: [Filter; 7] = [
    Filter::BOX,
    Filter::Box(1.25),
    Filter::TENT,
    Filter::GAUSSIAN,
    Filter::MITCHELL,
    Filter::Mitchell(3.0),
    Filter::BLACKMAN_HARRIS,
];

/// Samples form a net: each of as many columns contains one.
const N: u32 = 1 << 16;

/// The filter's response to light that depends on x, by samples and by quadrature.
fn responses(filter: Filter, light: impl Fn(f64) -> f64, breaks: &[f64]) -> [f64; 2] {
    let sampler = Sampler::new(Pattern::Sobol, N, 1);
    let placer = FilterSampler::new(filter).unwrap();
    let (mut sum, mut weights) = (0.0, 0.0);
    for ([x, _], weight) in (0..N).map(|i| placer.sample(sampler.pair(0, i, 0))) {
        sum += f64::from(weight) * light(x);
        weights += f64::from(weight);
    }
    let r = f64::from(filter.radius());
    let mut breaks: Vec<f64> = breaks.iter().copied().chain([-r, -r / 2.0, 0.0, r / 2.0, r]).collect();
    breaks.retain(|x| x.abs() <= r);
    breaks.sort_by(f64::total_cmp);
    let integral = |of: &dyn Fn(f64) -> f64| breaks.windows(2).map(|w| simpson(of, w[0], w[1])).sum::<f64>();
    // Pieces are open intervals, so a break belongs to neither side.
    [sum / weights, integral(&|x| filter.value(x) * light(x)) / integral(&|x| filter.value(x))]
}

fn simpson(f: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    const PIECES: i32 = 200;
    // Ends are moved inwards by a billionth, so that an edge of the light belongs to one side.
    let (a, b) = (a + 1e-9 * (b - a), b - 1e-9 * (b - a));
    let h = (b - a) / f64::from(2 * PIECES);
    let at = |i: i32| f(a + h * f64::from(i));
    (0..PIECES).map(|i| at(2 * i) + 4.0 * at(2 * i + 1) + at(2 * i + 2)).sum::<f64>() * h / 3.0
}

/// Error bound of sampling and table for light of this variation.
///
/// Koksma's inequality: the error is at most the discrepancy of the net times the variation. The discrepancy is at most
/// 2/n along one axis. The signs of a filter with negative lobes vary along both axes, by four each and by products
/// with the light; the discrepancy over rectangles is (m + 3)/n. The table adds a millionth for an edge.
fn bound(filter: Filter, variation: f64, n: u32) -> f64 {
    match filter {
        Filter::Mitchell(_) => 2.0 * (variation + 8.0) * f64::from(n.ilog2() + 3) / f64::from(n),
        _ => variation * 2.0 / f64::from(n) + 1e-6,
    }
}

#[test]
fn edge_responses_match_quadrature() {
    for filter in FILTERS {
        for edge in [-2.2, -1.0, -0.6, -0.3, 0.0, 0.1, 0.45, 0.9, 1.7] {
            let [sampled, exact] = responses(filter, |x| f64::from(u8::from(x > edge)), &[edge]);
            assert!((sampled - exact).abs() < bound(filter, 1.0, N), "{filter:?} edge {edge}: {sampled} for {exact}");
        }
    }
}

#[test]
fn sine_responses_match_quadrature() {
    for filter in FILTERS {
        for period in [0.7, 1.0, 2.0, 5.0] {
            let light = |x: f64| (std::f64::consts::TAU * (x + 0.1) / period).sin();
            let [sampled, exact] = responses(filter, light, &[]);
            let variation = 4.0 * (2.0 * f64::from(filter.radius()) / period + 1.0);
            assert!(
                (sampled - exact).abs() < bound(filter, variation, N),
                "{filter:?} period {period}: {sampled} {exact}"
            );
        }
    }
}

/// The test above distinguishes filters: their responses to an edge differ.
#[test]
fn test_distinguishes_filters() {
    for a in FILTERS {
        for b in FILTERS.into_iter().filter(|b| *b != a) {
            let differs = [0.1, 0.3, 0.6].into_iter().any(|edge| {
                let light = |x: f64| f64::from(u8::from(x > edge));
                let [[sampled, _], [_, exact]] = [responses(a, light, &[edge]), responses(b, light, &[edge])];
                (sampled - exact).abs() > bound(a, 1.0, N)
            });
            assert!(differs, "{a:?} for {b:?}");
        }
    }
}

#[test]
fn weights_are_one_unless_the_filter_has_negative_lobes() {
    let ends = [0.0, 0.25, 0.5, 1.0 - 1.0 / 16_777_216.0];
    for filter in FILTERS {
        let placer = FilterSampler::new(filter).unwrap();
        for square in ends.iter().flat_map(|&x| ends.map(|y| [x, y])) {
            let (position, weight) = placer.sample(square);
            assert!(
                position.iter().all(|x| x.abs() <= f64::from(filter.radius())),
                "{filter:?} {square:?}: {position:?}"
            );
            // The center of the square maps to the center of the pixel.
            assert_eq!(placer.sample([0.5, 0.5]).0, [0.0, 0.0]);
            match filter {
                Filter::Mitchell(_) => assert_eq!(weight.abs().to_bits(), 1.0_f32.to_bits(), "{filter:?}"),
                _ => assert_eq!(weight.to_bits(), 1.0_f32.to_bits(), "{filter:?}"),
            }
        }
    }
}

#[test]
fn box_filter_is_the_identity() {
    let placer = FilterSampler::new(Filter::BOX).unwrap();
    let sampler = Sampler::new(Pattern::Random, 1, 0);
    for pixel in 0..1000 {
        let square = sampler.pair(pixel, 0, 0);
        let ([x, y], _) = placer.sample(square);
        let column = f64::from(pixel * 7 + 3);
        assert_eq!([column + 0.5 + x, 0.5 + y], [column + f64::from(square[0]), f64::from(square[1])]);
    }
}

#[test]
fn invalid_radii_are_rejected() {
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(FilterSampler::new(Filter::Tent(radius)).is_none(), "{radius}");
    }
}

/// Weights are normalized: constant light stays constant with few samples and any filter.
#[test]
fn constant_light_stays_constant() {
    let empty = Scene { environment: Some([0.75; 3].into()), ..scene(vec![], vec![]) };
    let view = camera([0.0, 0.0, 1.0], [0.0; 3], 90.0);
    for filter in FILTERS {
        for samples in [1, 3, 16] {
            let film = film(&empty, &view, &Settings { filter, ..settings(16, 16, samples, 0) });
            assert!(film.pixels().iter().all(|pixel| pixel.mean() == [0.75; 3]), "{filter:?} {samples}");
        }
    }
}

/// A bright half-plane viewed frontally: the pixels of a row are the filter's response to its edge.
#[test]
fn rendered_edge_is_filtered() {
    const EDGE: f32 = 0.2;
    const SAMPLES: u32 = 1 << 12;
    let bright = Material { base_color: [0.0; 3], emission: [1.0; 3], ..Material::default() };
    let half_plane = Mesh {
        positions: vec![[EDGE, -9.0, 0.0], [9.0, -9.0, 0.0], [9.0, 9.0, 0.0], [EDGE, 9.0, 0.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![MeshPart { first_triangle: 0, material: MaterialId(0) }],
        ..Mesh::default()
    };
    let stage = scene(vec![half_plane], vec![bright]);
    // A pixel is an eighth of a unit.
    let view = camera([0.0, 0.0, 1.0], [0.0; 3], 90.0);
    for filter in FILTERS {
        let film = film(&stage, &view, &Settings { filter, pattern: Pattern::Sobol, ..settings(16, 16, SAMPLES, 0) });
        for column in 0..16_u8 {
            let middle = (f64::from(column) + 0.5 - 8.0) / 8.0;
            let edge = 8.0 * (f64::from(EDGE) - middle);
            let [_, exact] = responses(filter, |x| f64::from(u8::from(x > edge)), &[edge]);
            let value = film.pixels()[8 * 16 + usize::from(column)].mean()[0];
            let bound = bound(filter, 1.0, SAMPLES);
            assert!((value - exact).abs() < bound, "{filter:?} column {column}: {value} for {exact}");
        }
    }
}
