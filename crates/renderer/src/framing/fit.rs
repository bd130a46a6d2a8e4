//! The camera that shows an object as large as possible.

use canted_obb::Aabb;
use canted_scene::{Camera, Scene};
use glam::DVec3;

use super::turn::Turn;
use crate::{narrow, wide};

/// Vertical field of view: that of a short telephoto lens, with little distortion.
const FOV_DEGREES: f32 = 40.0;

/// Fraction of the image's half-width and half-height that the scene may fill.
const FILL: f64 = 0.95;

/// The camera that shows all vertices inside of `bounds`, in local coordinates, from `direction` (from the center to the eye, not along y), as
/// large as possible and centered.
pub(super) fn fit(scene: &Scene, turn: Turn, bounds: &Aabb, direction: DVec3, aspect: f64) -> Camera {
    let center = DVec3::from(bounds.center());
    let forward = (-direction).try_normalize().unwrap_or(DVec3::NEG_Z);
    let right = forward.cross(DVec3::Y).try_normalize().unwrap_or(DVec3::X);
    let up = right.cross(forward);
    let slope = FILL * (0.5 * f64::from(FOV_DEGREES).to_radians()).tan();
    let (mut across, mut high) = (Extent::new(slope * aspect), Extent::new(slope));
    let is_inside = within(bounds);
    for_each_vertex(scene, |_, vertex| {
        let vertex = turn.to_local(vertex);
        if is_inside(vertex) {
            let [x, y, z] = [right, up, forward].map(|axis| (vertex - center).dot(axis));
            across.add([x, z]);
            high.add([y, z]);
        }
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

/// Whether a point is inside of a box, up to its rounding.
pub(super) fn within(bounds: &Aabb) -> impl Fn(DVec3) -> bool {
    /// Relative to the diagonal: more than the roundings of a rotated point.
    const MARGIN: f64 = 1e-5;
    let margin = MARGIN * DVec3::from(bounds.extent()).length();
    let (min, max) = (wide(bounds.min) - margin, wide(bounds.max) + margin);
    move |point| point.cmpge(min).all() && point.cmple(max).all()
}

/// Visits every vertex of triangles and every ball of curves that can be seen, in world space, once per instance, with the instance and the number of the vertex. The
/// ground that was added to a scene is not visited, nor are invisible materials unless there are no others.
pub(super) fn for_each_vertex(scene: &Scene, mut visit: impl FnMut((usize, usize), DVec3)) {
    let is_visible = |part: &canted_scene::Part| !scene.materials[part.material.0 as usize].is_invisible();
    let all_count = !scene.meshes.iter().flat_map(|mesh| &mesh.parts).any(is_visible);
    let used = |mesh: &canted_scene::Mesh| {
        let mut is_used = vec![false; mesh.positions.len()];
        for (k, part) in mesh.parts.iter().enumerate().filter(|(_, part)| all_count || is_visible(part)) {
            let end = mesh.parts.get(k + 1).map_or(mesh.triangles.len(), |next| next.first_triangle as usize);
            let triangles =
                if mesh.curves.is_some() { &[][..] } else { &mesh.triangles[part.first_triangle as usize..end] };
            triangles.as_flattened().iter().for_each(|&i| is_used[i as usize] = true);
            let of_curves = mesh.curves.iter().flat_map(|curves| curves.segments.indices());
            of_curves.for_each(|&i| is_used[i as usize] = true);
        }
        is_used
    };
    let used: Vec<Vec<bool>> = scene.meshes.iter().map(used).collect();
    for (number, instance) in scene.instances.iter().enumerate() {
        if scene.ground == Some(number as u32) {
            continue;
        }
        let mesh = instance.mesh.0 as usize;
        for (vertex, &position) in scene.meshes[mesh].positions.iter().enumerate() {
            if used[mesh][vertex] {
                let placed =
                    |offset: DVec3| DVec3::from(instance.world_from_object.point_f64((wide(position) + offset).into()));
                visit((number, vertex), placed(DVec3::ZERO));
                // The tips of the ball around a point of a curve.
                let radius = scene.meshes[mesh].curves.as_ref().map(|curves| f64::from(curves.radii[vertex]));
                for tip in radius.into_iter().flat_map(|radius| DVec3::AXES.map(|axis| axis * radius)) {
                    visit((number, vertex), placed(tip));
                    visit((number, vertex), placed(-tip));
                }
            }
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
