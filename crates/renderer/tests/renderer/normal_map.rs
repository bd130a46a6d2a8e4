//! Normal maps: the frame they speak in, whatever the coordinates, tangents and transforms.

use canted_obb::{Affine, PrimId};
use canted_renderer::{Surface, Surfaces};
use canted_scene::{Encoding, Material, Mesh, Scene, Texture, TextureId, TextureRef, UvTransform, Wrap};
use canted_trace::{Hit, InstanceId, Side};

use crate::common::{Vector, cross, dot, mesh, place, scene, unit};

const MIRROR: [[f32; 3]; 4] = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [5.0, -2.0, 1.0]];
const SHEAR: [[f32; 3]; 4] = [[2.0, 0.3, -0.5], [1.5, -0.25, 0.0], [0.0, 4.0, 1.0], [-7.0, 100.0, 1.0]];
const SQUARE: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
const DOWN: [f32; 3] = [0.0, 0.0, -1.0];

/// The triangle (0,0) (1,0) (0,1) of the plane z = 0, front up, under one texel of a normal map.
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
    }];
    scene
}

fn seen(scene: &Scene, direction: [f32; 3]) -> Surface {
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

/// A normal that leans 20 degrees or so towards +u and a little towards -v.
const LEANING: [u8; 3] = [170, 110, 245];

#[test]
fn x_is_along_u_y_along_v_and_z_along_the_normal() {
    let [x, y, z] = unit(decoded(LEANING));
    // The directions of u and v, for coordinates that are turned by a right angle, mirrored, or scaled.
    for (uvs, u, v) in [
        (SQUARE, [1.0, 0.0], [0.0, 1.0]),
        ([[0.0, 0.0], [0.0, 1.0], [-1.0, 0.0]], [0.0, -1.0], [1.0, 0.0]),
        ([[0.0, 0.0], [-1.0, 0.0], [0.0, 1.0]], [-1.0, 0.0], [0.0, 1.0]),
        ([[3.0, 1.0], [3.5, 1.0], [3.0, 1.0 - 64.0]], [1.0, 0.0], [0.0, -1.0]),
    ] {
        let expected = [x * u[0] + y * v[0], x * u[1] + y * v[1], z];
        close(seen(&stage(LEANING, uvs), DOWN).shading_normal, expected);
        // From behind the same bump is a dent.
        close(seen(&stage(LEANING, uvs), [0.0, 0.0, 1.0]).shading_normal, expected.map(|c| -c));
    }
}

#[test]
fn the_transform_of_a_texture_turns_its_normals() {
    let mut scene = stage(LEANING, SQUARE);
    let turned = UvTransform { rows: [[0.0, 1.0, 0.5], [-1.0, 0.0, 0.0]] };
    scene.materials[0].normal_texture.as_mut().unwrap().texture_from_mesh = turned;
    let [x, y, z] = unit(decoded(LEANING));
    // u grows along the mesh's v, v against its u.
    close(seen(&scene, DOWN).shading_normal, [-y, x, z]);
}

#[test]
fn the_scale_flattens() {
    let mut scene = stage(LEANING, SQUARE);
    scene.materials[0].normal_scale = 0.25;
    let [x, y, z] = decoded(LEANING);
    close(seen(&scene, DOWN).shading_normal, unit([0.25 * x, 0.25 * y, z]));
}

/// The oracle places the vertices first, so that no tangent is ever transformed.
#[test]
fn frames_agree_with_those_of_the_baked_triangle() {
    for columns in [MIRROR, SHEAR] {
        for uvs in [SQUARE, [[0.1, 0.7], [0.4, -0.2], [0.9, 0.5]]] {
            let mut placed = stage(LEANING, uvs);
            placed.instances = vec![place(0, Affine { columns })];
            let mut baked = stage(LEANING, uvs);
            let mesh = &mut baked.meshes[0];
            mesh.positions = mesh.positions.iter().map(|&p| Affine { columns }.point(p)).collect();
            if (Affine { columns }).determinant() < 0.0 {
                // What was the front by its winding is the front still.
                mesh.triangles[0].swap(1, 2);
            }
            let direction = [0.3, 0.2, -1.0];
            let (a, b) = (seen(&placed, direction), seen(&baked, direction));
            assert_eq!(a.is_front, b.is_front);
            // The vertices of the baked one are rounded, by at most an ulp of 100 on edges of about 1.
            let rounded = 256.0 * f64::from(f32::EPSILON) * 4.0;
            assert!((0..3).all(|k| (a.shading_normal[k] - b.shading_normal[k]).abs() < rounded), "{columns:?} {uvs:?}");
        }
    }
}

#[test]
fn tangents_of_the_file_stand_for_those_of_the_coordinates() {
    for (uvs, tangent) in [
        (SQUARE, [1.0, 0.0, 0.0, 1.0]),
        ([[0.0, 0.0], [-1.0, 0.0], [0.0, 1.0]], [-1.0, 0.0, 0.0, -1.0]),
        ([[0.0, 0.0], [1.0, 0.0], [0.0, -1.0]], [1.0, 0.0, 0.0, -1.0]),
    ] {
        for columns in [Affine::IDENTITY.columns, MIRROR] {
            let mut without = stage(LEANING, uvs);
            without.meshes[0].normals = Some(vec![[0.0, 0.0, 1.0]; 3]);
            without.instances = vec![place(0, Affine { columns })];
            let mut with = without.clone();
            // What leans out of the surface is straightened.
            with.meshes[0].tangents = Some(vec![[tangent[0], tangent[1], 0.3, tangent[3]]; 3]);
            close(seen(&with, DOWN).shading_normal, seen(&without, DOWN).shading_normal);
        }
    }
}

#[test]
fn the_usual_flat_texel_leans_by_a_third_of_a_degree() {
    let surface = seen(&stage([128, 128, 255], SQUARE), DOWN);
    let lean = dot(surface.shading_normal, surface.normal).acos().to_degrees();
    // A 255th in both directions, each to its bound.
    let bound_degrees = (2.0_f64.sqrt() * BOUND).to_degrees();
    assert!((lean - (2.0_f64.sqrt() / 255.0).atan().to_degrees()).abs() < bound_degrees, "{lean}");
}

#[test]
fn without_a_frame_the_normal_stands() {
    let flat = |scene: &Scene| {
        let surface = seen(scene, [0.1, 0.2, -1.0]);
        assert_eq!(surface.shading_normal, surface.normal);
    };
    flat(&stage(LEANING, [[0.5, 0.5]; 3]));
    flat(&stage(LEANING, [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]));
    let mut scene = stage(LEANING, SQUARE);
    scene.meshes[0].uvs = None;
    flat(&scene);
    // Interpolated normals that point along the tangents leave nothing to make them perpendicular to.
    let mut scene = stage(LEANING, SQUARE);
    scene.meshes[0].tangents = Some(vec![[0.0; 4]; 3]);
    scene.meshes[0].uvs = Some(vec![[0.0; 2]; 3]);
    flat(&scene);
}

#[test]
fn no_normal_turns_away_from_the_viewer_or_mirrors_into_the_body() {
    for texel in [[255, 128, 128], [0, 255, 20], [128, 128, 0], [255, 255, 255]] {
        for direction in [DOWN, [0.9, 0.1, -0.1], [-0.9, 0.3, -0.01], [0.3, -0.9, 0.2]] {
            let surface = seen(&stage(texel, SQUARE), direction);
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
fn interpolated_normals_that_turn_away_give_way_to_the_triangle() {
    let mut scene = stage(LEANING, SQUARE);
    scene.materials[0].normal_texture = None;
    let leaning = unit([0.8, 0.0, 0.6]);
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    let normals = vec![leaning.map(|x| x as f32); 3];
    scene.meshes[0].normals = Some(normals);
    let facing = seen(&scene, [-0.5, 0.0, -0.5]);
    assert!(dot(cross(facing.shading_normal, leaning), cross(facing.shading_normal, leaning)).sqrt() < BOUND);
    let away = seen(&scene, [0.9, 0.0, -0.1]);
    assert_eq!(away.shading_normal, away.normal);
}
