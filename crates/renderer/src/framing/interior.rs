use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

use canted_scene::Camera;

use super::{Probe, Visible, spread};
use crate::Tracer;
use crate::vector::{Vector, add, length, narrow, scale};

/// Directions cast from each inside point.
const N_DIRECTIONS: u32 = 64;

/// Share of directions in which one sees front faces from a point in a room. Rooms that were measured, an atrium open
/// above and boxes open to one side among them, reach it at two thirds of their points and more; objects, lattices and
/// landscapes at a quarter of theirs at most.
const ROOM_SHARE: f64 = 0.75;

/// Whether the scene is a room: from most points of its box one sees front faces in nearly all directions.
pub(super) fn is_room<T: Tracer>(probe: &Probe<T>) -> bool {
    const N_POINTS: u32 = 128;
    // A margin keeps the points out of the outer walls.
    let n_inside = (0..N_POINTS).filter(|&i| is_inside(probe, probe.place(spread(i).map(|x| 0.05 + 0.9 * x)))).count();
    2 * n_inside > N_POINTS as usize
}

/// Whether one sees front faces in nearly all directions from a point.
fn is_inside<T: Tracer>(probe: &Probe<T>, point: Vector) -> bool {
    let is_front = |i| matches!(probe.look(point, on_sphere(i)), Visible::Front { .. });
    let n_front = (0..N_DIRECTIONS).filter(|&i| is_front(i)).count();
    n_front as f64 >= ROOM_SHARE * f64::from(N_DIRECTIONS)
}

/// Direction `i` of an even spread over the sphere: a spiral that turns by the golden angle.
fn on_sphere(i: u32) -> Vector {
    let height = 1.0 - f64::from(2 * i + 1) / f64::from(N_DIRECTIONS);
    let ring = (1.0 - height * height).sqrt();
    let (sine, cosine) = (f64::from(i) * PI * (3.0 - 5.0_f64.sqrt())).sin_cos();
    [ring * cosine, height, ring * sine]
}

/// The outward direction of the one upright side of the box through which most rays from inside escape.
pub(super) fn open_side<T: Tracer>(probe: &Probe<T>) -> Option<Vector> {
    const N_POINTS: u32 = 64;
    const OPEN_SHARE: f64 = 0.75;
    let sides: [Vector; 4] = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]];
    let mut open = sides.into_iter().filter(|&side| {
        let escapes = |i: &u32| matches!(probe.look(probe.place(spread(*i)), side), Visible::Sky);
        (0..N_POINTS).filter(escapes).count() as f64 > OPEN_SHARE * f64::from(N_POINTS)
    });
    open.next().filter(|_| open.next().is_none())
}

/// Vertical field of view inside a room, that of a wide lens.
const FOV_DEGREES: f32 = 60.0;

/// Eye height as a share of the room's.
const EYE_HEIGHT: f64 = 0.4;

/// Columns and rows of the look around that each candidate eye takes; the middle row is level.
const COLUMNS: usize = 32;
const ROWS: usize = 7;

/// The view in which one sees farthest and most: the best of all directions from a grid of places at eye height.
pub(super) fn view<T: Tracer>(probe: &Probe<T>, aspect: f64) -> Camera {
    /// Places along each side of the room; odd, so that the middle is among them.
    const N_PLACES: u32 = 15;
    let half_height = 0.5 * f64::from(FOV_DEGREES).to_radians();
    let half_width = (half_height.tan() * aspect).atan();
    let mut best = (f64::NEG_INFINITY, probe.place([0.5, EYE_HEIGHT, 0.5]), 0);
    for place in 0..N_PLACES * N_PLACES {
        let relative = |i: u32| (f64::from(i) + 0.5) / f64::from(N_PLACES);
        let eye = probe.place([relative(place % N_PLACES), EYE_HEIGHT, relative(place / N_PLACES)]);
        if !is_inside(probe, eye) {
            continue;
        }
        let columns = look_around(probe, eye, half_height.tan());
        for middle in 0..COLUMNS {
            let score = score(&columns, middle, half_width, length(probe.bounds.extent()));
            if score > best.0 {
                best = (score, eye, middle);
            }
        }
    }
    let (_, eye, middle) = best;
    let target = add(eye, scale(horizontal(azimuth(middle)), 0.5 * length(probe.bounds.extent())));
    Camera::pinhole(narrow(eye), narrow(target), [0.0, 1.0, 0.0], FOV_DEGREES)
}

fn azimuth(column: usize) -> f64 {
    TAU * column as f64 / COLUMNS as f64
}

fn horizontal(azimuth: f64) -> Vector {
    [azimuth.cos(), 0.0, azimuth.sin()]
}

/// What is seen all around from `eye`, up and down to slopes of `steepest`.
fn look_around<T: Tracer>(probe: &Probe<T>, eye: Vector, steepest: f64) -> [[Visible; ROWS]; COLUMNS] {
    std::array::from_fn(|column| {
        std::array::from_fn(|row| {
            let slope = steepest * ((2 * row + 1) as f64 / ROWS as f64 - 1.0);
            let [x, _, z] = horizontal(azimuth(column));
            probe.look(eye, [x, slope, z])
        })
    })
}

/// How much a picture about column `middle` shows: the mean logarithm of distances in diagonals of the room, plus that
/// of the sightline straight ahead, plus the share of sightlines that end on a triangle of their own.
///
/// The logarithm punishes what is close more than it rewards what is far; the sightline ahead turns the view along the
/// room and moves the eye to its end; the share tells where there is something to see from where there are bare walls.
fn score(columns: &[[Visible; ROWS]; COLUMNS], middle: usize, half_width: f64, diagonal: f64) -> f64 {
    /// The sky says little, and counts as a middling distance.
    const SKY: f64 = 0.1;
    /// A back face says that the eye is where it should not be.
    const BACK: f64 = 0.001;
    /// What a view full of detail is worth, in units of the logarithm.
    const DETAIL: f64 = 2.0;
    let is_seen = |i: &usize| {
        let turn = (azimuth(*i) - azimuth(middle)).abs();
        turn.min(TAU - turn) <= half_width
    };
    let far = |seen: &Visible| match seen {
        Visible::Front { distance, .. } => (distance / diagonal).max(BACK).ln(),
        Visible::Back => BACK.ln(),
        Visible::Sky => SKY.ln(),
    };
    let triangle = |seen: &Visible| if let Visible::Front { triangle, .. } = seen { Some(*triangle) } else { None };
    let seen: Vec<&Visible> = (0..COLUMNS).filter(is_seen).flat_map(|i| &columns[i]).collect();
    let distinct: BTreeSet<_> = seen.iter().filter_map(|seen| triangle(seen)).collect();
    let sum = seen.iter().map(|seen| far(seen)).sum::<f64>() + DETAIL * distinct.len() as f64;
    sum / seen.len() as f64 + far(&columns[middle][ROWS / 2])
}
