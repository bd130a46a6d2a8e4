//! Unused features of scenes, and how to force them in.

use canted_fixtures::grid;
use canted_obb::Affine;
use canted_renderer::Levels;
use canted_scene::{
    AlphaMode, Encoding, Instance, Light, Material, MaterialId, Mesh, MeshId, Part, Scene, Texture, TextureId,
    TextureRef, Wrap,
};

/// A feature that `prepare` reports as unused, and how to force it in.
pub(super) struct Forcing {
    pub(super) feature: &'static str,
    pub(super) force: fn(Scene) -> (Scene, Levels),
}

pub(super) const FORCINGS: [Forcing; 8] = [
    Forcing { feature: "top-level BVH", force: |scene| (scene, Levels::Two) },
    Forcing { feature: "motion", force: |scene| (with_least_motion(scene), Levels::Auto) },
    Forcing { feature: "textures", force: |scene| (with_white(scene), Levels::Auto) },
    Forcing { feature: "texture coordinates", force: |scene| (with_coordinates(scene), Levels::Auto) },
    Forcing { feature: "alpha test", force: |scene| (with_masks(scene), Levels::Auto) },
    Forcing { feature: "shading normals", force: |scene| (with_flat_normals(scene), Levels::Auto) },
    Forcing { feature: "emission", force: |scene| (with_least_light(scene), Levels::Auto) },
    Forcing { feature: "light selection", force: |scene| (with_dark_sun(scene), Levels::Auto) },
];

/// Features that are not forced in here, and why.
pub(super) const NOT_FORCED: [(&str, &str); 2] = [
    ("oriented nodes", "`cargo xtask bench nodes` forces them in"),
    ("listed lights", "a light with power would change the picture, and one without power is never sampled"),
];

/// Radiance of a triangle where emission is forced in: negligible next to any visible light, with a power that is a
/// normal number.
const LEAST_RADIANCE: f32 = 1e-30;

/// A grey mesh under a sun and a sky.
pub(super) fn plain(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Scene {
    let parts = vec![Part { first_triangle: 0, material: MaterialId(0) }];
    Scene {
        meshes: vec![Mesh { positions, triangles, parts, ..Mesh::default() }],
        instances: vec![Instance {
            mesh: MeshId(0),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: 0,
        }],
        materials: vec![Material { specular: 0.0, ..Material::default() }],
        lights: vec![Light::Sun { direction: [0.48, -0.64, 0.6], irradiance: [2.0; 3] }],
        environment: Some([0.4, 0.5, 0.6].into()),
        ..Scene::default()
    }
}

/// Terrain of a few thousand triangles with a sun as its only light.
pub(super) fn one_light() -> Scene {
    let terrain = grid(5, [64, 64]);
    // Its heights are along z, and the sun shines down along y.
    let positions = terrain.positions.into_iter().map(|[x, y, z]| [x, z, -y]).collect();
    Scene { environment: None, ..plain(positions, terrain.triangles) }
}

fn with_white(mut scene: Scene) -> Scene {
    let texture = TextureRef::new(TextureId(0));
    scene.textures = vec![Texture {
        name: "white".to_owned(),
        width: 1,
        height: 1,
        texels: vec![[255; 4]],
        encoding: Encoding::Srgb,
        wrap: [Wrap::Repeat; 2],
        magnification: canted_scene::Magnification::Linear,
    }];
    for material in &mut scene.materials {
        material.base_color_texture = Some(texture);
    }
    with_coordinates(scene)
}

fn with_coordinates(mut scene: Scene) -> Scene {
    for mesh in &mut scene.meshes {
        mesh.uvs = Some(vec![[0.5; 2]; mesh.positions.len()]);
    }
    scene
}

/// Every instance moves by one unit in the last place.
fn with_least_motion(mut scene: Scene) -> Scene {
    for instance in &mut scene.instances {
        let mut close = instance.world_from_object;
        close.columns[3][0] = close.columns[3][0].next_up();
        instance.world_from_object_close = Some(close);
    }
    scene
}

/// Only the last triangle of the first mesh emits; otherwise a light tree over all triangles would be measured.
fn with_least_light(mut scene: Scene) -> Scene {
    let mesh = &mut scene.meshes[0];
    let material = mesh.parts.last().map_or(MaterialId(0), |feature| feature.material);
    let emissive = Material { emission: [LEAST_RADIANCE; 3], ..scene.materials[material.0 as usize].clone() };
    let n = scene.materials.len();
    scene.materials.push(emissive);
    let last = u32::try_from(mesh.triangles.len() - 1).unwrap_or(u32::MAX);
    mesh.parts.retain(|feature| feature.first_triangle < last);
    mesh.parts.push(Part { first_triangle: last, material: MaterialId(u32::try_from(n).unwrap_or(u32::MAX)) });
    scene
}

fn with_masks(mut scene: Scene) -> Scene {
    for material in &mut scene.materials {
        material.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    }
    scene
}

fn with_dark_sun(mut scene: Scene) -> Scene {
    scene.lights.push(Light::Sun { direction: [0.0, -1.0, 0.0], irradiance: [0.0; 3] });
    scene
}

/// Separate vertices for every triangle, with its normal.
fn with_flat_normals(mut scene: Scene) -> Scene {
    for mesh in &mut scene.meshes {
        let corners: Vec<[[f32; 3]; 3]> =
            mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize])).collect();
        mesh.normals = Some(corners.iter().flat_map(|corners| [normal(corners); 3]).collect());
        mesh.positions = corners.concat();
        let triangles = &mesh.triangles;
        mesh.uvs = mesh.uvs.take().map(|values| of_corners(&values, triangles));
        mesh.second_uvs = mesh.second_uvs.take().map(|values| of_corners(&values, triangles));
        mesh.tangents = mesh.tangents.take().map(|values| of_corners(&values, triangles));
        mesh.colors = mesh.colors.take().map(|values| of_corners(&values, triangles));
        mesh.triangles = (0..).step_by(3).take(corners.len()).map(|first| [first, first + 1, first + 2]).collect();
    }
    scene
}

/// A value for each corner of each triangle, from one for each vertex.
fn of_corners<T: Copy>(values: &[T], triangles: &[[u32; 3]]) -> Vec<T> {
    triangles.iter().flatten().map(|&i| values[i as usize]).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is how normals are stored")]
fn normal(&[a, b, c]: &[[f32; 3]; 3]) -> [f32; 3] {
    let sub = |p: [f32; 3], q: [f32; 3]| -> [f64; 3] { std::array::from_fn(|k| f64::from(p[k]) - f64::from(q[k])) };
    let ([p, q, r], [x, y, z]) = (sub(b, a), sub(c, a));
    let normal = [q * z - r * y, r * x - p * z, p * y - q * x];
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 { normal.map(|x| (x / length) as f32) } else { [0.0, 0.0, 1.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_normals_keep_texture_coordinates() {
        let mut scene =
            plain(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]], vec![[0, 1, 2], [2, 1, 3]]);
        scene.meshes[0].uvs = Some((0..4u8).map(|i| [f32::from(i), 0.0]).collect());
        let flat = with_flat_normals(scene).meshes.remove(0);
        assert_eq!(flat.uvs.unwrap().iter().map(|uv| uv[0]).collect::<Vec<_>>(), [0.0, 1.0, 2.0, 2.0, 1.0, 3.0]);
        assert_eq!((flat.positions.len(), flat.normals), (6, Some(vec![[0.0, 0.0, 1.0]; 6])));
    }
}
