//! Automatic choice of a camera.
//!
//! ```text
//! rays from points inside -> interior? -> one open side -> from outside, through that side
//!                                      -> closed        -> from the point and direction with the best view
//!                         -> object                     -> from outside, from direction (1, 0.6, 0.8)
//! ```
//!
//! From points inside its bounding box, an interior shows front faces nearly everywhere. A closed object shows back
//! faces, and an open one shows mostly the background. A pipe or a vessel shows front faces inside and outside, and is an object.

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

use canted_obb::{Aabb, PrimId};
use canted_scene::{Camera, Scene};
use canted_trace::{Hit, InstanceId, Intersect, Ray, Side};
use glam::DVec3;

use crate::{narrow, wide};

/// The direction from which objects are viewed.
const THREE_QUARTERS: DVec3 = DVec3::new(1.0, 0.6, 0.8);

/// Chooses a camera for `scene` and an image whose width is `aspect` times its height, with +y up; see [`frame_up`].
#[must_use]
pub fn frame(scene: &Scene, bvh: &dyn Intersect, aspect: f64) -> Camera {
    frame_up(scene, bvh, aspect, [0.0, 1.0, 0.0])
}

/// Chooses a camera for `scene` and an image whose width is `aspect` times its height. `up` is the scene's up direction, in
/// world space; a direction without length counts as +y.
///
/// Objects are viewed from direction (1, 0.6, 0.8), as large as the image allows; interiors with one open side from
/// outside, through it; closed interiors from inside, at two fifths of their height, from the point and direction with
/// the best view. Directions are those of a scene with +y up. The result does not depend on the acceleration structure.
#[must_use]
pub fn frame_up(scene: &Scene, bvh: &dyn Intersect, aspect: f64, up: [f32; 3]) -> Camera {
    let turn = Turn::of_up(up);
    let bounds = turn.bounds(scene);
    let probe = Probe { bvh, bounds, turn };
    let framed = if is_interior(&probe) && !(is_plain(scene) && is_closed_object(&probe)) {
        match open_side(&probe) {
            Some(side) => fit(scene, turn, bounds.center().into(), side, aspect),
            None => view(&probe, aspect),
        }
    } else {
        fit(scene, turn, bounds.center().into(), THREE_QUARTERS, aspect)
    };
    turn.camera(&framed)
}

/// Whether a scene has few materials, as a pipe or a vessel has; buildings, whose walls may have fronts on both sides, have many.
fn is_plain(scene: &Scene) -> bool {
    const MAX_PARTS: usize = 4;
    scene.meshes.iter().map(|mesh| mesh.parts.len()).sum::<usize>() <= MAX_PARTS
}

/// Casts rays in the bounding box of a scene whose up direction was turned to +y.
struct Probe<'a> {
    bvh: &'a dyn Intersect,
    bounds: Aabb,
    turn: Turn,
}

/// The closest hit of a ray.
enum RayResult {
    /// The front of a triangle.
    Front {
        /// Distance in world units.
        distance: f64,
        /// The triangle.
        triangle: (InstanceId, PrimId),
    },
    /// The back of a triangle.
    Back,
    /// No hit.
    Miss,
}

impl Probe<'_> {
    /// The point at relative coordinates in 0..=1.
    fn point_at(&self, relative: DVec3) -> DVec3 {
        DVec3::from(self.bounds.center()) + (relative - 0.5) * self.extent()
    }

    fn extent(&self) -> DVec3 {
        self.bounds.extent().into()
    }

    fn cast(&self, from: DVec3, direction: DVec3) -> RayResult {
        let [from, towards] = [from, direction].map(|v| narrow(self.turn.to_world(v)));
        match self.bvh.closest_hit(&Ray::new(from, towards)) {
            None => RayResult::Miss,
            Some(Hit { side: Side::Back, .. }) => RayResult::Back,
            Some(hit) => RayResult::Front {
                distance: f64::from(hit.t) * direction.length(),
                triangle: (hit.instance, hit.primitive),
            },
        }
    }
}

/// Point `i` of a low-discrepancy sequence in the unit cube, the R₃ sequence of Roberts 2018, *The Unreasonable
/// Effectiveness of Quasirandom Sequences*.
fn quasirandom(i: u32) -> DVec3 {
    /// The root of x⁴ = x + 1 above 1.
    const ROOT: f64 = 1.220_744_084_605_759_5;
    let component = |k: usize| {
        let step = (0..=k).fold(1.0, |step, _| step / ROOT);
        (0.5 + f64::from(i) * step).fract()
    };
    DVec3::from([0, 1, 2].map(component))
}

/// Vertical field of view: that of a short telephoto lens, with little distortion.
const FOV_DEGREES: f32 = 40.0;

/// Fraction of the image's half-width and half-height that the scene may fill.
const FILL: f64 = 0.95;

/// The camera that shows all vertices of a scene from `direction` (from `center` to the eye, not along y), as large as
/// possible and centered.
fn fit(scene: &Scene, turn: Turn, center: DVec3, direction: DVec3, aspect: f64) -> Camera {
    let forward = (-direction).try_normalize().unwrap_or(DVec3::NEG_Z);
    let right = forward.cross(DVec3::Y).try_normalize().unwrap_or(DVec3::X);
    let up = right.cross(forward);
    let slope = FILL * (0.5 * f64::from(FOV_DEGREES).to_radians()).tan();
    let (mut across, mut high) = (Extent::new(slope * aspect), Extent::new(slope));
    for_each_vertex(scene, |vertex| {
        let vertex = turn.to_local(vertex);
        let [x, y, z] = [right, up, forward].map(|axis| (vertex - center).dot(axis));
        across.add([x, z]);
        high.add([y, z]);
    });

    let nearest = across.nearest().max(high.nearest());
    // A scene without extent is viewed from distance 1.
    let distance = if nearest > 0.0 { nearest } else { 1.0 };
    let target = center + (right * across.offset(distance) + up * high.offset(distance));
    let eye = target - forward * distance;
    // Clamp for scenes that span the range of f32.
    let within = |v: DVec3| v.map(|x| x.clamp(f32::MIN.into(), f32::MAX.into()));
    Camera::pinhole(narrow(within(eye)), narrow(within(target)), narrow(DVec3::Y), FOV_DEGREES)
}

/// Visits every vertex that triangles use, in world space, once per instance.
fn for_each_vertex(scene: &Scene, mut visit: impl FnMut(DVec3)) {
    let used = |mesh: &canted_scene::Mesh| {
        let mut indices = mesh.triangles.as_flattened().to_vec();
        indices.sort_unstable();
        indices.dedup();
        indices.into_iter().map(|i| wide(mesh.positions[i as usize])).collect()
    };
    let meshes: Vec<Vec<DVec3>> = scene.meshes.iter().map(used).collect();
    for instance in &scene.instances {
        for &vertex in &meshes[instance.mesh.0 as usize] {
            visit(instance.world_from_object.point_f64(vertex.into()).into());
        }
    }
}

/// Number of slopes for which the extremes of the points are stored, evenly spaced.
const N_SLOPES: usize = 16;

/// Extremes of points along one axis of the image, by their offset and depth from the center.
///
/// For an eye at distance `d` and offset `e`, a point at offset `x` and depth `z` is within edges of slope `s` if
/// `|x - e| <= s·(z + d)`. So only the extremes of `x - s·z` and of `-x - s·z` matter.
struct Extent {
    steepest: f64,
    /// Both extremes for each slope.
    extremes: [[f64; 2]; N_SLOPES],
}

impl Extent {
    fn new(steepest: f64) -> Self {
        Self { steepest, extremes: [[f64::NEG_INFINITY; 2]; N_SLOPES] }
    }

    fn slope(&self, i: usize) -> f64 {
        self.steepest * (i + 1) as f64 / N_SLOPES as f64
    }

    fn add(&mut self, [x, z]: [f64; 2]) {
        for i in 0..N_SLOPES {
            let slope = self.slope(i);
            let [positive, negative] = &mut self.extremes[i];
            *positive = positive.max(x - slope * z);
            *negative = negative.max(-x - slope * z);
        }
    }

    /// Distance and offset of the closest eye that has all points within edges of slope `i`, touching both edges.
    fn touch(&self, i: usize) -> [f64; 2] {
        let [positive, negative] = self.extremes[i];
        [0.5 * (positive + negative) / self.slope(i), 0.5 * (positive - negative)]
    }

    /// Distance of the closest eye that sees all points.
    fn nearest(&self) -> f64 {
        self.touch(N_SLOPES - 1)[0]
    }

    /// Offset of an eye at `distance` that leaves equal margins at both edges, interpolated between the two nearest
    /// slopes. Zero without points.
    fn offset(&self, distance: f64) -> f64 {
        // The smaller the slope, the larger the distance.
        let i = (0..N_SLOPES).find(|&i| self.touch(i)[0] <= distance).unwrap_or(N_SLOPES - 1);
        let ([near, x], [far, x_far]) = (self.touch(i), self.touch(i.saturating_sub(1)));
        let weight = if far > near { (distance.min(far) - near) / (far - near) } else { 0.0 };
        let offset = x + weight * (x_far - x);
        if offset.is_finite() { offset } else { 0.0 }
    }
}

// A rotation that makes the up direction of a scene +y, so that all views are chosen for +y.

/// World-space directions of the local axes; the second is up.
#[derive(Clone, Copy)]
struct Turn([DVec3; 3]);

impl Turn {
    /// Directions along an axis give a rotation without rounding; +y gives none.
    fn of_up(up: [f32; 3]) -> Self {
        let up = wide(up).try_normalize().unwrap_or(DVec3::Y);
        // x stays to the right unless it is up.
        let right = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Z };
        let back = right.cross(up).try_normalize().unwrap_or(DVec3::Z);
        Self([up.cross(back), up, back])
    }

    fn to_world(self, DVec3 { x, y, z }: DVec3) -> DVec3 {
        let [right, up, back] = self.0;
        right * x + (up * y + back * z)
    }

    /// The local coordinates of a point in world space.
    fn to_local(self, point: DVec3) -> DVec3 {
        self.0.map(|axis| axis.dot(point)).into()
    }

    /// Local bounds of a scene: those of its box in world space.
    fn bounds(self, scene: &Scene) -> Aabb {
        let world = scene.bounds_world();
        if world.is_empty() {
            return world;
        }
        let mut local = Aabb::EMPTY;
        for corner in 0..8 {
            let side = |k: usize| if corner >> k & 1 == 0 { world.min[k] } else { world.max[k] };
            let point = wide([0, 1, 2].map(side));
            local.grow(narrow(self.to_local(point)));
        }
        local
    }

    /// A local camera in world space.
    fn camera(self, local: &Camera) -> Camera {
        let [eye, target, up] = [local.eye, local.target, local.up].map(|v| narrow(self.to_world(wide(v))));
        Camera { eye, target, up, ..*local }
    }
}

/// Rays cast from each point.
const N_DIRECTIONS: u32 = 64;

/// Fraction of rays that hit front faces from a point in an interior. Measured: interiors, including an atrium open at
/// the top and boxes open on one side, reach it at two thirds of their points or more; objects, lattices and landscapes
/// at a quarter at most.
const INTERIOR_FRACTION: f64 = 0.75;

/// Whether the scene is an interior: most points of its box see front faces in nearly all directions.
fn is_interior(probe: &Probe) -> bool {
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
fn is_closed_object(probe: &Probe) -> bool {
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
            RayResult::Back => n_back += 1,
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
fn open_side(probe: &Probe) -> Option<DVec3> {
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
fn view(probe: &Probe, aspect: f64) -> Camera {
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
        RayResult::Back => BACK.ln(),
        RayResult::Miss => BACKGROUND.ln(),
    };
    let triangle =
        |result: &RayResult| if let RayResult::Front { triangle, .. } = result { Some(*triangle) } else { None };
    let visible: Vec<&RayResult> = (0..COLUMNS).filter(is_visible).flat_map(|i| &columns[i]).collect();
    let distinct: BTreeSet<_> = visible.iter().filter_map(|result| triangle(result)).collect();
    let sum = visible.iter().map(|result| log_distance(result)).sum::<f64>() + DETAIL * distinct.len() as f64;
    sum / visible.len() as f64 + log_distance(&columns[center][ROWS / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn y_up_changes_nothing_and_z_up_permutes() {
        let point = DVec3::new(1.0, -2.5, 1e30);
        for up in [[0.0, 3.0, 0.0], [0.0; 3]] {
            assert_eq!((Turn::of_up(up).to_world(point), Turn::of_up(up).to_local(point)), (point, point));
        }
        let z = Turn::of_up([0.0, 0.0, 1.0]);
        assert_eq!(z.to_world(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(1.0, -3.0, 2.0));
        assert_eq!(z.to_local(z.to_world(point)), point);
    }

    #[test]
    fn turns_are_rotations() {
        for up in [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.3, -0.7, 0.2], [-5.0, 1.0, 1.0]] {
            let Turn([x, y, z]) = Turn::of_up(up);
            let right_handed = x.cross(y);
            for k in 0..3 {
                assert!((right_handed[k] - z[k]).abs() < 1e-12, "{up:?}");
            }
            assert!((x.length() - 1.0).abs() < 1e-12, "{up:?}");
        }
    }
}
