//! Sponza with sun, sky and a sphere light. The numbers equal those of `tests/oracle/scenes.py`.

use canted_scene::{Camera, Environment, Light, Scene, read_environment};
use canted_tests::models::models;

use crate::shots::{BLUE, Shot, model, with_sun};

const SIZE: [u32; 2] = [96, 64];

fn across() -> Camera {
    Camera::pinhole([700.0, 700.0, -100.0], [-300.0, 250.0, 100.0], [0.0, 1.0, 0.0], 60.0)
}

/// At noon, seen across its court; paths of three segments.
pub(crate) fn sun(test: &str) -> Option<Shot> {
    let scene = Scene { environment: Some(BLUE.into()), ..model(test, "sponza/sponza.obj")? };
    let scene = with_sun(scene, [-0.15, -1.0, 0.12], [12.0, 11.0, 9.0]);
    Some(Shot { name: "sponza-sun-3", scene, camera: across(), size: SIZE, n_segments: Some(3), samples: 128 })
}

/// The same with unlimited paths.
pub(crate) fn sun_paths(test: &str) -> Option<Shot> {
    Some(Shot { name: "sponza-sun", n_segments: None, samples: 768, ..sun(test)? })
}

/// Lit by a sphere light in the court, above the visible part.
pub(crate) fn ball(test: &str) -> Option<Shot> {
    let light = Light::Sphere { center: [200.0, 1000.0, 0.0], radius: 100.0, radiance: [30.0, 27.0, 20.0] };
    let scene = Scene { lights: vec![light], ..model(test, "sponza/sponza.obj")? };
    Some(Shot { name: "sponza-sphere", scene, camera: across(), size: SIZE, n_segments: None, samples: 256 })
}

/// The court from above, under a blue sky.
pub(crate) fn blue_sky(test: &str) -> Option<Shot> {
    let scene = Scene { environment: Some(BLUE.into()), ..model(test, "sponza/sponza.obj")? };
    let camera = Camera::pinhole([600.0, 1350.0, 0.0], [-300.0, 450.0, 0.0], [0.0, 1.0, 0.0], 60.0);
    Some(Shot { name: "sponza-env", scene, camera, size: SIZE, n_segments: None, samples: 512 })
}

/// The same under an image of the sky.
pub(crate) fn image_sky(test: &str) -> Option<Shot> {
    let shot = blue_sky(test)?;
    let image = read_environment(&models(test)?.join("env/sky_64x32.exr"), &mut Vec::new()).unwrap();
    let scene = Scene { environment: Some(Environment::Image(image)), ..shot.scene };
    Some(Shot { name: "sponza-sky", scene, ..shot })
}
