//! Normal maps: tangent frames for all coordinates, tangents and transforms.

use canted_obb::{Affine, PrimId};
use canted_renderer::{Surface, Surfaces};
use canted_scene::{Encoding, Material, Mesh, Scene, Texture, TextureId, TextureRef, UvTransform, Wrap};
use canted_trace::{Hit, InstanceId, Side};

use crate::common::{Vector, cross, dot, mesh, place, scene, unit};

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
    scene.textures = vec![Texture {
        name: "normals".into(),
        width: 1,
        height: 1,
        texels: vec![[r, g, b, 255]],
        encoding: Encoding::Linear,
        wrap: [Wrap::Repeat; 2],
        magnification: canted_scene::Magnification::Linear,
    }];
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
fn close(a: Vector, b: Vector) {
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
        close(surface_at(&stage(TILTED, uvs), DOWN).shading_normal, expected);
        // From behind, a bump is a dent.
        close(surface_at(&stage(TILTED, uvs), [0.0, 0.0, 1.0]).shading_normal, expected.map(|c| -c));
    }
}

#[test]
fn texture_transform_rotates_the_tangent_frame() {
    let mut scene = stage(TILTED, SQUARE);
    let turned = UvTransform { rows: [[0.0, 1.0, 0.5], [-1.0, 0.0, 0.0]] };
    scene.materials[0].normal_texture.as_mut().unwrap().texture_from_mesh = turned;
    let [x, y, z] = unit(decoded(TILTED));
    // u increases along the mesh's v, v against its u.
    close(surface_at(&scene, DOWN).shading_normal, [-y, x, z]);
}

#[test]
fn normal_scale_flattens() {
    let mut scene = stage(TILTED, SQUARE);
    scene.materials[0].normal_scale = 0.25;
    let [x, y, z] = decoded(TILTED);
    close(surface_at(&scene, DOWN).shading_normal, unit([0.25 * x, 0.25 * y, z]));
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
            close(surface_at(&with, DOWN).shading_normal, surface_at(&without, DOWN).shading_normal);
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
