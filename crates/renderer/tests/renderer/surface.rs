//! Surfaces at hits: position, normals, colors, rays that leave.

use canted_obb::{Affine, PrimId};
use canted_renderer::{Bsdf, Cone, Masked, Surface, Surfaces, Tracer};
use canted_scene::{AlphaMode, Encoding, Material, Mesh, Scene, Texture, TextureId, TextureRef, Wrap};
use canted_trace::{Counts, Hit, InstanceId, Ray, Side};

use crate::common::{BruteForce, Vector, cross, dot, grey, mesh, place, scene, sub, unit};

const TRIANGLE: [[f32; 3]; 3] = [[1.0, 2.0, -1.0], [4.0, 2.5, 0.5], [0.5, 3.0, 5.0]];
const MAPS: [[[f32; 3]; 4]; 3] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]],
    [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [5.0, -2.0, 1.0]],
    [[2.0, 0.3, -0.5], [1.5, -0.25, 0.0], [0.0, 4.0, 1e-3], [-7.0, 100.0, 1.0]],
];

fn hit(u: f32, v: f32) -> Hit {
    Hit { t: 1.0, u, v, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front }
}

fn one_triangle(columns: [[f32; 3]; 4], normals: Option<Vec<[f32; 3]>>) -> Scene {
    let triangle = Mesh { normals, ..mesh(TRIANGLE.to_vec(), vec![[0, 1, 2]], 0) };
    let mut scene = scene(vec![triangle], vec![grey(0.5)]);
    scene.instances = vec![place(0, Affine { columns })];
    scene
}

/// Whether two vectors differ only by `f64` rounding in sums of a dozen terms.
fn close(a: Vector, b: Vector, magnitude: f64) -> bool {
    (0..3).all(|k| (a[k] - b[k]).abs() <= 64.0 * f64::EPSILON * magnitude)
}

/// The oracle transforms the vertices first and shades the triangle in world space, so that no normal is transformed.
#[test]
fn points_and_normals_match_the_baked_triangle() {
    for columns in MAPS {
        let scene = one_triangle(columns, None);
        let map = scene.instances[0].world_from_object;
        let [a, b, c] = TRIANGLE.map(|p| map.point_f64(p.map(f64::from)));
        let normal = unit(cross(sub(b, a), sub(c, a)));
        for direction in [[0.3, -1.0, 0.2], [-0.3, 1.0, -0.2], [1.0, 0.0, 0.0]] {
            let surface = Surfaces::new(&scene).at(&hit(0.25, 0.5), direction);
            let point = std::array::from_fn(|k| 0.25 * a[k] + 0.25 * b[k] + 0.5 * c[k]);
            assert!(close(surface.position, point, 200.0), "{columns:?}");
            let towards_viewer = if dot(normal, direction.map(f64::from)) < 0.0 { normal } else { normal.map(|x| -x) };
            assert!(close(surface.normal, towards_viewer, 10.0), "{columns:?}: {:?} {normal:?}", surface.normal);
            assert_eq!(surface.shading_normal, surface.normal);
        }
    }
}

/// Shading normals stay perpendicular to tangents under mirroring and shearing.
#[test]
fn shading_normals_use_the_inverse_transpose() {
    for columns in MAPS {
        let (n, along) = ([0.0_f32, 0.6, 0.8], [[1.0, 0.0, 0.0], [0.0, 0.8, -0.6]]);
        let scene = one_triangle(columns, Some(vec![n; 3]));
        let surface = Surfaces::new(&scene).at(&hit(0.2, 0.3), [0.1, -0.9, -0.4]);
        for tangent in along {
            let tangent = unit(scene.instances[0].world_from_object.vector_f64(tangent));
            // The f32 normal is perpendicular to the tangents up to one f32 rounding, amplified by the stretch.
            let bound = 16.0 * f64::from(f32::EPSILON);
            assert!(dot(surface.shading_normal, tangent).abs() < bound, "{columns:?}");
        }
        assert!(dot(surface.shading_normal, surface.normal) > 0.0);
    }
}

#[test]
fn shading_normals_are_interpolated_and_zero_falls_back() {
    let normals = vec![[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]];
    let scene = one_triangle(MAPS[0], Some(normals));
    let surfaces = Surfaces::new(&scene);
    let at = |u, v| surfaces.at(&hit(u, v), [0.1, -0.9, -0.4]);
    let halfway = at(0.5, 0.0);
    let expected = unit([0.0, 0.5, 0.5]);
    let turned = if dot(expected, halfway.normal) < 0.0 { expected.map(|x| -x) } else { expected };
    assert!(close(halfway.shading_normal, turned, 1.0));
    assert_eq!(at(0.0, 1.0).shading_normal, at(0.0, 1.0).normal);
}

fn surface(normal: Vector, shading_normal: Vector) -> Surface {
    Surface {
        position: [0.0; 3],
        normal,
        shading_normal,
        is_front: true,
        bsdf: Bsdf::lambert([0.5; 3]),
        along: None,
        emission: [0.0; 3],
        offset: 1e-3,
        cone: Cone::ZERO,
    }
}

#[test]
fn directions_below_the_surface_are_mirrored() {
    let s = surface([0.0, 1.0, 0.0], unit([1.0, 1.0, 0.0]));
    assert_eq!(s.mirror_outward([0.6, 0.8, 0.0]), [0.6, 0.8, 0.0]);
    assert_eq!(s.mirror_outward([0.8, -0.6, 0.0]), [0.8, 0.6, 0.0]);
}

#[test]
fn rays_start_on_their_side_and_end_before_their_target() {
    let s = surface([0.0, 1.0, 0.0], [0.0, 1.0, 0.0]);
    assert_eq!(s.spawn_ray([0.0, 0.1, 1.0]).origin, [0.0, 1e-3, 0.0]);
    assert_eq!(s.spawn_ray([0.0, -0.1, 1.0]).origin, [0.0, -1e-3, 0.0]);
    let ray = s.spawn_ray_to([0.0, 2.0, 0.0]).unwrap();
    let end = ray.at(f64::from(ray.t_max))[1];
    assert!(end < 2.0 - 0.999e-3 && end > 2.0 - 1.01e-3, "{end}");
    assert!(s.spawn_ray_to([0.0, 1e-3, 0.0]).is_none() && s.spawn_ray_to([0.0, 1.5e-3, 0.0]).is_none());
}

/// A square of two triangles with uv over 0..=1 and a two by one texture: left red and opaque, right green and
/// transparent.
fn textured() -> Scene {
    let mut square = crate::common::parallelogram([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0);
    square.uvs = Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    let texture = Texture {
        name: "halves".into(),
        width: 2,
        height: 1,
        texels: vec![[255, 0, 0, 255], [0, 255, 0, 0]],
        encoding: Encoding::Srgb,
        wrap: [Wrap::Clamp; 2],
        magnification: canted_scene::Magnification::Linear,
    };
    let material = Material {
        base_color: [0.5, 0.25, 1.0],
        base_color_texture: Some(TextureRef::new(TextureId(0))),
        alpha_texture: Some(TextureRef::new(TextureId(0))),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..Material::default()
    };
    let behind = crate::common::parallelogram([0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1);
    let mut scene = scene(vec![square, behind], vec![material, grey(0.125)]);
    scene.textures = vec![texture];
    scene
}

#[test]
fn textures_color_and_alpha_masks_cut_out() {
    let scene = textured();
    let (tracer, surfaces) = (BruteForce::new(&scene), Surfaces::new(&scene));
    let shade = |x: f32| {
        let ray = Ray::new([x, 0.3, 2.0], [0.0, 0.0, -1.0]);
        let mut query = Masked::new(&surfaces, Counts::default());
        let hit = tracer.closest_hit(&ray, &mut query).unwrap();
        assert_eq!(query.inner.triangles, 4, "counts are forwarded");
        assert!(tracer.occluded(&ray, &mut query));
        (hit.instance.0, surfaces.at(&hit, ray.direction).bsdf.base_color)
    };
    assert_eq!(shade(0.2), (0, [0.5, 0.0, 0.0]));
    assert_eq!(shade(0.8), (1, [0.125; 3]), "through the transparent part");
    // Alpha falls linearly from 1 at u = 1/4 to 0 at u = 3/4 and crosses the cutoff in the center.
    assert_eq!((shade(0.499).0, shade(0.501).0), (0, 1));
}
