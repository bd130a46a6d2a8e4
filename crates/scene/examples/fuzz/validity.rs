//! Checks the guarantees of scenes.

use canted_scene::{EnvironmentImage, Light, Material, Mesh, Projection, Scene};

/// The first violated guarantee of a scene.
pub(crate) fn flaw(scene: &Scene) -> Option<String> {
    if scene.instances.is_empty() {
        return Some("no instance".to_owned());
    }
    let meshes = scene.meshes.iter().find_map(|mesh| flaw_of_mesh(mesh, scene));
    meshes
        .or_else(|| flaw_of_instances(scene))
        .or_else(|| flaw_of_materials(scene))
        .or_else(|| flaw_of_textures(scene))
        .or_else(|| flaw_of_lights(scene))
        .or_else(|| flaw_of_cameras(scene))
}

/// The first violated guarantee of an environment map.
pub(crate) fn flaw_of_environment(image: &EnvironmentImage) -> Option<String> {
    let n_texels = u64::from(image.width) * u64::from(image.height);
    let is_valid = n_texels > 0
        && image.texels.len() as u64 == n_texels
        && image.texels.as_flattened().iter().all(|x| x.is_finite() && *x >= 0.0);
    (!is_valid).then(|| format!("{} x {} texels are invalid", image.width, image.height))
}

fn flaw_of_mesh(mesh: &Mesh, scene: &Scene) -> Option<String> {
    let n = mesh.positions.len();
    let is_usable = |&corner: &u32| {
        let position = mesh.positions.get(corner as usize);
        position.is_some_and(|position| position.iter().all(|x| x.is_finite()))
    };
    let is_unit_or_zero = |v: &[f32]| {
        let length = v.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
        // Rounding each component changes the length by at most half a unit in the last place of 1.
        length == 0.0 || (length - 1.0).abs() <= f64::from(f32::EPSILON)
    };
    let finite = |uvs: &Vec<[f32; 2]>| uvs.len() == n && uvs.as_flattened().iter().all(|x| x.is_finite());
    let fits = [
        ("corners", mesh.triangles.as_flattened().iter().all(is_usable)),
        ("normals", mesh.normals.as_ref().is_none_or(|v| v.len() == n && v.iter().all(|v| is_unit_or_zero(v)))),
        ("tangents", mesh.tangents.as_ref().is_none_or(|v| v.len() == n && v.iter().all(|v| is_unit_or_zero(&v[..3])))),
        ("uvs", mesh.uvs.as_ref().is_none_or(finite)),
        ("second uvs", mesh.second_uvs.as_ref().is_none_or(finite)),
        (
            "colors",
            mesh.colors
                .as_ref()
                .is_none_or(|c| c.len() == n && c.as_flattened().iter().all(|x| (0.0..=1.0).contains(x))),
        ),
        ("first part", mesh.parts.first().is_some_and(|part| part.first_triangle == 0)),
        ("parts", mesh.parts.is_sorted_by(|a, b| a.first_triangle < b.first_triangle)),
        ("materials", mesh.parts.iter().all(|part| (part.material.0 as usize) < scene.materials.len())),
    ];
    fits.into_iter().find(|(_, fits)| !fits).map(|(what, _)| format!("mesh {:?}: {what} are invalid", mesh.name))
}

fn flaw_of_instances(scene: &Scene) -> Option<String> {
    let is_valid = |instance: &canted_scene::Instance| {
        let placed = &instance.world_from_object;
        (instance.mesh.0 as usize) < scene.meshes.len() && placed.is_finite() && placed.determinant() != 0.0
    };
    let bad = scene.instances.iter().position(|instance| !is_valid(instance))?;
    Some(format!("instance {bad} is invalid"))
}

fn flaw_of_materials(scene: &Scene) -> Option<String> {
    let unit = 0.0..=1.0;
    let bad = scene.materials.iter().find(|material| {
        let numbers = [material.metallic, material.roughness, material.specular, material.transmission, material.alpha];
        let is_valid = numbers.iter().chain(&material.base_color).all(|x| unit.contains(x))
            && (1.0..=Material::MAX_IOR).contains(&material.ior)
            && material.normal_scale.is_finite()
            && material.emission.iter().all(|x| x.is_finite() && *x >= 0.0)
            && material.textures().all(|texture| {
                (texture.texture.0 as usize) < scene.textures.len()
                    && texture.texture_from_mesh.rows.as_flattened().iter().all(|x| x.is_finite())
            });
        !is_valid
    })?;
    Some(format!("{bad:?} is invalid"))
}

fn flaw_of_textures(scene: &Scene) -> Option<String> {
    let has_texels = |texture: &canted_scene::Texture| {
        let n_texels = u64::from(texture.width) * u64::from(texture.height);
        n_texels > 0 && texture.texels.len() as u64 == n_texels
    };
    let bad = scene.textures.iter().find(|texture| !has_texels(texture))?;
    Some(format!("texture {:?} is invalid", bad.name))
}

fn flaw_of_lights(scene: &Scene) -> Option<String> {
    let is_finite = |light: &Light| match *light {
        Light::Sun { direction, irradiance } => [direction, irradiance].as_flattened().iter().all(|x| x.is_finite()),
        Light::Point { position, intensity } => [position, intensity].as_flattened().iter().all(|x| x.is_finite()),
        Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
            [position, direction, intensity].as_flattened().iter().all(|x| x.is_finite()) && cos_outer < cos_inner
        }
        Light::Sphere { center, radius, radiance } => {
            [center, radiance].as_flattened().iter().all(|x| x.is_finite()) && radius > 0.0 && radius.is_finite()
        }
        Light::Disk { center, normal, radius, radiance } => {
            let numbers = [center, normal, radiance];
            numbers.as_flattened().iter().all(|x| x.is_finite()) && radius > 0.0 && radius.is_finite()
        }
    };
    let bad = scene.lights.iter().find(|light| !is_finite(light))?;
    Some(format!("{bad:?} is invalid"))
}

fn flaw_of_cameras(scene: &Scene) -> Option<String> {
    let is_valid = |camera: &canted_scene::Camera| {
        let size_is_valid = match camera.projection {
            Projection::Perspective { fov_degrees } => fov_degrees > 0.0 && fov_degrees < 180.0,
            Projection::Orthographic { height } => height > 0.0 && height.is_finite(),
        };
        let points = [camera.eye, camera.target, camera.up];
        size_is_valid && camera.eye != camera.target && points.as_flattened().iter().all(|x| x.is_finite())
    };
    let bad = scene.cameras.iter().find(|camera| !is_valid(camera))?;
    Some(format!("{bad:?} is invalid"))
}
