//! Light that arrives along camera rays.

mod direct;
mod hybrid;

use canted_scene::{Environment, Material, Scene};

pub(crate) use hybrid::Hybrid;

/// Radiance from outside that a picture of `scene` uses.
///
/// What the file says; else none where the file has lights or emitters of its own, and white where it has neither,
/// so that no picture is black for want of light.
#[must_use]
pub fn environment_of(scene: &Scene) -> [f32; 3] {
    let emits = scene.materials.iter().any(Material::emits);
    match &scene.environment {
        Some(Environment::Constant(radiance)) => *radiance,
        Some(Environment::Image(image)) => image.scale,
        None if emits || !scene.lights.is_empty() => [0.0; 3],
        None => [1.0; 3],
    }
}
