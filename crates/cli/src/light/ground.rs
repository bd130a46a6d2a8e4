//! The ground that an object stands on: a square in the plane of its lowest point, much wider than the object.
//!
//! It has the color that makes it as bright as the background where nothing shades it, so only shadows and reflected light are seen and no
//! edge is.

use canted_film::srgb::luminance;
use canted_obb::Affine;
use canted_renderer::{Lights, Subject};
use canted_scene::{Instance, Material, MaterialId, Mesh, MeshId, Part, Scene};
use glam::{DVec3, Vec3};

/// Half the side relative to the radius of the object: where it ends, an object that is as high as wide takes about a two-hundredth of the
/// light, which is not seen; and a mirror sees the darker floor of the studio behind it.
const HALF_SIDE: f64 = 6.0;

/// Distance below the lowest point, relative to the size of the object, so that a base in the same plane is in front.
const GAP: f64 = 1e-4;

/// Adds a ground below the subject of a scene.
pub(crate) fn add(scene: &mut Scene, subject: &Subject, up: [f32; 3]) {
    remove(scene);
    let [x, y, z] = subject.extent();
    let radius = (0.5 * x.hypot(z)).max(0.5 * y);
    let up = Vec3::from(up).as_dvec3().try_normalize().unwrap_or(DVec3::Y);
    let center = Vec3::from(subject.foot()).as_dvec3() - up * (GAP * radius.max(y));
    let (a, b) = up.any_orthonormal_pair();
    let corner = |s: f64, t: f64| (center + (a * s + b * t) * (HALF_SIDE * radius)).as_vec3().to_array();
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    // Products of such coordinates are finite.
    const MAX: f32 = 1e15;
    if !positions.as_flattened().iter().all(|x| x.abs() < MAX) {
        return;
    }
    let id = |n: usize| u32::try_from(n).ok();
    let ids =
        (id(scene.meshes.len()), id(scene.materials.len()), id(scene.instances.len()), id(scene.n_placed_triangles()));
    // A scene without room for one more has no ground.
    let (Some(mesh), Some(material), Some(instance), Some(first_primitive)) = ids else { return };
    scene.meshes.push(Mesh {
        name: "ground".to_owned(),
        positions,
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![Part { first_triangle: 0, material: MaterialId(material) }],
        ..Mesh::default()
    });
    scene.materials.push(Material { name: "ground".to_owned(), ..Material::default() });
    scene.instances.push(Instance {
        mesh: MeshId(mesh),
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive,
    });
    scene.ground = Some(instance);
}

/// Removes the ground that was added last.
pub(crate) fn remove(scene: &mut Scene) {
    if scene.ground.take().is_some() {
        scene.instances.pop();
        scene.meshes.pop();
        scene.materials.pop();
    }
}

/// Gives the ground the color that makes it as bright as the background, in the light of the scene.
pub(crate) fn paint(scene: &mut Scene, up: [f32; 3]) {
    /// A white background is brighter than a white surface in the studio. Light that goes to and fro between the ground and a white
    /// object loses energy all the same, because little of it meets the object.
    const MAX: f32 = 1.3;
    if scene.ground.is_none() {
        return;
    }
    let up = Vec3::from(up).as_dvec3().try_normalize().unwrap_or(DVec3::Y).as_vec3();
    let lights = Lights::new(scene);
    let light = lights.irradiance_from_afar(up.into());
    let seen = scene.background.unwrap_or_else(|| lights.radiance_from_afar((-up).into()));
    let is_lit = luminance(light.map(f64::from)) > 0.0;
    let color = |k: usize| {
        let needed = seen[k] * std::f32::consts::PI / light[k].max(f32::MIN_POSITIVE);
        needed.clamp(0.0, MAX)
    };
    // Local lights alone: a plain gray.
    let base_color = if is_lit { [0, 1, 2].map(color) } else { [0.4; 3] };
    if let Some(material) = scene.materials.last_mut() {
        material.base_color = base_color;
    }
}
