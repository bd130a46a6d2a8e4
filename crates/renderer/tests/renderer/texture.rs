//! Texture filtering in images: noise, sharpness, and all texture slots.

use std::sync::LazyLock;

use canted_lbvh::Strategy;
use canted_obb::PrimId;
use canted_renderer::{BvhKind, HitFilter, Levels, Lod, Pattern, SceneBvh, SceneBvhConfig, Settings, Surfaces, View};
use canted_scene::{AlphaMode, Camera, Encoding, Light, Material, Mesh, Scene, TextureId, TextureRef, Wrap};
use canted_trace::{Hit, InstanceId, Intersect, Ray, Side};

use crate::common::{BruteForce, U, Vector, camera, film, film_of, floor, gray, mesh, scene, settings, texture};

const WIDTH: u32 = 32;
const HEIGHT: u32 = 24;
/// Texels per side of a field.
const FIELD: u32 = 8;
/// World units per side of a field.
const FIELD_WORLD: f32 = 0.5;

/// A chessboard that extends to the horizon under a white environment: rays see black or white, and the only noise is
/// that of the texture.
fn board() -> Scene {
    let side = 2 * FIELD;
    let texel =
        |i: u32| if (i / side / FIELD + i % side / FIELD).is_multiple_of(2) { [255; 4] } else { [0, 0, 0, 255] };
    let board = texture([side; 2], (0..side * side).map(texel).collect(), Encoding::Srgb, Wrap::Repeat);
    let half = 400.0;
    let mut plane = floor(half, 0.0, 0);
    let repeats = half / (2.0 * FIELD_WORLD);
    plane.uvs = Some(plane.positions.iter().map(|p| [p[0], p[2]].map(|x| x / half * repeats)).collect());
    let texture_ref = Some(TextureRef::new(TextureId(0)));
    let material = Material { base_color: [1.0; 3], base_color_texture: texture_ref, ..Material::default() };
    let environment = Some([1.0; 3].into());
    Scene { textures: vec![board], environment, ..scene(vec![plane], vec![material]) }
}

fn view(yaw_rad: f32) -> Camera {
    camera([0.1, 1.0, 0.2], [0.1 + 10.0 * yaw_rad.sin(), -1.5, 0.2 - 10.0 * yaw_rad.cos()], 60.0)
}

fn picture(lod: Lod, samples: u32, camera: &Camera) -> Vec<f64> {
    let settings = Settings { lod, pattern: Pattern::Sobol, ..settings(WIDTH, HEIGHT, samples, 0) };
    film(&board(), camera, &settings).pixels().iter().map(|pixel| pixel.mean()[0]).collect()
}

/// The converged image.
static REFERENCE: LazyLock<Vec<f64>> = LazyLock::new(|| picture(Lod::None, 4096, &view(0.0)));

/// Distance of the board at the center of each pixel, along the view; `None` above the horizon.
fn distances() -> Vec<Option<f64>> {
    let scene = board();
    let tracer = BruteForce::new(&scene);
    let view = View::new(&view(0.0), WIDTH, HEIGHT).unwrap();
    let middle = |i: u32| [f64::from(i % WIDTH) + 0.5, f64::from(i / WIDTH) + 0.5];
    (0..WIDTH * HEIGHT).map(|i| tracer.closest_hit(&view.ray(middle(i))).map(|hit| f64::from(hit.t))).collect()
}

fn mean_square(of: impl Iterator<Item = f64> + Clone) -> f64 {
    of.clone().map(|x| x * x).sum::<f64>() / of.count() as f64
}

/// Mean squared error of the pixels in a range of distances.
fn error(picture: &[f64], range: std::ops::Range<f64>) -> f64 {
    let pixels = picture.iter().zip(&*REFERENCE).zip(distances());
    let errors: Vec<f64> =
        pixels.filter(|(_, d)| d.is_some_and(|d| range.contains(&d))).map(|((a, b), _)| a - b).collect();
    assert!(errors.len() > 50, "{} pixels", errors.len());
    mean_square(errors.into_iter())
}

/// Distance beyond which a field is less than half a pixel high, so that the image is gray.
const FAR: f64 = 12.0;

/// Distance up to which a texel covers about a pixel or more.
const NEAR: f64 = 3.0;

#[test]
fn anisotropic_beats_isotropic_beats_unfiltered() {
    for samples in [4, 16, 64] {
        let [none, cone, aniso] =
            [Lod::None, Lod::Cone, Lod::Aniso].map(|lod| error(&picture(lod, samples, &view(0.0)), 0.0..f64::INFINITY));
        assert!(1.5 * aniso < cone && 1.5 * cone < none, "{samples} samples: {none} {cone} {aniso}");
    }
}

/// The blur of near texels is at most 0.02 at 16 samples, and vanishes with more samples.
#[test]
fn near_texels_are_sharp() {
    let [early, late] = [16, 64].map(|samples| error(&picture(Lod::Aniso, samples, &view(0.0)), 0.0..NEAR));
    assert!(early < 0.02 * 0.02 && 4.0 * late < early, "{early} {late}");
    // The test detects blur: that of an isotropic footprint.
    assert!(error(&picture(Lod::Cone, 4, &view(0.0)), 0.0..NEAR) > 0.04 * 0.04);
}

/// With one sample per pixel, the distant board changes by less than 0.03 when the camera rotates by a pixel; without
/// filtering it flickers between black and white.
#[test]
fn far_texels_do_not_flicker() {
    let change = |lod| {
        let [a, b] = [0.0, 60.0_f32.to_radians() / HEIGHT as f32].map(|yaw| picture(lod, 1, &view(yaw)));
        let far = a.iter().zip(&b).zip(distances()).filter(|(_, d)| d.is_some_and(|d| d > FAR));
        let changes: Vec<f64> = far.map(|((a, b), _)| a - b).collect();
        assert!(changes.len() > 50);
        mean_square(changes.into_iter()).sqrt()
    };
    assert!(change(Lod::Aniso) < 0.03 && change(Lod::Cone) < 0.03);
    assert!(change(Lod::None) > 0.5);
}

fn only_hit() -> Hit {
    Hit { t: 1.0, u: 0.25, v: 0.25, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front }
}

/// A triangle with a texture in each slot.
fn slots() -> Scene {
    let slot = |k| Some(TextureRef::new(TextureId(k)));
    let material = Material {
        base_color: [0.5, 1.0, 1.0],
        base_color_texture: slot(0),
        metallic: 0.5,
        roughness: 1.0,
        metallic_roughness_texture: slot(1),
        specular: 0.75,
        transmission: 0.5,
        transmission_texture: slot(2),
        ior: 1.25,
        emission: [2.0, 4.0, 6.0],
        emission_texture: slot(0),
        ..Material::default()
    };
    let triangle = mesh(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]], 0);
    let mesh = Mesh { uvs: Some(vec![[0.0; 2], [1.0, 0.0], [0.0, 1.0]]), ..triangle };
    let mut scene = scene(vec![mesh], vec![material]);
    scene.textures = vec![
        texture([1, 1], vec![[255, 128, 0, 255]], Encoding::Srgb, Wrap::Clamp),
        texture([1, 1], vec![[9, 51, 102, 255]], Encoding::Linear, Wrap::Clamp),
        texture([1, 1], vec![[204, 0, 0, 255]], Encoding::Linear, Wrap::Clamp),
    ];
    scene
}

/// Decoding rounds a texel once, each of its four weights rounds twice, their sum three times, the factor once.
const LOOKED_UP_ERROR: f64 = 8.0 * U;

#[test]
fn every_slot_reaches_the_surface() {
    let scene = slots();
    let front = Surfaces::new(&scene).at(&only_hit(), [0.0, 0.0, -1.0]);
    // The sRGB curve (IEC 61966-2-1) at byte 128.
    let green = ((128.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4);
    let near = |found: f32, want: f64| (f64::from(found) / want - 1.0).abs() <= LOOKED_UP_ERROR;
    let bsdf = front.bsdf;
    assert!(bsdf.base_color[0] == 0.5 && near(bsdf.base_color[1], green) && bsdf.base_color[2] == 0.0);
    assert!(near(bsdf.roughness, 0.2) && near(bsdf.metallic, 0.2) && near(bsdf.transmission, 0.4));
    assert_eq!((bsdf.specular, bsdf.ior, bsdf.thin_walled), (0.75, 1.25, false));
    assert!(front.emission[0] == 2.0 && near(front.emission[1], 4.0 * green) && front.emission[2] == 0.0);
    assert!(front.is_front && !bsdf.is_inside);
    let back = Surfaces::new(&scene).at(&only_hit(), [0.0, 0.0, 1.0]);
    assert!(!back.is_front && back.bsdf.is_inside);
}

#[test]
fn thin_and_opaque_materials_have_no_inside() {
    for spoil in [|m: &mut Material| m.thin_walled = true, |m: &mut Material| m.transmission = 0.0] {
        let mut scene = slots();
        spoil(&mut scene.materials[0]);
        assert!(!Surfaces::new(&scene).at(&only_hit(), [0.0, 0.0, 1.0]).bsdf.is_inside);
    }
}

#[test]
fn missing_coordinates_and_images_are_white() {
    let mut scene = slots();
    scene.meshes[0].uvs = None;
    let bare = Surfaces::new(&scene).at(&only_hit(), [0.0, 0.0, -1.0]);
    assert_eq!((bare.bsdf.base_color, bare.bsdf.roughness), ([0.5, 1.0, 1.0], 1.0));
    let mut scene = slots();
    for texture in &mut scene.textures {
        (texture.width, texture.height, texture.texels) = (0, 0, vec![]);
    }
    for lod in [Lod::None, Lod::Cone, Lod::Aniso] {
        let view = View::new(&camera([0.0, 0.0, 2.0], [0.0; 3], 40.0), 8, 8).unwrap();
        let cone = view.cone([4.0, 4.0], 0);
        let empty = Surfaces::with_lod(&scene, lod).at_time(&only_hit(), [0.0, 0.0, -1.0], 0.0, cone);
        assert_eq!(empty.bsdf.base_color, [0.5, 1.0, 1.0]);
    }
}

#[test]
fn vertex_colors_multiply() {
    let mut scene = scene(vec![floor(1.0, 0.0, 0)], vec![gray(0.5)]);
    scene.meshes[0].colors = Some(vec![[1.0, 0.5, 0.0, 1.0]; 4]);
    let surface = Surfaces::new(&scene).at(&only_hit(), [0.0, -1.0, 0.0]);
    assert_eq!(surface.bsdf.base_color, [0.5, 0.25, 0.0]);
}

/// A scene without textures does not depend on the level of detail.
#[test]
fn scenes_without_textures_do_not_depend_on_lod() {
    let stage = Scene { environment: Some([1.0; 3].into()), ..scene(vec![floor(4.0, 0.0, 0)], vec![gray(0.5)]) };
    let camera = camera([0.0, 2.0, 5.0], [0.0; 3], 50.0);
    let pictures = [Lod::None, Lod::Cone, Lod::Aniso].map(|lod| {
        let settings = Settings { lod, ..settings(16, 16, 4, 2) };
        film(&stage, &camera, &settings).picture().pixels
    });
    assert!(pictures[0] == pictures[1] && pictures[0] == pictures[2]);
}

/// A pixel's cone is as wide as the pixel everywhere in the image: the root of the area between the rays of its
/// corners.
#[test]
fn cones_match_their_pixels() {
    let view = View::new(&camera([1.0, 2.0, 3.0], [0.0; 3], 70.0), 64, 48).unwrap();
    for [x, y] in [[32.0, 24.0], [0.5, 0.5], [63.5, 20.5]] {
        let at = |dx: f64, dy: f64| view.ray([x + dx, y + dy]).direction.map(f64::from);
        let step = 0.5;
        let across: Vector = std::array::from_fn(|k| at(step, 0.0)[k] - at(-step, 0.0)[k]);
        let along: Vector = std::array::from_fn(|k| at(0.0, step)[k] - at(0.0, -step)[k]);
        let area = crate::common::cross(across, along);
        let width = view.cone([x, y], 0).grown(1.0).width();
        let expected = crate::common::dot(area, area).sqrt().sqrt();
        // A quotient of differences over a pixel has an error of the square of its angle.
        assert!((width / expected - 1.0).abs() < width * width, "{x} {y}: {width} {expected}");
    }
}

// Stochastic alpha: blended surfaces let rays pass independently at random.

/// Stacked sheets from y = 1 up with the given alphas, over a white floor; a white light shines straight down.
fn sheets(alphas: &[f32]) -> Scene {
    let sheet = |alpha: &f32| Material { alpha_mode: AlphaMode::Blend, alpha: *alpha, ..gray(0.0) };
    let mut meshes = vec![floor(4.0, 0.0, 0)];
    let mut height = 0.0;
    for material in (1..).take(alphas.len()) {
        height += 1.0;
        meshes.push(floor(4.0, height, material));
    }
    let materials = std::iter::once(gray(1.0)).chain(alphas.iter().map(sheet)).collect();
    let sun = Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [std::f32::consts::PI; 3] };
    Scene { lights: vec![sun], ..scene(meshes, materials) }
}

const N: u32 = 40_000;

/// Fraction of `N` rays with independent keys that pass all sheets.
fn passing(scene: &Scene) -> f64 {
    let (tracer, surfaces) = (BruteForce::new(scene), Surfaces::new(scene));
    let all = HitFilter::new(&surfaces);
    let ray = Ray { t_max: 9.5, ..Ray::new([0.3, 10.0, 0.2], [0.0, -1.0, 0.0]) };
    let n = (0..N).filter(|&number| !tracer.occluded_with(&ray, &mut all.keyed(number))).count();
    n as f64 / f64::from(N)
}

/// Five standard deviations of the mean of `n` independent trials: false alarms have a probability of 1 in two million.
fn bound(fraction: f64, n: f64) -> f64 {
    5.0 * (fraction * (1.0 - fraction) / n).sqrt()
}

#[test]
fn samples_of_a_pixel_are_stratified_over_alpha() {
    let scene = sheets(&[0.375]);
    let (tracer, surfaces) = (BruteForce::new(&scene), Surfaces::new(&scene));
    let ray = Ray { t_max: 9.5, ..Ray::new([0.3, 10.0, 0.2], [0.0, -1.0, 0.0]) };
    for pixel in 0..500 {
        let query = HitFilter::new(&surfaces).keyed(pixel);
        let passing = |samples: std::ops::Range<u32>| {
            samples.filter(|&sample| !tracer.occluded_with(&ray, &mut query.sampled(sample))).count()
        };
        // Five of eight, as 1 - 0.375 = 5 / 8.
        assert_eq!([passing(0..8), passing(8..16), passing(64..96)], [5, 5, 20], "pixel {pixel}");
    }
    // Two sheets are independent: over many pixels the mean of their products is the product of their means.
    let scene = sheets(&[0.5, 0.5]);
    let (tracer, surfaces) = (BruteForce::new(&scene), Surfaces::new(&scene));
    let n = (0..N)
        .filter(|&n| !tracer.occluded_with(&ray, &mut HitFilter::new(&surfaces).keyed(n / 16).sampled(n % 16)))
        .count() as f64;
    assert!((n / f64::from(N) - 0.25).abs() < bound(0.25, f64::from(N)), "{n} of {N}");
}

#[test]
fn transmittance_is_one_minus_alpha() {
    for alpha in [0.0, 0.1, 0.25, 0.5, 0.9, 1.0] {
        let expected = 1.0 - f64::from(alpha);
        let fraction = passing(&sheets(&[alpha]));
        assert!((fraction - expected).abs() <= bound(expected, f64::from(N)), "{alpha}: {fraction}");
    }
}

#[test]
fn stacked_sheets_are_independent() {
    for alphas in [&[0.5, 0.5][..], &[0.3, 0.6], &[0.5, 0.2, 0.4]] {
        let expected: f64 = alphas.iter().map(|&alpha| 1.0 - f64::from(alpha)).product();
        let fraction = passing(&sheets(alphas));
        assert!((fraction - expected).abs() <= bound(expected, f64::from(N)), "{alphas:?}: {fraction}");
    }
}

#[test]
fn bound_detects_error_of_two_percent() {
    let fraction = passing(&sheets(&[0.5]));
    assert!((fraction - 0.52).abs() > bound(0.52, f64::from(N)));
}

/// Camera rays and shadow rays have independent keys: the pixel is the product of both transmittances.
#[test]
fn camera_and_shadow_rays_are_independent() {
    let (scene, alpha) = (sheets(&[0.4]), 0.4_f64);
    let tracer = BruteForce::new(&scene);
    let view = camera([0.0, 6.0, 0.0], [0.0; 3], 10.0);
    let settings = settings(16, 16, 64, 0);
    let film = film_of(&scene, &tracer, &view, &settings);
    let mean = film.pixels().iter().map(|pixel| pixel.mean()[0]).sum::<f64>() / 256.0;
    // The ray from the floor sees black: sheet or environment.
    let expected = (1.0 - alpha) * (1.0 - alpha);
    assert!((mean - expected).abs() <= bound(expected, 256.0 * 64.0), "{mean} {expected}");
}

#[test]
fn pictures_do_not_depend_on_the_bvh() {
    let scene = sheets(&[0.4, 0.7]);
    let view = camera([1.0, 6.0, 0.5], [0.0; 3], 60.0);
    let settings = settings(24, 16, 4, 1);
    let picture = |config: &SceneBvhConfig| {
        film_of(&scene, &SceneBvh::build(&scene, config).unwrap(), &view, &settings).picture().pixels
    };
    let first = picture(&SceneBvhConfig { levels: Levels::One, ..SceneBvhConfig::default() });
    for levels in [Levels::One, Levels::Two] {
        let (wide, binary) = ((BvhKind::Wide, Strategy::Aabb), |volumes| (BvhKind::Bvh2, volumes));
        for (kind, volumes) in [wide, binary(Strategy::Aabb), binary(Strategy::PcaBounded)] {
            let config = SceneBvhConfig { levels, kind, volumes, ..SceneBvhConfig::default() };
            assert!(picture(&config) == first, "{config:?}");
        }
    }
}

#[test]
fn alpha_multiplies_material_and_vertex_alpha() {
    let mut scene = sheets(&[0.8]);
    scene.meshes[1].colors = Some(vec![[0.0, 0.0, 0.0, 0.25]; 4]);
    let expected = 1.0 - 0.8 * 0.25;
    assert!((passing(&scene) - expected).abs() <= bound(expected, f64::from(N)));
}
