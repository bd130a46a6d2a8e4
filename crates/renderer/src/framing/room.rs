//! Interiors: whether a scene is one, and the view of it.

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

use canted_scene::Camera;
use glam::DVec3;

use super::probe::{Probe, RayResult, quasirandom};
use crate::narrow;

/// Rays cast from each point.
const N_DIRECTIONS: u32 = 64;

/// Fraction of rays that hit front faces from a point in an interior. Measured: interiors, including an atrium open at
/// the top and boxes open on one side, reach it at two thirds of their points or more; objects, lattices and landscapes
/// at a quarter at most.
const INTERIOR_FRACTION: f64 = 0.75;

/// Whether the scene is an interior: most points of its box see front faces in nearly all directions.
pub(super) fn is_interior(probe: &Probe) -> bool {
    const N_POINTS: u32 = 128;
    // A margin keeps the points out of the outer walls.
    let n_inside =
        (0..N_POINTS).filter(|&i| is_inside(probe, probe.point_at(quasirandom(i).map(|x| 0.05 + 0.9 * x)))).count();
    2 * n_inside > N_POINTS as usize
}

/// Whether a point sees front faces in nearly all directions.
fn is_inside(probe: &Probe, point: DVec3) -> bool {
    let is_front = |i| matches!(probe.cast(point, fibonacci_direction(i)), RayResult::Front { .. });
    let n_front = (0..N_DIRECTIONS).filter(|&i| is_front(i)).count();
    n_front as f64 >= INTERIOR_FRACTION * f64::from(N_DIRECTIONS)
}

/// Whether nearly all rays from outside towards points inside meet front faces: a pipe or a vessel, but no room, whose
/// walls have their fronts inside.
pub(super) fn is_closed_object(probe: &Probe) -> bool {
    /// Fraction of the rays that meet the scene.
    const FRONT_FRACTION: f64 = 0.9;
    const N_RAYS: u32 = 256;
    let distance = probe.extent().length();
    let (mut n_front, mut n_back) = (0_u32, 0_u32);
    for i in 0..N_RAYS {
        let direction = fibonacci_direction(i * N_DIRECTIONS / N_RAYS);
        let from = probe.point_at(quasirandom(i)) + direction * (-2.0 * distance);
        match probe.cast(from, direction) {
            RayResult::Front { .. } => n_front += 1,
            RayResult::Back { .. } => n_back += 1,
            RayResult::Miss => {}
        }
    }
    f64::from(n_front) >= FRONT_FRACTION * f64::from(n_front + n_back) && n_front > 0
}

/// Direction `i` of a spherical Fibonacci spiral.
fn fibonacci_direction(i: u32) -> DVec3 {
    let height = 1.0 - f64::from(2 * i + 1) / f64::from(N_DIRECTIONS);
    let ring = (1.0 - height * height).sqrt();
    let (sine, cosine) = (f64::from(i) * PI * (3.0 - 5.0_f64.sqrt())).sin_cos();
    DVec3::new(ring * cosine, height, ring * sine)
}

/// The outward direction of the only vertical side of the box through which most rays from inside escape.
pub(super) fn open_side(probe: &Probe) -> Option<DVec3> {
    const N_POINTS: u32 = 64;
    const OPEN_FRACTION: f64 = 0.75;
    let sides: [DVec3; 4] = [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::NEG_X];
    let mut open = sides.into_iter().filter(|&side| {
        let escapes = |i: &u32| matches!(probe.cast(probe.point_at(quasirandom(*i)), side), RayResult::Miss);
        (0..N_POINTS).filter(escapes).count() as f64 > OPEN_FRACTION * f64::from(N_POINTS)
    });
    open.next().filter(|_| open.next().is_none())
}

/// Vertical field of view inside: that of a wide-angle lens.
const FOV_INSIDE_DEGREES: f32 = 60.0;

/// Eye height relative to the height of the box.
const EYE_HEIGHT: f64 = 0.4;

/// Columns and rows of the panorama from each candidate eye; the center row is horizontal.
const COLUMNS: usize = 32;
const ROWS: usize = 7;

/// The best view of all directions from a grid of points at eye height.
pub(super) fn view(probe: &Probe, aspect: f64) -> Camera {
    /// Points along each side of the box; odd, so that the center is one of them.
    const N_POINTS: u32 = 15;
    let half_height = 0.5 * f64::from(FOV_INSIDE_DEGREES).to_radians();
    let half_width = (half_height.tan() * aspect).atan();
    let mut best = (f64::NEG_INFINITY, probe.point_at(DVec3::new(0.5, EYE_HEIGHT, 0.5)), 0);
    for point in 0..N_POINTS * N_POINTS {
        let relative = |i: u32| (f64::from(i) + 0.5) / f64::from(N_POINTS);
        let eye = probe.point_at(DVec3::new(relative(point % N_POINTS), EYE_HEIGHT, relative(point / N_POINTS)));
        if !is_inside(probe, eye) {
            continue;
        }
        let columns = panorama(probe, eye, half_height.tan());
        for center in 0..COLUMNS {
            let score = score(&columns, center, half_width, probe.extent().length());
            if score > best.0 {
                best = (score, eye, center);
            }
        }
    }
    let (_, eye, center) = best;
    let target = eye + horizontal(azimuth(center)) * (0.5 * probe.extent().length());
    Camera::pinhole(narrow(eye), narrow(target), [0.0, 1.0, 0.0], FOV_INSIDE_DEGREES)
}

fn azimuth(column: usize) -> f64 {
    TAU * column as f64 / COLUMNS as f64
}

fn horizontal(azimuth: f64) -> DVec3 {
    DVec3::new(azimuth.cos(), 0.0, azimuth.sin())
}

/// Casts rays all around from `eye`, with slopes up to `steepest`.
fn panorama(probe: &Probe, eye: DVec3, steepest: f64) -> [[RayResult; ROWS]; COLUMNS] {
    std::array::from_fn(|column| {
        std::array::from_fn(|row| {
            let slope = steepest * ((2 * row + 1) as f64 / ROWS as f64 - 1.0);
            probe.cast(eye, horizontal(azimuth(column)).with_y(slope))
        })
    })
}

/// Scores a view centered at column `center`: the mean logarithm of distances relative to the diagonal of the box, plus
/// the logarithm of the distance straight ahead, plus the fraction of rays that hit distinct triangles.
///
/// The logarithm penalizes close surfaces more than it rewards distant ones. The distance straight ahead aligns the
/// view with the length of the room and moves the eye to its end. The fraction of distinct triangles favors detail over
/// bare walls.
fn score(columns: &[[RayResult; ROWS]; COLUMNS], center: usize, half_width: f64, diagonal: f64) -> f64 {
    /// Relative distance that counts for the background.
    const BACKGROUND: f64 = 0.1;
    /// Back faces mean that the eye is outside the room.
    const BACK: f64 = 0.001;
    /// Weight of detail relative to the logarithms.
    const DETAIL: f64 = 2.0;
    let is_visible = |i: &usize| {
        let angle = (azimuth(*i) - azimuth(center)).abs();
        angle.min(TAU - angle) <= half_width
    };
    let log_distance = |result: &RayResult| match result {
        RayResult::Front { distance, .. } => (distance / diagonal).max(BACK).ln(),
        RayResult::Back { .. } => BACK.ln(),
        RayResult::Miss => BACKGROUND.ln(),
    };
    let triangle =
        |result: &RayResult| if let RayResult::Front { triangle, .. } = result { Some(*triangle) } else { None };
    let visible: Vec<&RayResult> = (0..COLUMNS).filter(is_visible).flat_map(|i| &columns[i]).collect();
    let distinct: BTreeSet<_> = visible.iter().filter_map(|result| triangle(result)).collect();
    let sum = visible.iter().map(|result| log_distance(result)).sum::<f64>() + DETAIL * distinct.len() as f64;
    sum / visible.len() as f64 + log_distance(&columns[center][ROWS / 2])
}
