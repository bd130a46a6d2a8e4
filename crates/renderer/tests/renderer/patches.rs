//! Bicubic patches beside triangles: surfaces, texture coordinates, culling, and light within a closed set of them.

use canted_film::Pixel;
use canted_obb::Affine;
use canted_renderer::{Cone, Cull, Integrator, Levels, SceneBvh, SceneBvhConfig, Settings, Surfaces};
use canted_scene::{
    CurveSegments, CurveShape, Curves, Encoding, Magnification, Material, Mesh, Scene, TextureId, TextureRef, Wrap,
};
use canted_trace::{Intersect as _, Ray};

use super::common::{
    camera, dot, film_of, gray, mesh, place, prepared, rays_from_all_around, scene, settings, sub, texture, under, unit,
};

/// A mesh of patches.
fn patches(positions: Vec<[f32; 3]>) -> Mesh {
    let list = (0..positions.len() as u32 / 16).map(|i| std::array::from_fn(|k| 16 * i + k as u32)).collect();
    let segments = CurveSegments::Patches(list);
    let curves = Curves { radii: vec![0.0; positions.len()], segments, shape: CurveShape::Tube };
    Mesh { curves: Some(curves), ..mesh(positions, vec![], 0) }
}

/// Six patches around a cube of which the control points are moved to a sphere: convex but for their edges.
fn ball() -> Mesh {
    let mut positions = vec![];
    for side in 0..6 {
        let (axis, at) = (side / 2, [-1.0_f32, 1.0][side % 2]);
        for k in 0..16 {
            let (a, b) = if at > 0.0 { (k / 4, k % 4) } else { (k % 4, k / 4) };
            let mut point = [at; 3];
            point[(axis + 1) % 3] = (2.0 * a as f32 - 3.0) / 3.0;
            point[(axis + 2) % 3] = (2.0 * b as f32 - 3.0) / 3.0;
            let length = point.iter().map(|x| x * x).sum::<f32>().sqrt();
            positions.push(point.map(|x| x / length));
        }
    }
    patches(positions)
}

/// A flat patch over the square from 0 to 3, seen from above at its front.
fn flat() -> Mesh {
    patches((0..16).map(|k| [(k / 4) as f32, (k % 4) as f32, 0.0]).collect())
}

/// Whatever the transform, points lie on the ray and neighboring rays see the plane of the normal; fronts are outside.
#[test]
fn normals_are_those_of_the_surface() {
    let moved = Affine { columns: [[0.8, 0.1, 0.0], [0.0, 1.1, 0.0], [0.0, 0.0, 1.0], [0.1, 0.2, 0.0]] };
    let sheared = Affine { columns: [[1.0, 0.0, 0.0], [0.7, 1.0, 0.2], [0.0, 0.0, 2.0], [0.0; 3]] };
    let mirrored = Affine { columns: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] };
    let (mut n_hits, mut n_inside, mut all) = (0, 0, vec![]);
    for map in [Affine::IDENTITY, moved, sheared, mirrored] {
        let mut stage = scene(vec![ball()], vec![gray(0.5)]);
        stage.instances = vec![place(0, map)];
        let bvh = prepared(&stage, Levels::Auto);
        let surfaces = Surfaces::new(&stage);
        for ray in rays_from_all_around(400) {
            let Some(hit) = bvh.closest_hit(&ray) else { continue };
            let surface = surfaces.at_ray(&hit, &ray, Cone::ZERO);
            let direction = unit(ray.direction.map(f64::from));
            let along_ray = sub(surface.position, ray.origin.map(f64::from));
            let off = dot(along_ray, along_ray) - dot(along_ray, direction).powi(2);
            assert!(off.abs() < 1e-10, "{off:e} beside the ray");
            bvh.all_hits(&ray, &mut all);
            assert!(dot(surface.normal, direction) <= 0.0, "{hit:?}");
            // From outside, each entry has an exit.
            assert_eq!(surface.is_front, all.len().is_multiple_of(2), "{all:?}");
            n_inside += usize::from(!surface.is_front);
            if -dot(surface.normal, direction) < 0.3 {
                continue;
            }
            for axis in 0..3 {
                let mut beside = ray;
                beside.origin[axis] += 1e-3;
                let Some(other) = bvh.closest_hit(&beside) else { continue };
                let edge = sub(surfaces.at_ray(&other, &beside, Cone::ZERO).position, surface.position);
                // Faces meet at an angle.
                if other.primitive == hit.primitive && dot(edge, edge) < 1e-4 {
                    let height = dot(edge, surface.normal).abs();
                    assert!(height < 1e-4, "{height:e} above the plane: {ray:?}");
                    n_hits += 1;
                }
            }
        }
    }
    assert!(n_hits > 500 && n_inside > 10, "{n_hits} {n_inside}");
}

/// Rays that leave the surface do not hit it again, and none passes between two patches: from a convex closed set every bounce escapes, and inside of it
/// nothing does.
#[test]
fn a_closed_set_keeps_light_inside_and_outside() {
    for integrator in [Integrator::Hybrid, Integrator::Path] {
        let stage = under([1.0; 3], scene(vec![ball()], vec![gray(0.625)]));
        let settings = Settings { integrator, ..settings(12, 12, 6, 2) };
        let bvh = prepared(&stage, Levels::Auto);
        let film = film_of(&stage, &bvh, &camera([2.0, 3.0, 4.0], [0.0; 3], 3.0), &settings);
        for pixel in film.pixels().iter().map(Pixel::mean) {
            assert!(pixel.iter().all(|x| (x - 0.625).abs() < 1e-5), "{integrator:?} {pixel:?}");
        }
    }
    let stage = under([1.0; 3], scene(vec![ball()], vec![gray(1.0)]));
    let film = film_of(
        &stage,
        &prepared(&stage, Levels::Auto),
        &camera([0.1, 0.2, 0.3], [1.0, 0.0, 0.0], 90.0),
        &settings(24, 24, 16, 12),
    );
    assert!(film.pixels().iter().all(|pixel| pixel.mean() == [0.0; 3]), "light from outside");
}

/// Colors of control points are mixed with the weights of the surface, textures have its parameters.
#[test]
fn parameters_place_colors_and_textures() {
    let ray = |x: f32, y: f32| Ray::new([x, y, 5.0], [0.0, 0.0, -1.0]);
    let mut shape = flat();
    shape.colors = Some((0..16).map(|k| [if k / 4 == 0 { 1.0 } else { 0.0 }, 0.5, 0.25, 1.0]).collect());
    let base_color = |stage: &Scene, ray: &Ray| {
        let hit = prepared(stage, Levels::Auto).closest_hit(ray).expect("a hit");
        Surfaces::new(stage).at_ray(&hit, ray, Cone::ZERO).bsdf.base_color
    };
    let stage = scene(vec![shape], vec![gray(1.0)]);
    // A third of u: (2/3)^3 of the first row.
    let color = base_color(&stage, &ray(1.0, 2.5));
    assert!((color[0] - 8.0 / 27.0).abs() < 1e-6 && color[1..] == [0.5, 0.25], "{color:?}");
    // Red to the right of the middle, green above.
    let texels = vec![[0, 255, 0, 255], [255, 255, 0, 255], [0, 0, 0, 255], [255, 0, 0, 255]];
    let slot = TextureRef::new(TextureId(0));
    let mut stage = scene(vec![flat()], vec![Material { base_color_texture: Some(slot), ..gray(1.0) }]);
    let mut image = texture([2, 2], texels, Encoding::Linear, Wrap::Repeat);
    image.magnification = Magnification::Nearest;
    stage.textures = vec![image];
    for (x, y, want) in [(0.5, 0.5, [0.0, 0.0]), (2.5, 0.5, [1.0, 0.0]), (0.5, 2.5, [0.0, 1.0]), (2.5, 2.5, [1.0, 1.0])]
    {
        assert_eq!(base_color(&stage, &ray(x, y))[..2], want, "{x} {y}");
    }
}

/// A patch has two sides, of which a single-sided material shows the front; hair is for curves.
#[test]
fn patches_have_a_back() {
    let single_sided = Material { double_sided: false, ..gray(0.5) };
    let stage = under([1.0; 3], scene(vec![flat()], vec![single_sided]));
    let bvh = prepared(&stage, Levels::Auto);
    for (height, cull, want) in [(5.0, Cull::Auto, 0.5), (-5.0, Cull::Auto, 1.0), (-5.0, Cull::Off, 0.5)] {
        let view = camera([1.5, 1.4, height], [1.5, 1.5, 0.0], 5.0);
        let film = film_of(&stage, &bvh, &view, &Settings { cull, ..settings(4, 4, 4, 3) });
        let found = film.pixels()[5].mean()[0];
        assert!((found - want).abs() < 0.01, "{height} {cull:?}: {found}");
    }
    let hair = Material { hair: Some(Box::default()), ..gray(0.5) };
    let stage = scene(vec![flat()], vec![hair]);
    let ray = Ray::new([1.5, 1.5, 5.0], [0.0, 0.0, -1.0]);
    let hit = SceneBvh::build(&stage, &SceneBvhConfig::default()).unwrap().closest_hit(&ray).expect("a hit");
    assert!(Surfaces::new(&stage).at_ray(&hit, &ray, Cone::ZERO).bsdf.hair.is_none());
}
