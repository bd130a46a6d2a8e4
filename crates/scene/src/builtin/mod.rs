//! The scene that comes with the program: a cable-stayed bridge over a river at low sun.
//!
//! ```text
//! noise -> land      \
//! draft -> bridge     > stage -> Scene
//! draft -> site      /
//! ```
//!
//! Metres, y up, water at `y = 0`. Nearly everything is long, thin and out of its axes, most of it placed many times.

mod bridge;
mod draft;
mod land;
mod noise;
mod palette;
mod river;
mod site;
mod stage;
#[cfg(test)]
mod tests;

use crate::{Camera, Light, Scene};

/// Makes the built-in scene: one camera, one sun, a constant sky; Lambert materials, no textures.
///
/// The same on each call, on one platform bit for bit; the platform's sine may move the last bit of a vertex.
#[must_use]
pub fn builtin() -> Scene {
    let mut stage = stage::Stage::default();
    land::place(&mut stage);
    bridge::place(&mut stage);
    let crane = stage.mesh(site::crane());
    site::place(&mut stage, crane);
    river::place(&mut stage, crane);

    let mut scene = stage.scene;
    scene.materials = palette::Paint::materials();
    scene.lights = vec![Light::Sun { direction: unit([0.78, -0.40, 0.48]), irradiance: [4.6, 3.45, 2.2] }];
    scene.environment = Some([0.36, 0.50, 0.72].into());
    scene.cameras = vec![Camera::pinhole([-300.0, 40.0, 250.0], [30.0, 48.0, 0.0], [0.0, 1.0, 0.0], 42.0)];
    scene
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is how directions are stored")]
fn unit(direction: [f64; 3]) -> [f32; 3] {
    draft::unit(direction).map(|x| x as f32)
}
