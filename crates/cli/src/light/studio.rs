//! A studio: soft panels over a gradient with a horizon, without color.
//!
//! Panels give metal something to reflect: a key light from the left, above and in front, a fill from the right, and two rim lights from
//! behind. All are rectangles with soft edges at an infinite distance.
//! The key is nearly in front, so that what faces the viewer is bright, and large: smaller ones make more noise.

use glam::DVec3;

/// A panel: the direction to its center, half its width and height at distance 1, and its radiance.
struct Panel {
    center: [f64; 3],
    half: [f64; 2],
    radiance: f64,
}

const PANELS: [Panel; 4] = [
    Panel { center: [-0.4, 0.85, 1.0], half: [0.75, 0.6], radiance: 2.75 },
    Panel { center: [1.0, 0.2, 0.3], half: [0.3, 0.65], radiance: 1.1 },
    Panel { center: [-0.35, 0.5, -1.0], half: [1.0, 0.22], radiance: 1.8 },
    Panel { center: [0.9, 0.35, -0.75], half: [0.18, 0.6], radiance: 1.7 },
];

/// Half the width of the soft edge of a panel, at distance 1.
const EDGE: f64 = 0.12;

/// Factor of all radiance, so that no direction lights a white surface to more than white: the greatest irradiance, on a surface that
/// faces the key light, is 1.23 pi without it.
const SCALE: f64 = 0.74;

/// The radiance from a direction of unit length, with +y up and the viewer at +z.
pub(super) fn radiance(direction: DVec3) -> DVec3 {
    let wall = 0.20 + 0.32 * direction.y.max(0.0);
    let floor = 0.17 + 0.08 * (-direction.y).max(0.0);
    let mut radiance = floor + (wall - floor) * smooth(-0.04, 0.06, direction.y);
    for Panel { center, half: [width, height], radiance: of_panel } in &PANELS {
        let center = DVec3::from(*center).normalize();
        let right = DVec3::Y.cross(center).normalize();
        let depth = direction.dot(center);
        if depth > 0.05 {
            let [x, y] = [right, center.cross(right)].map(|axis| (direction.dot(axis) / depth).abs());
            let inside = |x: f64, half: f64| 1.0 - smooth(half - EDGE, half + EDGE, x);
            radiance += (of_panel - radiance) * inside(x, *width) * inside(y, *height);
        }
    }
    DVec3::splat(SCALE * radiance)
}

/// 0 up to `low`, 1 from `high` on, and a cubic in between.
fn smooth(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
