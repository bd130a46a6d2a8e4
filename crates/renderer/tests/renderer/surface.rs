//! Surfaces at hits: position, normals, colors, rays that leave.

use canted_obb::{Affine, PrimId};
use canted_renderer::{Bsdf, Cone, CountedHitFilter, HitFilter, Levels, SceneBvh, SceneBvhConfig, Surface, Surfaces};
use canted_scene::{AlphaMode, Encoding, Material, Mesh, Scene, TextureId, TextureRef, UvTransform, Wrap};
use canted_trace::{Counts, Hit, InstanceId, Intersect, Ray, Side, TriangleTest};

use crate::common::{
    BruteForce, Vector, camera, cross, dot, film, film_of, gray, inside_out, mesh, narrow, place, scene, settings,
    sphere, sub, texture, under, unit,
};

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
    let mut scene = scene(vec![triangle], vec![gray(0.5)]);
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
        smooth: None,
        is_front: true,
        bsdf: Bsdf::lambert([0.5; 3]),
        along: None,
        emission: [0.0; 3],
        offset: 1e-3,
        cone: Cone::ZERO,
        time: 0.0,
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
    let halves = texture([2, 1], vec![[255, 0, 0, 255], [0, 255, 0, 0]], Encoding::Srgb, Wrap::Clamp);
    let material = Material {
        base_color: [0.5, 0.25, 1.0],
        base_color_texture: Some(TextureRef::new(TextureId(0))),
        alpha_texture: Some(TextureRef::new(TextureId(0))),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..Material::default()
    };
    let behind = crate::common::parallelogram([0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1);
    let mut scene = scene(vec![square, behind], vec![material, gray(0.125)]);
    scene.textures = vec![halves];
    scene
}

#[test]
fn textures_color_and_alpha_masks_cut_out() {
    let scene = textured();
    let (tracer, surfaces) = (BruteForce::new(&scene), Surfaces::new(&scene));
    let shade = |x: f32| {
        let ray = Ray::new([x, 0.3, 2.0], [0.0, 0.0, -1.0]);
        let mut query = CountedHitFilter { filter: HitFilter::new(&surfaces), counts: Counts::default() };
        let hit = tracer.closest_hit_with(&ray, &mut query).unwrap();
        assert_eq!(query.counts.triangles, 4, "counts are forwarded");
        assert!(tracer.occluded_with(&ray, &mut query));
        (hit.instance.0, surfaces.at(&hit, ray.direction).bsdf.base_color)
    };
    assert_eq!(shade(0.2), (0, [0.5, 0.0, 0.0]));
    assert_eq!(shade(0.8), (1, [0.125; 3]), "through the transparent part");
    // Alpha falls linearly from 1 at u = 1/4 to 0 at u = 3/4 and crosses the cutoff in the center.
    assert_eq!((shade(0.499).0, shade(0.501).0), (0, 1));
}

// Normal maps: tangent frames for all coordinates, tangents and transforms.

const MIRROR: [[f32; 3]; 4] = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [5.0, -2.0, 1.0]];
const SHEAR: [[f32; 3]; 4] = [[2.0, 0.3, -0.5], [1.5, -0.25, 0.0], [0.0, 4.0, 1.0], [-7.0, 100.0, 1.0]];
const SQUARE: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
const DOWN: [f32; 3] = [0.0, 0.0, -1.0];

/// The triangle (0,0) (1,0) (0,1) in the plane z = 0, front up, with a normal map of one texel.
fn stage(texel: [u8; 3], uvs: [[f32; 2]; 3]) -> Scene {
    let triangle = mesh(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]], 0);
    let material = Material { normal_texture: Some(TextureRef::new(TextureId(0))), ..Material::default() };
    let mut scene = scene(vec![Mesh { uvs: Some(uvs.to_vec()), ..triangle }], vec![material]);
    let [r, g, b] = texel;
    scene.textures = vec![texture([1, 1], vec![[r, g, b, 255]], Encoding::Linear, Wrap::Repeat)];
    scene
}

fn surface_at(scene: &Scene, direction: [f32; 3]) -> Surface {
    let hit = Hit { t: 1.0, u: 0.25, v: 0.25, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front };
    Surfaces::new(scene).at(&hit, direction)
}

fn decoded(texel: [u8; 3]) -> Vector {
    texel.map(|byte| 2.0 * f64::from(byte) / 255.0 - 1.0)
}

/// A byte over 255 is rounded to `f32`, doubled, and divided by the length of the normal, at least a half here.
const BOUND: f64 = 8.0 * f32::EPSILON as f64;

#[track_caller]
fn are_close(a: Vector, b: Vector) {
    assert!((0..3).all(|k| (a[k] - b[k]).abs() < BOUND), "{a:?} {b:?}");
}

/// A normal tilted by about 20 degrees towards +u and slightly towards -v.
const TILTED: [u8; 3] = [170, 110, 245];

#[test]
fn axes_are_u_v_and_normal() {
    let [x, y, z] = unit(decoded(TILTED));
    // The directions of u and v, for coordinates rotated by a right angle, mirrored, or scaled.
    for (uvs, u, v) in [
        (SQUARE, [1.0, 0.0], [0.0, 1.0]),
        ([[0.0, 0.0], [0.0, 1.0], [-1.0, 0.0]], [0.0, -1.0], [1.0, 0.0]),
        ([[0.0, 0.0], [-1.0, 0.0], [0.0, 1.0]], [-1.0, 0.0], [0.0, 1.0]),
        ([[3.0, 1.0], [3.5, 1.0], [3.0, 1.0 - 64.0]], [1.0, 0.0], [0.0, -1.0]),
    ] {
        let expected = [x * u[0] + y * v[0], x * u[1] + y * v[1], z];
        are_close(surface_at(&stage(TILTED, uvs), DOWN).shading_normal, expected);
        // From behind, a bump is a dent.
        are_close(surface_at(&stage(TILTED, uvs), [0.0, 0.0, 1.0]).shading_normal, expected.map(|c| -c));
    }
}

#[test]
fn texture_transform_rotates_the_tangent_frame() {
    let mut scene = stage(TILTED, SQUARE);
    let turned = UvTransform { rows: [[0.0, 1.0, 0.5], [-1.0, 0.0, 0.0]] };
    scene.materials[0].normal_texture.as_mut().unwrap().texture_from_mesh = turned;
    let [x, y, z] = unit(decoded(TILTED));
    // u increases along the mesh's v, v against its u.
    are_close(surface_at(&scene, DOWN).shading_normal, [-y, x, z]);
}

#[test]
fn normal_scale_flattens() {
    let mut scene = stage(TILTED, SQUARE);
    scene.materials[0].normal_scale = 0.25;
    let [x, y, z] = decoded(TILTED);
    are_close(surface_at(&scene, DOWN).shading_normal, unit([0.25 * x, 0.25 * y, z]));
}

/// The oracle transforms the vertices first, so that no tangent is transformed.
#[test]
fn normals_match_those_of_the_baked_triangle() {
    for columns in [MIRROR, SHEAR] {
        for uvs in [SQUARE, [[0.1, 0.7], [0.4, -0.2], [0.9, 0.5]]] {
            let mut placed = stage(TILTED, uvs);
            placed.instances = vec![place(0, Affine { columns })];
            let mut baked = stage(TILTED, uvs);
            let mesh = &mut baked.meshes[0];
            mesh.positions = mesh.positions.iter().map(|&p| Affine { columns }.point(p)).collect();
            if (Affine { columns }).determinant() < 0.0 {
                // The front by winding order stays the front.
                mesh.triangles[0].swap(1, 2);
            }
            let direction = [0.3, 0.2, -1.0];
            let (a, b) = (surface_at(&placed, direction), surface_at(&baked, direction));
            assert_eq!(a.is_front, b.is_front);
            // The baked vertices are rounded by at most an ulp of 100, on edges of about 1.
            let rounded = 256.0 * f64::from(f32::EPSILON) * 4.0;
            assert!((0..3).all(|k| (a.shading_normal[k] - b.shading_normal[k]).abs() < rounded), "{columns:?} {uvs:?}");
        }
    }
}

#[test]
fn vertex_tangents_take_precedence() {
    for (uvs, tangent) in [
        (SQUARE, [1.0, 0.0, 0.0, 1.0]),
        ([[0.0, 0.0], [-1.0, 0.0], [0.0, 1.0]], [-1.0, 0.0, 0.0, -1.0]),
        ([[0.0, 0.0], [1.0, 0.0], [0.0, -1.0]], [1.0, 0.0, 0.0, -1.0]),
    ] {
        for columns in [Affine::IDENTITY.columns, MIRROR] {
            let mut without = stage(TILTED, uvs);
            without.meshes[0].normals = Some(vec![[0.0, 0.0, 1.0]; 3]);
            without.instances = vec![place(0, Affine { columns })];
            let mut with = without.clone();
            // A tangent that is not in the surface is made perpendicular to the normal.
            with.meshes[0].tangents = Some(vec![[tangent[0], tangent[1], 0.3, tangent[3]]; 3]);
            are_close(surface_at(&with, DOWN).shading_normal, surface_at(&without, DOWN).shading_normal);
        }
    }
}

#[test]
fn usual_flat_texel_tilts_by_a_third_of_a_degree() {
    let surface = surface_at(&stage([128, 128, 255], SQUARE), DOWN);
    let tilt = dot(surface.shading_normal, surface.normal).acos().to_degrees();
    // 1/255 in both directions, each to its bound.
    let bound_degrees = (2.0_f64.sqrt() * BOUND).to_degrees();
    assert!((tilt - (2.0_f64.sqrt() / 255.0).atan().to_degrees()).abs() < bound_degrees, "{tilt}");
}

#[test]
fn degenerate_frames_fall_back_to_the_normal() {
    let flat = |scene: &Scene| {
        let surface = surface_at(scene, [0.1, 0.2, -1.0]);
        assert_eq!(surface.shading_normal, surface.normal);
    };
    flat(&stage(TILTED, [[0.5, 0.5]; 3]));
    flat(&stage(TILTED, [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]));
    let mut scene = stage(TILTED, SQUARE);
    scene.meshes[0].uvs = None;
    flat(&scene);
    // Interpolated normals parallel to the tangents leave no perpendicular component.
    let mut scene = stage(TILTED, SQUARE);
    scene.meshes[0].tangents = Some(vec![[0.0; 4]; 3]);
    scene.meshes[0].uvs = Some(vec![[0.0; 2]; 3]);
    flat(&scene);
}

#[test]
fn normals_face_the_viewer_and_mirror_above_the_surface() {
    for texel in [[255, 128, 128], [0, 255, 20], [128, 128, 0], [255, 255, 255]] {
        for direction in [DOWN, [0.9, 0.1, -0.1], [-0.9, 0.3, -0.01], [0.3, -0.9, 0.2]] {
            let surface = surface_at(&stage(texel, SQUARE), direction);
            let viewer = unit(direction.map(|d| -f64::from(d)));
            let n = surface.shading_normal;
            let cosine = dot(n, viewer);
            assert!(cosine > 0.0, "{texel:?} {direction:?}");
            let mirrored: Vector = std::array::from_fn(|k| 2.0 * cosine * n[k] - viewer[k]);
            assert!(dot(mirrored, surface.normal) > -BOUND, "{texel:?} {direction:?}");
        }
    }
}

#[test]
fn interpolated_normals_facing_away_fall_back_to_the_geometric_normal() {
    let mut scene = stage(TILTED, SQUARE);
    scene.materials[0].normal_texture = None;
    let tilted = unit([0.8, 0.0, 0.6]);
    let normals = vec![tilted.map(|x| x as f32); 3];
    scene.meshes[0].normals = Some(normals);
    let facing = surface_at(&scene, [-0.5, 0.0, -0.5]);
    assert!(dot(cross(facing.shading_normal, tilted), cross(facing.shading_normal, tilted)).sqrt() < BOUND);
    let away = surface_at(&scene, [0.9, 0.0, -0.1]);
    assert_eq!(away.shading_normal, away.normal);
}

// Ray offsets: no self-intersection and no leaks, at every scale and far from the origin.

/// Powers of two scale every computation exactly; powers of ten do not.
const SCALES: [f32; 7] = [1e-3, 0.037, 1.0, 7.7, 1e3, 1e-20, 1e15];

/// An object at scale `s` around `center`, and a camera position that sees only it.
fn placed(object: &Mesh, s: f32, center: [f32; 3]) -> (Mesh, [f32; 3]) {
    let moved = |p: [f32; 3]| narrow(std::array::from_fn(|k| f64::from(center[k]) + f64::from(s) * f64::from(p[k])));
    let mut object = object.clone();
    for position in &mut object.positions {
        *position = moved(*position);
    }
    (object, moved([2.0, 3.0, 4.0]))
}

fn centers(s: f32) -> [[f32; 3]; 3] {
    [[0.0; 3], [3.0 * s, -50.0 * s, 20.0 * s], [1000.0 * s, 700.0 * s, -400.0 * s]]
}

#[test]
fn convex_objects_have_no_self_intersection_at_any_scale_or_position() {
    for s in SCALES {
        for center in centers(s) {
            let (object, eye) = placed(&sphere([0.0; 3], 1.0, 3, 0), s, center);
            let furnace = under([1.0; 3], scene(vec![object], vec![gray(0.5)]));
            let film = film(&furnace, &camera(eye, center, 15.0), &settings(12, 12, 6, 1));
            assert!(film.pixels().iter().all(|pixel| pixel.mean() == [0.5; 3]), "scale {s} at {center:?}");
        }
    }
}

#[test]
fn closed_objects_do_not_leak_at_any_scale_or_position() {
    let emissive = Material { emission: [1.0; 3], ..gray(0.5) };
    for s in SCALES {
        for center in centers(s) {
            let (object, _) = placed(&inside_out(sphere([0.0; 3], 1.0, 3, 0)), s, center);
            let room = under([100.0; 3], scene(vec![object], vec![emissive.clone()]));
            let target = std::array::from_fn(|k| center[k] + [0.3, -0.1, 0.2][k] * s);
            let film = film(&room, &camera(center, target, 100.0), &settings(12, 12, 6, 2));
            assert!(film.pixels().iter().all(|pixel| pixel.mean() == [1.75; 3]), "scale {s} at {center:?}");
        }
    }
}

/// Rays onto an object, the surfaces they hit, and the tracer.
fn surfaces_of(
    scene: &Scene,
    eye: [f32; 3],
    center: [f32; 3],
    mut check: impl FnMut(&Ray, &Hit, &canted_renderer::Surface),
) {
    let (tracer, surfaces) = (BruteForce::new(scene), Surfaces::new(scene));
    let view = canted_renderer::View::new(&camera(eye, center, 15.0), 16, 16).unwrap();
    for i in 0..256_u32 {
        let ray = view.ray([f64::from(i % 16) + 0.3, f64::from(i / 16) + 0.7]);
        let hit = tracer.closest_hit(&ray).unwrap();
        check(&ray, &hit, &surfaces.at(&hit, ray.direction));
    }
}

/// The origin of a new ray, rounded to `f32`, is at least twice `HIT_ERROR` times the reach from the plane along each
/// axis, and not much more than the bound of 44 units of rounding.
#[test]
fn origins_have_the_minimum_distance() {
    for s in SCALES {
        for center in centers(s) {
            let (object, eye) = placed(&sphere([0.0; 3], 1.0, 3, 0), s, center);
            let scene = scene(vec![object], vec![gray(0.5)]);
            let reach = f64::from(scene.bounds_world().reach());
            surfaces_of(&scene, eye, center, |_, hit, surface| {
                let corner = scene.meshes[0].positions[scene.meshes[0].triangles[hit.primitive.index()][0] as usize];
                let height = |p: [f32; 3]| dot(surface.normal, sub(p.map(f64::from), corner.map(f64::from)));
                let unit_of_rounding = 0.5 * f64::from(f32::EPSILON) * reach;
                for direction in [narrow(surface.normal), narrow(surface.normal.map(|x| -x))] {
                    let side = dot(surface.normal, direction.map(f64::from)).signum();
                    let height = side * height(surface.spawn_ray(direction).origin);
                    let axes: f64 = surface.normal.iter().map(|x| x.abs()).sum();
                    let roundings = height / (unit_of_rounding * axes);
                    assert!((40.0..46.0).contains(&roundings), "scale {s} at {center:?}: {roundings}");
                }
            });
        }
    }
}

/// The two tests above detect a missing offset: rays from the rounded hit point hit the object again.
#[test]
fn rays_without_offset_hit_the_surface_again() {
    let center = [1000.0, 700.0, -400.0];
    let (object, eye) = placed(&sphere([0.0; 3], 1.0, 3, 0), 1.0, center);
    let scene = scene(vec![object], vec![gray(0.5)]);
    let tracer = BruteForce::new(&scene);
    let mut n_hits = 0;
    surfaces_of(&scene, eye, center, |_, _, surface| {
        let bare = Ray::new(narrow(surface.position), narrow(surface.normal));
        n_hits += u32::from(tracer.occluded(&bare));
        assert!(!tracer.occluded(&surface.spawn_ray(narrow(surface.normal))));
    });
    assert!(n_hits > 32, "{n_hits} of 256");
}

/// Distant, stretched and sheared instances: the offset covers the rounding of transforms to and from object space.
#[test]
fn instances_far_from_the_origin_have_no_self_intersection() {
    let rotated: Vector = [0.36, 0.48, -0.8];
    for (stretch, shift) in [(1.0, 1e4), (1e-3, 10.0), (1e3, 1e6), (50.0, -3e5)] {
        let world_from_object = Affine {
            columns: [
                narrow(rotated.map(|x| x * stretch)),
                narrow([0.8 * stretch, -0.6 * stretch, 0.1 * stretch]),
                narrow([0.0, 0.3 * stretch, 2.0 * stretch]),
                narrow([shift, 0.3 * shift, -0.7 * shift]),
            ],
        };
        let mut furnace: Scene = scene(vec![sphere([0.0; 3], 1.0, 3, 0)], vec![gray(0.5)]);
        furnace.instances = vec![place(0, world_from_object)];
        furnace.environment = Some([1.0; 3].into());
        let center = world_from_object.columns[3];
        let eye = world_from_object.point([2.0, 3.0, 4.0]);
        let film = film(&furnace, &camera(eye, center, 4.0), &settings(12, 12, 6, 1));
        assert!(film.pixels().iter().all(|pixel| pixel.mean() == [0.5; 3]), "stretch {stretch} shift {shift}");
    }
}

/// Furnace tests with one-level and two-level BVHs. Only a watertight triangle test guarantees that edges do not leak.
fn check_furnaces(triangles: TriangleTest, is_watertight: bool) {
    let emissive = Material { emission: [1.0; 3], ..gray(0.5) };
    let rotated = Affine { columns: [[0.36, 0.48, -0.8], [0.8, -0.6, 0.1], [0.0, 0.3, 2.0], [300.0, -90.0, 40.0]] };
    for s in [1e-3, 1.0, 1e3] {
        let ball = placed(&sphere([0.0; 3], 1.0, 4, 0), s, [10.0 * s; 3]).0;
        let map = Affine {
            columns: [rotated.columns[0], rotated.columns[1], rotated.columns[2], rotated.columns[3].map(|x| x * s)],
        };
        let center = map.point([10.0 * s; 3]);
        let eye = map.point([12.0 * s, 13.0 * s, 14.0 * s]);
        for levels in [Levels::One, Levels::Two] {
            let rendered = |object: &Mesh, material: &Material, sky, eye, target, fov| {
                let mut scene = scene(vec![object.clone()], vec![material.clone()]);
                scene.instances = vec![place(0, map)];
                scene.environment = Some([sky; 3].into());
                let config = SceneBvhConfig { levels, triangles, ..SceneBvhConfig::default() };
                let bvh = SceneBvh::build(&scene, &config).unwrap();
                let film = film_of(&scene, &bvh, &camera(eye, target, fov), &settings(24, 24, 6, 2));
                film.pixels().iter().map(|pixel| pixel.mean()[0]).collect::<Vec<_>>()
            };
            let outside = rendered(&ball, &gray(0.5), 1.0, eye, center, 4.0);
            assert!(outside.iter().all(|&x| x == 0.5), "self-intersection at scale {s}, {levels:?}");
            if is_watertight {
                let inside = rendered(&inside_out(ball.clone()), &emissive, 100.0, center, eye, 100.0);
                assert!(inside.iter().all(|&x| x == 1.75), "leak at scale {s}, {levels:?}");
            }
        }
    }
}

#[test]
fn watertight_bvhs_have_no_self_intersection_and_no_leaks() {
    check_furnaces(TriangleTest::Watertight, true);
}

#[test]
fn moller_trumbore_bvhs_have_no_self_intersection() {
    check_furnaces(TriangleTest::MollerTrumbore, false);
}
