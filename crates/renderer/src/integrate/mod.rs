//! Light that arrives along camera rays.

mod direct;
mod hybrid;

use canted_scene::Scene;

pub(crate) use hybrid::Hybrid;

/// Radiance from outside that a picture of `scene` uses.
///
/// What the file says; else none where the file has lights or emitters of its own, and white where it has neither,
/// so that no picture is black for want of light.
#[must_use]
pub fn environment_of(scene: &Scene) -> [f32; 3] {
    let emits = scene.materials.iter().any(|material| material.emission != [0.0; 3]);
    scene.environment.unwrap_or(if emits || !scene.lights.is_empty() { [0.0; 3] } else { [1.0; 3] })
}
