//! The guarantees of a [`Scene`] as a check, which all tests of readers and the fuzzer share.

use canted_scene::{Camera, Instance, Light, Material, Mesh, Projection, Scene, Texture};

/// The first violated guarantee of a scene.
pub(crate) fn flaw(scene: &Scene) -> Option<String> {
    if scene.instances.is_empty() {
        return Some("no instance".to_owned());
    }
    let mesh = scene.meshes.iter().find_map(|mesh| flaw_of_mesh(mesh, scene));
    let instance = |instance: &Instance| {
        let placed = &instance.world_from_object;
        (instance.mesh.0 as usize) < scene.meshes.len() && placed.is_finite() && placed.determinant() != 0.0
    };
    mesh.or_else(|| first_invalid("instance", &scene.instances, instance))
        .or_else(|| first_invalid("material", &scene.materials, |material| is_material(material, scene)))
        .or_else(|| first_invalid("texture", &scene.textures, has_texels))
        .or_else(|| first_invalid("light", &scene.lights, is_light))
        .or_else(|| first_invalid("camera", &scene.cameras, is_camera))
}

/// Whether triangles are numbered consecutively, instance by instance.
#[cfg(test)]
pub(crate) fn is_numbered(scene: &Scene) -> bool {
    let mut next = 0;
    scene.instances.iter().all(|instance| {
        let first = next;
        next += scene.meshes[instance.mesh.0 as usize].n_primitives();
        instance.first_primitive as usize == first
    })
}

fn first_invalid<T>(what: &str, list: &[T], is_valid: impl Fn(&T) -> bool) -> Option<String> {
    list.iter().position(|item| !is_valid(item)).map(|k| format!("{what} {k} is invalid"))
}

fn are_finite<const N: usize>(vectors: &[[f32; N]]) -> bool {
    vectors.as_flattened().iter().all(|x| x.is_finite())
}

fn flaw_of_mesh(mesh: &Mesh, scene: &Scene) -> Option<String> {
    let n = mesh.positions.len();
    let is_usable = |&corner: &u32| mesh.positions.get(corner as usize).is_some_and(|&p| are_finite(&[p]));
    let is_unit_or_zero = |v: &[f32]| {
        let length = v.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
        // Rounding each component changes the length by at most half a unit in the last place of 1.
        length == 0.0 || (length - 1.0).abs() <= f64::from(f32::EPSILON)
    };
    let are_uvs = |uvs: &Vec<[f32; 2]>| uvs.len() == n && are_finite(uvs);
    let are_colors = |c: &Vec<[f32; 4]>| c.len() == n && c.as_flattened().iter().all(|x| (0.0..=1.0).contains(x));
    let fits = [
        ("corners", mesh.triangles.as_flattened().iter().all(is_usable)),
        ("normals", mesh.normals.as_ref().is_none_or(|v| v.len() == n && v.iter().all(|v| is_unit_or_zero(v)))),
        ("tangents", mesh.tangents.as_ref().is_none_or(|v| v.len() == n && v.iter().all(|v| is_unit_or_zero(&v[..3])))),
        ("uvs", mesh.uvs.as_ref().is_none_or(are_uvs)),
        ("second uvs", mesh.second_uvs.as_ref().is_none_or(are_uvs)),
        ("colors", mesh.colors.as_ref().is_none_or(are_colors)),
        ("first part", mesh.parts.first().is_some_and(|part| part.first_triangle == 0)),
        ("parts", mesh.parts.is_sorted_by(|a, b| a.first_triangle < b.first_triangle)),
        ("last part", mesh.parts.last().is_some_and(|part| (part.first_triangle as usize) < mesh.n_primitives())),
        ("curves", mesh.curves.as_ref().is_none_or(|curves| curves.segments.indices().iter().all(is_usable))),
        ("radii", mesh.curves.as_ref().is_none_or(|c| c.radii.len() == n && c.radii.iter().all(|r| *r >= 0.0))),
        ("materials", mesh.parts.iter().all(|part| (part.material.0 as usize) < scene.materials.len())),
    ];
    fits.into_iter().find(|(_, fits)| !fits).map(|(what, _)| format!("mesh {:?}: {what} are invalid", mesh.name))
}

fn is_material(material: &Material, scene: &Scene) -> bool {
    let numbers = [material.metallic, material.roughness, material.specular, material.transmission, material.alpha];
    numbers.iter().chain(&material.base_color).all(|x| (0.0..=1.0).contains(x))
        && (1.0..=Material::MAX_IOR).contains(&material.ior)
        && material.normal_scale.is_finite()
        && material.emission.iter().all(|x| x.is_finite() && *x >= 0.0)
        && material.textures().all(|texture| {
            (texture.texture.0 as usize) < scene.textures.len() && are_finite(&texture.texture_from_mesh.rows)
        })
}

fn has_texels(texture: &Texture) -> bool {
    let n_texels = u64::from(texture.width) * u64::from(texture.height);
    n_texels > 0 && texture.texels.len() as u64 == n_texels
}

fn is_light(light: &Light) -> bool {
    let is_radius = |radius: f32| radius > 0.0 && radius.is_finite();
    match *light {
        Light::Sun { direction, irradiance } => are_finite(&[direction, irradiance]),
        Light::Point { position, intensity } => are_finite(&[position, intensity]),
        Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
            are_finite(&[position, direction, intensity]) && cos_outer < cos_inner
        }
        Light::Sphere { center, radius, radiance } => are_finite(&[center, radiance]) && is_radius(radius),
        Light::Disk { center, normal, radius, radiance } => {
            are_finite(&[center, normal, radiance]) && is_radius(radius)
        }
    }
}

fn is_camera(camera: &Camera) -> bool {
    let is_size = match camera.projection {
        Projection::Perspective { fov_degrees } => fov_degrees > 0.0 && fov_degrees < 180.0,
        Projection::Orthographic { height } => height > 0.0 && height.is_finite(),
    };
    is_size && camera.eye != camera.target && are_finite(&[camera.eye, camera.target, camera.up])
}
