//! The built-in scene: a cable-stayed bridge over a river at low sun.
//!
//! ```text
//! build -> landscape -> structures -> Scene
//! ```
//!
//! Units are meters, y is up, the water is at `y = 0`. Most geometry is long, thin and diagonal, and instanced many times.

mod build;
mod landscape;
mod structures;
#[cfg(test)]
mod tests;

use canted_obb::vector::to_f32;

use crate::{Camera, Light, Scene};

/// Generates the built-in scene: one camera, a sun, a constant sky, Lambertian materials, no textures.
///
/// Every call gives the same bits on one platform. Across platforms the last bit of a vertex may differ, by the sine function.
#[must_use]
pub fn builtin() -> Scene {
    let mut builder = build::SceneBuilder::default();
    landscape::place(&mut builder);
    structures::place_bridge(&mut builder);
    let crane = builder.mesh(structures::crane());
    structures::place_site(&mut builder, crane);
    landscape::place_river(&mut builder, crane);

    let mut scene = builder.scene;
    scene.materials = build::Paint::materials();
    scene.lights =
        vec![Light::Sun { direction: to_f32(build::unit([0.78, -0.40, 0.48])), irradiance: [4.6, 3.45, 2.2] }];
    scene.environment = Some([0.36, 0.50, 0.72].into());
    scene.cameras = vec![Camera::pinhole([-300.0, 40.0, 250.0], [30.0, 48.0, 0.0], [0.0, 1.0, 0.0], 42.0)];
    scene.camera_names = vec![String::new()];
    scene
}
