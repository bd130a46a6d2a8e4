//! Pictures with all light transport: glass and metal in a kitchen, and a lens.
//!
//! Path length is unlimited. The numbers equal those of `tests/oracle/scenes.py`.

use std::collections::BTreeSet;

use canted_scene::{Camera, Lens, Light, Material, MaterialId, MeshId, Scene};

use crate::shots::{BLUE, Shot, checker, cornell_env, flat_model, floor, model, parts, with_sun};

/// The material as in Mitsuba: a smooth dielectric with an inside, or GGX in the metal's color, or Lambert.
fn as_the_other_has_it(material: &mut Material) {
    assert_eq!(material.metallic_roughness_texture, None, "{}: only factors are compared", material.name);
    if material.transmission > 0.5 {
        *material = Material {
            base_color: [1.0; 3],
            base_color_texture: None,
            roughness: 0.0,
            specular: 1.0,
            transmission: 1.0,
            ior: 1.5,
            thin_walled: false,
            ..std::mem::take(material)
        };
    } else if material.metallic < 0.5 {
        (material.metallic, material.specular) = (0.0, 0.0);
    }
}

/// The kitchen under a blue sky through its window.
pub(crate) fn kitchen_sky(test: &str) -> Option<Shot> {
    let mut scene = model(test, "kitchen/country_kitchen.glb")?;
    scene.materials.iter_mut().for_each(as_the_other_has_it);
    (scene.lights, scene.environment) = (Vec::new(), Some(BLUE.into()));
    let camera = Camera::pinhole([1.211, 1.80475, 3.85239], [0.7729, 1.76308, 2.95443], [0.0, 1.0, 0.0], 36.5);
    Some(Shot { name: "kitchen-env", scene, camera, size: [112, 64], n_segments: None, samples: 256 })
}

/// The same lit by a sphere light inside.
pub(crate) fn kitchen_ball(test: &str) -> Option<Shot> {
    let shot = kitchen_sky(test)?;
    let ball = Light::Sphere { center: [1.9, 2.5, 2.2], radius: 0.15, radiance: [20.0, 18.0, 15.0] };
    let scene = Scene { lights: vec![ball], environment: None, ..shot.scene };
    Some(Shot { name: "kitchen-sphere", scene, samples: 512, ..shot })
}

/// Its floor, where the sun reaches it through the window.
pub(crate) fn kitchen_sun(test: &str) -> Option<Shot> {
    let shot = kitchen_sky(test)?;
    let scene = with_sun(shot.scene, [0.3, -0.5, 1.0], [60.0, 55.0, 45.0]);
    let camera = Camera::pinhole([0.7, 2.0, 3.0], [1.5, 0.0, 1.3], [0.0, 1.0, 0.0], 36.0);
    Some(Shot { name: "kitchen-sun", scene, camera, size: [96, 64], samples: 512, ..shot })
}

/// The Cornell box lit by its own lamp, hung lower.
pub(crate) fn cornell_lamp(test: &str) -> Option<Shot> {
    const DROP: f32 = 0.5;
    let mut scene = flat_model(test, "cornell/cornellBox.obj")?;
    for mesh in &mut scene.meshes {
        let ends = mesh.parts.iter().skip(1).map(|part| part.first_triangle as usize).chain([mesh.triangles.len()]);
        for (part, end) in mesh.parts.iter().zip(ends) {
            if scene.materials[part.material.0 as usize].emission != [0.0; 3] {
                let lamp: BTreeSet<u32> =
                    mesh.triangles[part.first_triangle as usize..end].iter().flatten().copied().collect();
                lamp.into_iter().for_each(|vertex| mesh.positions[vertex as usize][1] -= DROP);
            }
        }
    }
    let camera = Camera::pinhole([-0.23, 2.58, 9.0], [-0.23, 1.74, -3.0], [0.0, 1.0, 0.0], 27.0);
    Some(Shot { name: "cornell-light", scene, camera, n_segments: None, samples: 1536, ..cornell_env(test)? })
}

/// A wall in the focus of a wide lens, and a floor out of focus.
pub(crate) fn lens() -> Shot {
    let shot = checker();
    let mut scene = Scene { environment: Some(BLUE.into()), ..shot.scene };
    let mut ground = parts(&[floor()]);
    for mesh in &mut ground.meshes {
        mesh.parts[0].material = MaterialId(1);
    }
    for instance in &mut ground.instances {
        instance.mesh = MeshId(1);
    }
    scene.meshes.append(&mut ground.meshes);
    scene.instances.append(&mut ground.instances);
    scene.materials.append(&mut ground.materials);
    let camera = Camera { lens: Some(Lens { radius: 0.3, focus_distance: 6.0 }), ..shot.camera };
    Shot { name: "lens", scene, camera, n_segments: None, samples: 512, ..shot }
}
