//! Pictures with all that light does: glass and metal in a kitchen, and a lens.
//!
//! Paths have no end. The numbers are those of `tests/oracle/scenes.py`.

use canted_scene::{Camera, Lens, Light, Material, MaterialId, MeshId, Scene};

use crate::shots::{BLUE, Shot, checker, floor, model, parts};

/// The material as Mitsuba has it: a smooth dielectric with an inside, or GGX in the metal's colour, or Lambert.
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

/// The kitchen in the light of a blue sky through its window, and of a ball in it.
pub(crate) fn kitchen(test: &str) -> Option<[Shot; 2]> {
    let mut scene = model(test, "kitchen/country_kitchen.glb")?;
    scene.materials.iter_mut().for_each(as_the_other_has_it);
    (scene.lights, scene.environment) = (Vec::new(), Some(BLUE.into()));
    let camera = Camera::pinhole([1.211, 1.80475, 3.85239], [0.7729, 1.76308, 2.95443], [0.0, 1.0, 0.0], 36.5);
    let ball = Light::Sphere { center: [1.9, 2.5, 2.2], radius: 0.15, radiance: [20.0, 18.0, 15.0] };
    let lit = Scene { lights: vec![ball], environment: None, ..scene.clone() };
    let size = [112, 64];
    let sky = Shot { name: "kitchen-env", scene, camera, size, n_segments: None, samples: 256 };
    Some([sky, Shot { name: "kitchen-sphere", scene: lit, camera, size, n_segments: None, samples: 512 }])
}

/// A wall that a wide lens focuses on, and the floor that it does not.
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
