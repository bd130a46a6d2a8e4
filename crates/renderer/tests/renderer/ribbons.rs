//! Ribbons that face the ray, their opacity, and textures along curves.

use canted_film::Pixel;
use canted_renderer::{Cone, HitFilter, Integrator, Levels, Lod, SceneBvh, Settings, Surfaces};
use canted_scene::{
    AlphaMode, CurveSegments, CurveShape, Curves, Encoding, Hair as Source, Magnification, Material, Mesh, Scene,
    TextureId, TextureRef, Wrap,
};
use canted_trace::{Intersect as _, Ray};

use super::common::{
    Vector, camera, dot, film_of, gray, mesh, prepared, rays_from_all_around, scene, settings, sub, texture, under,
    unit,
};

fn strand(positions: Vec<[f32; 3]>, radius: f32, segments: CurveSegments, shape: CurveShape) -> Mesh {
    let curves = Curves { radii: vec![radius; positions.len()], segments, shape };
    Mesh { curves: Some(curves), ..mesh(positions, vec![], 0) }
}

/// Two straight segments along x, of which the first has a quarter of the length, and an arch.
fn line(shape: CurveShape) -> Mesh {
    let points = vec![[-2.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    strand(points, 0.5, CurveSegments::Linear(vec![[0, 1], [1, 2]]), shape)
}

fn arch(shape: CurveShape) -> Mesh {
    let points = vec![[-1.5, -0.5, 0.0], [-0.5, 1.0, 0.5], [0.5, 1.0, -0.5], [1.5, -0.5, 0.0]];
    strand(points, 0.2, CurveSegments::Cubic(vec![[0, 1, 2, 3]]), shape)
}

/// A ray down to a point of the plane of the line.
fn down(x: f32, y: f32) -> Ray {
    Ray::new([x, y, 5.0], [0.0, 0.0, -1.0])
}

/// Points lie on the ray, and on the plane through the center that contains the curve and the line across; rays that leave do not hit the same part.
#[test]
fn ribbons_are_flat_and_face_the_ray() {
    let mut n_hits = 0;
    for shape in [line(CurveShape::Ribbon), arch(CurveShape::Ribbon)] {
        let stage = scene(vec![shape], vec![gray(0.5)]);
        let (bvh, surfaces) = (prepared(&stage, Levels::Auto), Surfaces::new(&stage));
        for ray in rays_from_all_around(600) {
            let Some(hit) = bvh.closest_hit(&ray) else { continue };
            n_hits += 1;
            let surface = surfaces.at_ray(&hit, &ray, Cone::ZERO);
            let direction = unit(ray.direction.map(f64::from));
            let off = sub(surface.position, ray.origin.map(f64::from));
            assert!((dot(off, off) - dot(off, direction).powi(2)).abs() < 1e-10, "{ray:?}");
            let along = unit(surface.along.unwrap());
            assert!(dot(along, surface.normal).abs() < 1e-9 && surface.is_front);
            assert!(dot(surface.normal, direction) < 0.0);
            // In the plane of the curve and the line across, as seen along the ray.
            let across = dot(along, direction);
            assert!((dot(surface.normal, direction).powi(2) + across * across - 1.0).abs() < 1e-9);
        }
    }
    assert!(n_hits > 100, "{n_hits}");
}

fn furnace(mesh: Mesh, material: Material, settings: &Settings) -> Vec<Vector> {
    let stage = under([1.0; 3], scene(vec![mesh], vec![material]));
    let bvh = prepared(&stage, Levels::Auto);
    let film = film_of(&stage, &bvh, &camera([0.2, 0.3, 4.0], [-0.2, 0.0, 0.0], 4.0), settings);
    assert_eq!(film.n_dropped(), 0);
    film.pixels().iter().map(Pixel::mean).collect()
}

/// A straight ribbon does not shade itself: rays that leave it never hit it again, at joints neither.
#[test]
fn straight_ribbons_in_a_white_furnace_show_their_albedo() {
    for integrator in [Integrator::Hybrid, Integrator::Path] {
        let settings = Settings { integrator, ..settings(10, 10, 16, 3) };
        for pixel in furnace(line(CurveShape::Ribbon), gray(0.625), &settings) {
            assert!(pixel.iter().all(|x| (x - 0.625).abs() < 1e-5), "{pixel:?}");
        }
    }
}

/// White hair on a ribbon vanishes, as on a tube.
#[test]
fn white_ribbons_of_hair_vanish_in_a_white_furnace() {
    let source = Source { is_on: true, ..Source::default() };
    let white = Material { base_color: [1.0; 3], ior: 1.55, hair: Some(Box::new(source)), ..Material::default() };
    let settings = Settings { integrator: Integrator::Path, ..settings(8, 8, 64, 40) };
    let pixels = furnace(line(CurveShape::Ribbon), white, &settings);
    let mean = pixels.iter().map(|pixel| pixel[0]).sum::<f64>() / pixels.len() as f64;
    assert!((mean - 1.0).abs() < 0.01, "{mean}");
}

/// Hair shades a ribbon as the tube that it replaces: the same normals across the width.
#[test]
fn ribbons_of_hair_have_the_normals_of_tubes() {
    let hair = Material { hair: Some(Box::new(Source { is_on: true, ..Source::default() })), ..Material::default() };
    let normal = |shape: CurveShape, material: &Material, y: f32| {
        let stage = scene(vec![line(shape)], vec![material.clone()]);
        let ray = down(0.5, y);
        let hit = prepared(&stage, Levels::Auto).closest_hit(&ray).unwrap();
        Surfaces::new(&stage).at_ray(&hit, &ray, Cone::ZERO).normal
    };
    for y in [-0.4, -0.1, 0.0, 0.3, 0.45] {
        let off = sub(normal(CurveShape::Ribbon, &hair, y), normal(CurveShape::Tube, &hair, y));
        assert!(dot(off, off) < 1e-10, "{y}");
        assert_eq!(normal(CurveShape::Ribbon, &gray(0.5), y), [0.0, 0.0, 1.0]);
    }
}

/// A smooth strand of three cubic segments in front of the camera, emitting, before black.
fn glowing(alpha: f32) -> (Scene, SceneBvh) {
    let p = |x: f32| [x, 0.1 * x * x, 0.0];
    // Bézier control points of the parabola: the tangent at a joint is the same on both sides.
    let segment = |a: f32, b: f32| {
        let (from, to, third) = (p(a), p(b), (b - a) / 3.0);
        [from, [a + third, from[1] + 0.2 * a * third, 0.0], [b - third, to[1] - 0.2 * b * third, 0.0], to]
    };
    let points = [segment(-3.0, -1.0), segment(-1.0, 1.0), segment(1.0, 3.0)].concat();
    let list = vec![[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]];
    let mesh = strand(points, 0.4, CurveSegments::Cubic(list), CurveShape::Ribbon);
    let light = Material { emission: [1.0; 3], alpha, alpha_mode: AlphaMode::Blend, ..gray(0.0) };
    let stage = scene(vec![mesh], vec![light]);
    let bvh = prepared(&stage, Levels::Auto);
    (stage, bvh)
}

/// A ribbon of some opacity shows that part of its light, everywhere the same: joints are covered once.
#[test]
fn opacity_is_that_of_the_material_at_joints_too() {
    let settings = Settings { integrator: Integrator::Path, ..settings(24, 2, 64, 2) };
    for alpha in [0.25, 0.5, 1.0] {
        let (stage, bvh) = glowing(alpha);
        // Around the joint at x = 1, within the width.
        let film = film_of(&stage, &bvh, &camera([1.0, 0.1, 6.0], [1.0, 0.1, 0.0], 0.5), &settings);
        let means: Vec<f64> = film.pixels().iter().map(|pixel| pixel.mean()[0]).collect();
        // Samples are stratified for each segment alone, so in the pixel of the joint they may deviate as independent ones do: by two standard deviations
        // of at most 4 samples. Where a joint is covered twice, all of these pixels show `1 - (1 - alpha)²`, 12 or 16 samples more.
        for mean in &means {
            assert!((mean - f64::from(alpha)).abs() <= 8.0 / 64.0, "{alpha}: {means:?}");
        }
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        assert!((mean - f64::from(alpha)).abs() < 0.01, "{alpha}: {mean}");
    }
}

/// Images of 4 x 1 and 1 x 2 texels, each texel as wide as its part.
fn textured(shape: CurveShape, material: impl Fn(TextureRef) -> Material, texels: &[[u8; 4]], size: [u32; 2]) -> Scene {
    let mut image = texture(size, texels.to_vec(), Encoding::Linear, Wrap::Clamp);
    image.magnification = Magnification::Nearest;
    let mut stage = scene(vec![line(shape)], vec![material(TextureRef::new(TextureId(0)))]);
    stage.textures = vec![image];
    stage
}

fn painted(slot: TextureRef) -> Material {
    Material { base_color: [1.0; 3], base_color_texture: Some(slot), ..Material::default() }
}

fn red(stage: &Scene, ray: &Ray) -> f32 {
    let hit = prepared(stage, Levels::Auto).closest_hit(ray).expect("the ray hits the curve");
    Surfaces::new(stage).at_ray(&hit, ray, Cone::ZERO).bsdf.base_color[0]
}

/// `u` runs along the whole strand, in proportion to length, over its joints.
#[test]
fn textures_run_along_the_strand() {
    let gray = |x: u8| [x, x, x, 255];
    let texels = [gray(0), gray(51), gray(102), gray(255)];
    for shape in [CurveShape::Tube, CurveShape::Ribbon] {
        let stage = textured(shape, painted, &texels, [4, 1]);
        for (x, want) in [(-1.9, 0.0), (-1.1, 0.0), (-0.9, 0.2), (-0.1, 0.2), (0.1, 0.4), (0.9, 0.4), (1.1, 1.0)] {
            assert_eq!(red(&stage, &down(x, 0.0)), want, "{shape:?} {x}");
        }
    }
}

/// A texture that repeats and is interpolated does not mix its first and its last color at the ends.
#[test]
fn ends_of_tubes_have_one_color() {
    let gray = |x: u8| [x, x, x, 255];
    let mut stage = textured(CurveShape::Tube, painted, &[gray(0), gray(51), gray(102), gray(255)], [4, 1]);
    stage.textures[0].magnification = Magnification::Linear;
    stage.textures[0].wrap = [Wrap::Repeat; 2];
    assert_eq!([-2.2, -2.0, 2.0, 2.2].map(|x| red(&stage, &down(x, 0.1))), [0.0, 0.0, 1.0, 1.0]);
}

/// `v` runs across, from left to right as the ray sees a curve that leads upward: here it leads to the right, so that left is up.
#[test]
fn textures_run_across_the_curve() {
    let texels = [[255; 4], [0, 0, 0, 255]];
    for shape in [CurveShape::Tube, CurveShape::Ribbon] {
        // The first row of an image is at the top, where `v` is 1.
        let stage = textured(shape, painted, &texels, [1, 2]);
        for x in [-1.5, 0.5] {
            assert_eq!([0.4, 0.1].map(|y| red(&stage, &down(x, y))), [0.0; 2], "{shape:?}");
            assert_eq!([-0.4, -0.1].map(|y| red(&stage, &down(x, y))), [1.0; 2], "{shape:?}");
            // From behind, left and right change places.
            assert_eq!(red(&stage, &Ray::new([x, 0.1, -5.0], [0.0, 0.0, 1.0])), 1.0, "{shape:?}");
        }
    }
}

/// Alpha of a texture cuts one side of a ribbon out.
#[test]
fn alpha_textures_cut_ribbons() {
    let cut = |slot: TextureRef| Material {
        alpha_texture: Some(slot),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..Material::default()
    };
    let stage = textured(CurveShape::Ribbon, cut, &[[255; 4], [255, 255, 255, 0]], [1, 2]);
    let (bvh, surfaces) = (prepared(&stage, Levels::Auto), Surfaces::new(&stage));
    let is_hit = |y: f32| bvh.closest_hit_with(&down(0.5, y), &mut HitFilter::new(&surfaces)).is_some();
    assert_eq!([0.3, 0.1, -0.1, -0.3].map(is_hit), [false, false, true, true]);
}

/// A wide cone sees the mean of a fine texture.
#[test]
fn textures_of_curves_are_filtered() {
    let texels: Vec<[u8; 4]> = (0..256 * 64).map(|i| if i % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] }).collect();
    for shape in [CurveShape::Tube, CurveShape::Ribbon] {
        let stage = textured(shape, painted, &texels, [256, 64]);
        let bvh = prepared(&stage, Levels::Auto);
        let settings = Settings { integrator: Integrator::Path, lod: Lod::Aniso, ..settings(1, 1, 1, 1) };
        let stage = under([1.0; 3], stage);
        let one = |settings: &Settings| {
            film_of(&stage, &bvh, &camera([0.5, 0.0, 5.0], [0.5, 0.0, 0.0], 4.0), settings).pixels()[0].mean()[0]
        };
        let (filtered, point) = (one(&settings), one(&Settings { lod: Lod::None, ..settings }));
        assert!((filtered - 0.5).abs() < 0.02, "{shape:?}: {filtered}");
        assert!((point - 0.5).abs() > 0.4, "{shape:?}: {point}");
    }
}
