//! The path integrator compared with closed forms, and with the hybrid integrator where both compute the same light.

use std::f64::consts::{FRAC_PI_4, PI, SQRT_2};

use canted_film::Film;
use canted_obb::Affine;
use canted_renderer::{Integrator, Settings, View};
use canted_scene::{Camera, Instance, Light, Material, Mesh, Scene};

use crate::common::{
    U, Vector, camera, cuboid, dot, film, floor, gray, inside_out, mesh, parallelogram, place, probe, scene, settings,
    sphere, under, unit,
};

/// Allowed deviation of a mean in standard deviations: one false alarm in ten million.
const SIGMAS: f64 = 5.3;

fn paths(n: u32, samples: u32, bounces: u32) -> Settings {
    Settings { integrator: Integrator::Path, ..settings(n, n, samples, bounces) }
}

/// Mean over all pixels of each channel, with the standard deviation from the spread of the samples.
fn mean_of(film: &Film) -> ([f64; 3], [f64; 3]) {
    assert_eq!(film.n_dropped(), 0);
    let n = film.pixels().len() as f64;
    let mut mean = [0.0; 3];
    let mut variance = [0.0; 3];
    for pixel in film.pixels() {
        let (m, v) = (pixel.mean(), pixel.variance_of_mean());
        for k in 0..3 {
            mean[k] += m[k] / n;
            variance[k] += v[k] / (n * n);
        }
    }
    (mean, variance.map(f64::sqrt))
}

/// Checks that the mean of an image is `expected` in every channel to within its noise, which is at most `precision` of
/// it.
#[track_caller]
fn check(scene: &Scene, view: &Camera, settings: &Settings, expected: f64, precision: f64) {
    let (mean, deviation) = mean_of(&film(scene, view, settings));
    for k in 0..3 {
        assert!(SIGMAS * deviation[k] <= precision * expected, "too noisy: {deviation:?} of {mean:?}");
        // A hundred roundings of f32 in addition to the noise.
        let bound = SIGMAS * deviation[k] + 100.0 * f64::from(f32::EPSILON) * expected;
        assert!((mean[k] - expected).abs() <= bound, "{mean:?} ± {deviation:?} for {expected}");
    }
}

fn white_sky(object: canted_scene::Mesh, material: Material) -> Scene {
    under([1.0; 3], scene(vec![object], vec![material]))
}

#[test]
fn convex_object_in_a_white_furnace_shows_its_albedo() {
    let view = camera([2.0, 3.0, 4.0], [0.0; 3], 15.0);
    for albedo in [1.0, 0.625] {
        let furnace = white_sky(sphere([0.0; 3], 1.0, 3, 0), gray(albedo));
        for bounces in [0, 1, 32] {
            check(&furnace, &view, &paths(16, 64, bounces), f64::from(albedo), 2e-3);
        }
    }
}

/// Shading normals that differ from the geometric normals lose no energy and let no ray into the object.
#[test]
fn smooth_normals_conserve_energy() {
    let mut object = sphere([0.0; 3], 1.0, 1, 0);
    object.normals = Some(object.positions.clone());
    let furnace = white_sky(object, gray(0.75));
    check(&furnace, &camera([2.0, 3.0, 4.0], [0.0; 3], 10.0), &paths(16, 256, 8), 0.75, 2e-3);
}

/// Inside a closed object that emits 1 and reflects `a`, `b` bounces give `1 + a + ... + a^b`.
#[test]
fn closed_emitter_gives_the_geometric_series() {
    let emissive = Material { emission: [1.0; 3], ..gray(0.5) };
    for shell in [inside_out(sphere([0.0; 3], 1.0, 2, 0)), cuboid([-1.0; 3], [1.0, 2.0, 3.0], 0)] {
        // The environment would be visible through any leak.
        let room = under([100.0; 3], scene(vec![shell], vec![emissive.clone()]));
        let view = camera([0.1, 0.2, 0.3], [0.5, 0.1, -0.4], 100.0);
        for (bounces, expected) in [(0, 1.0), (1, 1.5), (2, 1.75), (5, 1.968_75), (64, 2.0)] {
            check(&room, &view, &paths(12, 128, bounces), expected, 1e-2);
        }
    }
}

/// A closed object of clear glass under a constant environment is invisible.
#[test]
fn clear_glass_conserves_energy() {
    let glass = Material { base_color: [1.0; 3], roughness: 0.0, specular: 1.0, transmission: 1.0, ..gray(1.0) };
    let view = camera([2.0, 3.0, 4.0], [0.0; 3], 25.0);
    for (ior, object) in [(1.5, sphere([0.0; 3], 1.0, 3, 0)), (2.4, cuboid([-1.0; 3], [1.0; 3], 0))] {
        let furnace = white_sky(object.clone(), Material { ior, ..glass.clone() });
        check(&furnace, &view, &paths(12, 128, 4096), 1.0, 2e-2);
        let sheet = white_sky(object, Material { ior, thin_walled: true, ..glass.clone() });
        check(&sheet, &view, &paths(12, 128, 4096), 1.0, 2e-2);
    }
}

/// Reflectance, throughput, environment radiance and filter weight round once each. At normal incidence Schlick's term
/// is below the fifth power of the field of view and adds nothing.
const MIRRORED_ERROR: f64 = 4.0 * U;

/// A polished metal under a constant environment shows its reflectance, up to white at grazing angles.
#[test]
fn mirror_shows_its_reflectance() {
    let metal = Material { metallic: 1.0, roughness: 0.0, ..gray(0.5) };
    let (mean, _) =
        mean_of(&film(&white_sky(floor(1.0, 0.0, 0), metal), &camera([0.0, 5.0, 0.0], [0.0; 3], 1.0), &paths(4, 4, 8)));
    assert!(mean.iter().all(|x| (x / 0.5 - 1.0).abs() <= MIRRORED_ERROR), "{mean:?}");
}

/// For Lambertian surfaces without the ambient term, both integrators compute the same light.
#[test]
fn path_and_hybrid_agree_on_lambertian_surfaces() {
    let bodies = vec![
        floor(5.0, 0.0, 0),
        cuboid([-1.0, 0.0, -1.0], [0.0, 2.0, 0.0], 1),
        sphere([1.0, 0.5, 0.5], 0.5, 2, 2),
        floor(0.5, 3.0, 3),
    ];
    let lamp = Material { emission: [4.0, 3.0, 2.0], ..gray(0.5) };
    let mut stage = under([0.3, 0.4, 0.6], scene(bodies, vec![gray(0.5), gray(0.8), gray(0.3), lamp]));
    stage.lights = vec![
        Light::Sun { direction: [0.0, -0.6, 0.8], irradiance: [1.0, 0.9, 0.8] },
        Light::Point { position: [2.0, 2.0, 2.0], intensity: [3.0; 3] },
    ];
    let view = camera([4.0, 3.0, 5.0], [0.0, 0.5, 0.0], 40.0);
    for bounces in [0, 1, 3] {
        let (path, path_deviation) = mean_of(&film(&stage, &view, &paths(16, 256, bounces)));
        let hybrid = Settings { integrator: Integrator::Hybrid, ..paths(16, 512, bounces) };
        let (hybrid, hybrid_deviation) = mean_of(&film(&stage, &view, &hybrid));
        for k in 0..3 {
            let bound = SIGMAS * path_deviation[k].hypot(hybrid_deviation[k]);
            assert!(bound < 0.02 * path[k], "too noisy");
            assert!((path[k] - hybrid[k]).abs() < bound, "{bounces}: {path:?} and {hybrid:?} ± {bound}");
        }
    }
}

/// The test above detects missing light.
#[test]
#[should_panic(expected = "for 0.625")]
fn test_detects_missing_light() {
    let furnace = white_sky(sphere([0.0; 3], 1.0, 3, 0), gray(0.62));
    check(&furnace, &camera([2.0, 3.0, 4.0], [0.0; 3], 15.0), &paths(16, 64, 1), 0.625, 2e-3);
}

// Facing mirrors, and the limit of smooth metals.

/// Half the field of view of a probe, along its diagonal.
const HALF_FIELD_RAD: f64 = 0.01 / 180.0 * PI / SQRT_2;

fn mirrored_paths(settings: Settings) -> Settings {
    Settings { integrator: Integrator::Path, ..settings }
}

fn metal(base_color: [f32; 3], roughness: f32) -> Material {
    Material { base_color, metallic: 1.0, roughness, ..Material::default() }
}

fn emissive(emission: [f32; 3]) -> Material {
    Material { emission, ..gray(0.0) }
}

const LEFT: [f32; 3] = [1.0, 0.8, 0.25];
const RIGHT: [f32; 3] = [1.0, 0.5, 0.9];

/// Mirrors in the planes x = 0 and x = 1 up to y = 1, and a ceiling at y = 2.
fn facing(ceiling: Option<Material>) -> Scene {
    let mirror = |x, material| parallelogram([x, -10.0, -10.0], [0.0, 11.0, 0.0], [0.0, 0.0, 20.0], material);
    let mut meshes = vec![mirror(0.0, 0), mirror(1.0, 1)];
    meshes.extend(ceiling.iter().map(|_| floor(20.0, 2.0, 2)));
    scene(meshes, [metal(LEFT, 0.0), metal(RIGHT, 0.0)].into_iter().chain(ceiling).collect())
}

/// The radiance from the center between both mirrors after `k` reflections, the first one on the right.
///
/// Unfolded, the line rises by 1/k from each mirror to the next, hits the last one at y = 1 - 1/(2k) and leaves.
fn after(k: u8, scene: &Scene, bounces: u32) -> Vector {
    let target = if k == 0 { [0.5, 1.0, 0.0] } else { [1.0, 0.5 / f32::from(k), 0.0] };
    probe(scene, [0.5, 0.0, 0.0], target, mirrored_paths(settings(1, 1, 4, bounces)))
}

/// Factor of a channel after `k` reflections, by Schlick's formula.
fn reflectance(k: u8, channel: usize) -> f64 {
    let cosine = f64::from(k) / f64::from(k).hypot(1.0);
    let of_one = |i: u8| {
        let color = f64::from(if i.is_multiple_of(2) { RIGHT[channel] } else { LEFT[channel] });
        color + (1.0 - color) * (1.0 - cosine).powi(5)
    };
    (0..k).map(of_one).product()
}

/// Checks `value` after `k` reflections, to within the relative error `footprint` plus the error of each reflection.
#[track_caller]
fn check_mirrors(value: Vector, k: u8, expected: Vector, footprint: f64) {
    // The derivative of Schlick's term is 5·(1 - cosθ)⁴·sinθ, at most 0.027 up to 45 degrees, for reflectances of 0.25
    // or more; in f32 each reflection adds less than eight roundings.
    let of_each = 0.027 * HALF_FIELD_RAD / 0.25 + 8.0 * f64::from(f32::EPSILON);
    let bound = footprint + f64::from(k + 1) * of_each;
    for channel in 0..3 {
        let (value, expected) = (value[channel], expected[channel]);
        assert!((value - expected).abs() <= bound * expected, "{k} reflections: {value} for {expected}");
    }
}

#[test]
fn facing_mirrors_reflect_a_lamp_once_per_bounce() {
    let lamp = [2.0, 3.0, 5.0];
    let lit = facing(Some(emissive(lamp)));
    for k in 0..=3 {
        let expected = std::array::from_fn(|channel| f64::from(lamp[channel]) * reflectance(k, channel));
        for bounces in 0..=4 {
            let value = after(k, &lit, bounces);
            // The lamp is the surface after k mirrors.
            if bounces < u32::from(k) {
                assert_eq!(value, [0.0; 3], "{k} reflections in {bounces} bounces");
            } else {
                check_mirrors(value, k, expected, 0.0);
            }
        }
    }
}

/// The environment is not a surface: the ray that leaves the last mirror adds it.
#[test]
fn facing_mirrors_reflect_the_environment_one_bounce_earlier() {
    let open = under([0.5, 1.0, 4.0], facing(None));
    for k in 0..=3 {
        let expected = std::array::from_fn(|channel| [0.5, 1.0, 4.0][channel] * reflectance(k, channel));
        for bounces in 0..=3 {
            let value = after(k, &open, bounces);
            if bounces + 1 < u32::from(k) {
                assert_eq!(value, [0.0; 3], "{k} reflections in {bounces} bounces");
            } else {
                check_mirrors(value, k, expected, 0.0);
            }
        }
    }
}

/// Diffuse surfaces seen in mirrors: `ρ·I/(π·h²)` below a light at distance h, times the reflectances.
#[test]
fn mirrors_multiply_the_reflected_radiance() {
    let paint = [0.2_f32, 0.4, 0.8];
    let mut lit = facing(Some(Material { base_color: paint, ..Material::default() }));
    for k in 0..=3_u8 {
        // Where the line hits the ceiling, folded back; the light is half a unit below.
        let x = if k % 2 == 1 { 0.5 - f32::from(k) } else { 0.5 + f32::from(k) };
        lit.lights = vec![Light::Point { position: [x, 1.5, 0.0], intensity: [3.0; 3] }];
        let expected =
            std::array::from_fn(|channel| f64::from(paint[channel]) * 3.0 / (PI * 0.25) * reflectance(k, channel));
        // Next to the light its irradiance falls by 3/2 of the squared distance over h. The line is 2·√(k² + 1) long
        // and tilted by the same factor.
        let stretch = 2.0 * (f64::from(k).powi(2) + 1.0) * HALF_FIELD_RAD;
        check_mirrors(after(k, &lit, k.into()), k, expected, 1.5 * (stretch / 0.5).powi(2));
        if k > 0 {
            assert_eq!(after(k, &lit, u32::from(k) - 1), [0.0; 3], "{k}");
        }
    }
}

/// Three lamps of different colors without symmetry, at positive x and y.
fn lamps() -> [Mesh; 3] {
    let triangle = vec![[1.6, 1.5, 0.4], [2.2, 1.6, 0.0], [1.7, 2.1, 0.1]];
    [
        parallelogram([1.0, 1.0, 0.2], [1.2, 0.0, 0.0], [0.0, 0.3, 0.0], 1),
        parallelogram([1.0, 1.3, 0.2], [0.3, 0.0, 0.0], [0.0, 0.9, 0.1], 2),
        mesh(triangle, vec![[0, 1, 2]], 3),
    ]
}

fn of_lamps(meshes: impl IntoIterator<Item = Mesh>) -> Scene {
    let lamps = [[1.0, 0.5, 0.0], [0.0, 2.0, 0.25], [0.5, 0.0, 4.0]].map(emissive);
    scene(meshes.into_iter().collect(), std::iter::once(metal([1.0; 3], 0.0)).chain(lamps).collect())
}

/// A corner of two white mirrors shows the images of the lamps: those of one reflection with one bounce, those rotated
/// by half a turn with two, and nothing more with three. White mirrors are exact.
#[test]
fn perpendicular_mirrors_show_four_images() {
    let view = camera([4.0, 3.0, 8.0], [0.0; 3], 36.0);
    let of = |scene: &Scene, bounces| film(scene, &view, &mirrored_paths(settings(40, 40, 4, bounces)));
    let walls = [
        parallelogram([0.0, 0.0, -50.0], [0.0, 100.0, 0.0], [0.0, 0.0, 100.0], 0),
        parallelogram([0.0, 0.0, -50.0], [0.0, 0.0, 100.0], [100.0, 0.0, 0.0], 0),
    ];
    let corner = of_lamps(lamps().into_iter().chain(walls));
    let mut n_lit = vec![];
    for bounces in 0..=3 {
        let mut unfolded = of_lamps(lamps());
        let signs = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
        let images = signs.into_iter().filter(|[x, y]| [x, y].into_iter().filter(|&&s| s < 0.0).count() <= bounces);
        unfolded.instances = images.flat_map(images_of).collect();
        let (found, expected) = (of(&corner, u32::try_from(bounces).unwrap()), of(&unfolded, 0));
        assert!(found.pixels() == expected.pixels(), "{bounces} bounces");
        n_lit.push(found.pixels().iter().filter(|pixel| pixel.sum != [0.0; 3]).count());
    }
    assert!(n_lit[0] > 20 && n_lit[1] > 2 * n_lit[0] && n_lit[2] > n_lit[1] + 20 && n_lit[3] == n_lit[2], "{n_lit:?}");
}

/// The lamps with x and y scaled by these factors.
fn images_of([x, y]: [f32; 2]) -> [Instance; 3] {
    let columns = [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];
    [0, 1, 2].map(|lamp| place(lamp, Affine { columns }))
}

/// The hybrid integrator treats all surfaces as Lambertian, including mirrors.
#[test]
fn hybrid_integrator_treats_mirrors_as_diffuse() {
    let stage = under(
        [0.3, 0.4, 0.6],
        scene(vec![floor(5.0, 0.0, 0), floor(1.0, 3.0, 1)], vec![metal(RIGHT, 0.0), emissive([3.0; 3])]),
    );
    let view = camera([4.0, 2.0, 5.0], [0.0; 3], 40.0);
    let of = |stage: &Scene, settings: &Settings| film(stage, &view, settings);
    let mut painted = stage.clone();
    painted.materials[0] = Material { base_color: RIGHT, ..Material::default() };
    let hybrid = settings(16, 16, 4, 2);
    assert!(of(&stage, &hybrid) == of(&painted, &hybrid), "the hybrid integrator treats a mirror as diffuse");
    assert!(
        of(&stage, &mirrored_paths(hybrid)) != of(&painted, &mirrored_paths(hybrid)),
        "the path integrator reflects in a mirror"
    );
}

const COLUMNS: u32 = 8;
const ROWS: u32 = 25;

/// A metal floor viewed at 45 degrees from height 1, and an infinite lamp whose lower edge is reflected in the center
/// row.
fn edge_in_metal(roughness: f32, fov_degrees: f32) -> (Film, Camera) {
    let lamp = parallelogram([10.0, 9.0, -500.0], [0.0, 1000.0, 0.0], [0.0, 0.0, 1000.0], 1);
    let stage = scene(vec![floor(50.0, 0.0, 0), lamp], vec![metal([1.0; 3], roughness), emissive([1.0; 3])]);
    let view = camera([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], fov_degrees);
    (film(&stage, &view, &mirrored_paths(settings(COLUMNS, ROWS, 512, 1))), view)
}

/// Minimum and maximum signed angles by which the mirrored rays through the corners of a row miss the edge.
fn angles(view: &Camera, row: u32) -> [f64; 2] {
    let view = View::new(view, COLUMNS, ROWS).unwrap();
    let corners = [[0, row], [COLUMNS, row], [0, row + 1], [COLUMNS, row + 1]];
    let angles = corners.map(|corner| {
        let [x, y, z] = view.ray(corner.map(f64::from)).direction.map(f64::from);
        // The plane of the mirrored eye, at y = -1, and the edge, at x = 10 and y = 9.
        dot([x, -y, z], unit([-1.0, 1.0, 0.0])).asin()
    });
    [angles.into_iter().fold(FRAC_PI_4, f64::min), angles.into_iter().fold(-FRAC_PI_4, f64::max)]
}

/// Rows that differ from the mirror by more than facets of width `alpha` can scatter across the edge, and their total
/// number.
///
/// In GGX the fraction `α²/(α² + x²)` of facets has slopes above x, and a facet rotates a ray by at most twice its own
/// angle. This overestimates what crosses an edge at twice the angle: half of all facets tilt the other way, and those
/// that tilt away from the viewer are at most twice as visible as the others, for slopes below 0.8 at 45 degrees.
/// `10·α²` is lost below the horizon (facets steeper than 19 degrees) or masked.
fn rows_off((film, view): &(Film, Camera), alpha: f64) -> (usize, usize) {
    let (mut n_off, mut n_rows) = (0, 0);
    for (row, pixels) in (0..).zip(film.pixels().chunks(COLUMNS as usize)) {
        let [least, most] = angles(view, row);
        if least < 0.0 && most > 0.0 {
            continue;
        }
        let (mirrored, angle) = if least >= 0.0 { (1.0, least) } else { (0.0, -most) };
        let mean = pixels.iter().map(|pixel| pixel.mean()[0]).sum::<f64>() / f64::from(COLUMNS);
        let variance = pixels.iter().map(|pixel| pixel.variance_of_mean()[0]).sum::<f64>();
        let noise = 5.3 * variance.sqrt() / f64::from(COLUMNS);
        let turned = alpha.powi(2) / (alpha.powi(2) + (0.5 * angle).tan().powi(2));
        n_rows += 1;
        n_off += usize::from((mean - mirrored).abs() > turned + 10.0 * alpha.powi(2) + noise);
    }
    (n_off, n_rows)
}

#[test]
fn smooth_metals_converge_to_the_mirror() {
    const WIDE: f32 = 12.0;
    let mirror = edge_in_metal(0.0, WIDE);
    assert_eq!(rows_off(&mirror, 0.0), (0, ROWS as usize - 1));
    for roughness in [0.125_f32, 0.0625, 0.031_25] {
        let alpha = f64::from(roughness).powi(2);
        // The entire image, and the edge with rows a third as wide as the lobe.
        let [far, near] = [WIDE, 64.0 * WIDE * roughness * roughness].map(|fov| edge_in_metal(roughness, fov));
        assert_eq!((rows_off(&far, alpha).0, rows_off(&near, alpha).0), (0, 0), "{roughness}");
        // A bound for facets half as rough is violated.
        assert!(rows_off(&near, alpha / 4.0).0 > 0, "{roughness}");
    }
    // Below roughness 1/32 the surface is a perfect mirror.
    assert!(edge_in_metal(0.031_249, WIDE).0 == mirror.0, "smooth metals converge to the mirror");
}
