use canted_scene::{Camera, Scene};

use crate::vector::{Vector, add, cross, dot, narrow, scale, sub, unit, wide};

/// Vertical field of view, about that of a short telephoto lens: little distortion.
const FOV_DEGREES: f32 = 40.0;

/// Share of the picture's half-width and half-height that the scene may fill.
const FILL: f64 = 0.95;

/// The camera that sees all vertices of a scene from `direction` (from `center` to the eye, not along y), as large as
/// fits and in the middle.
pub(super) fn fit(scene: &Scene, center: Vector, direction: Vector, aspect: f64) -> Camera {
    const UP: Vector = [0.0, 1.0, 0.0];
    let forward = unit(scale(direction, -1.0)).unwrap_or([0.0, 0.0, -1.0]);
    let right = unit(cross(forward, UP)).unwrap_or([1.0, 0.0, 0.0]);
    let up = cross(right, forward);
    let slope = FILL * (0.5 * f64::from(FOV_DEGREES).to_radians()).tan();
    let (mut across, mut high) = (Strip::new(slope * aspect), Strip::new(slope));
    for_each_vertex(scene, |vertex| {
        let [x, y, z] = [right, up, forward].map(|axis| dot(sub(vertex, center), axis));
        across.add([x, z]);
        high.add([y, z]);
    });

    let nearest = across.nearest().max(high.nearest());
    // A scene without extent is seen from one unit away.
    let distance = if nearest > 0.0 { nearest } else { 1.0 };
    let target = add(center, add(scale(right, across.offset(distance)), scale(up, high.offset(distance))));
    let eye = sub(target, scale(forward, distance));
    // Of a scene that fills the range of numbers no point lies outside.
    let within = |v: Vector| v.map(|x| x.clamp(f32::MIN.into(), f32::MAX.into()));
    Camera::pinhole(narrow(within(eye)), narrow(within(target)), narrow(UP), FOV_DEGREES)
}

/// Every vertex that triangles use, in world space, once for each instance.
fn for_each_vertex(scene: &Scene, mut visit: impl FnMut(Vector)) {
    let used = |mesh: &canted_scene::Mesh| {
        let mut indices = mesh.triangles.as_flattened().to_vec();
        indices.sort_unstable();
        indices.dedup();
        indices.into_iter().map(|i| wide(mesh.positions[i as usize])).collect()
    };
    let meshes: Vec<Vec<Vector>> = scene.meshes.iter().map(used).collect();
    for instance in &scene.instances {
        for &vertex in &meshes[instance.mesh.0 as usize] {
            visit(instance.world_from_object.point_f64(vertex));
        }
    }
}

/// Slopes at which a strip remembers its outermost points, even parts of the steepest.
const N_SLOPES: usize = 16;

/// Points seen along one axis of the picture: offset along the axis, and depth, both from the centre.
///
/// From distance `d` and offset `e`, a point at offset `x` and depth `z` lies between edges of slope `s` where
/// `|x - e| <= s·(z + d)`: only the extremes of `x - s·z` and of `-x - s·z` decide.
struct Strip {
    steepest: f64,
    /// For each slope the two extremes.
    reach: [[f64; 2]; N_SLOPES],
}

impl Strip {
    fn new(steepest: f64) -> Self {
        Self { steepest, reach: [[f64::NEG_INFINITY; 2]; N_SLOPES] }
    }

    fn slope(&self, i: usize) -> f64 {
        self.steepest * (i + 1) as f64 / N_SLOPES as f64
    }

    fn add(&mut self, [x, z]: [f64; 2]) {
        for i in 0..N_SLOPES {
            let slope = self.slope(i);
            let [positive, negative] = &mut self.reach[i];
            *positive = positive.max(x - slope * z);
            *negative = negative.max(-x - slope * z);
        }
    }

    /// Distance and offset of the nearest eye between whose edges of slope `i` all points lie; both edges are touched.
    fn touch(&self, i: usize) -> [f64; 2] {
        let [positive, negative] = self.reach[i];
        [0.5 * (positive + negative) / self.slope(i), 0.5 * (positive - negative)]
    }

    /// Distance of the nearest eye that sees all points.
    fn nearest(&self) -> f64 {
        self.touch(N_SLOPES - 1)[0]
    }

    /// Offset of an eye at `distance`, at least the nearest, that leaves the same room at both edges: interpolated
    /// between the slopes that are touched from just within and just beyond. Zero for no points.
    fn offset(&self, distance: f64) -> f64 {
        // The gentler the slope, the farther the eye that touches it.
        let i = (0..N_SLOPES).find(|&i| self.touch(i)[0] <= distance).unwrap_or(N_SLOPES - 1);
        let ([near, x], [far, x_far]) = (self.touch(i), self.touch(i.saturating_sub(1)));
        let weight = if far > near { (distance.min(far) - near) / (far - near) } else { 0.0 };
        let offset = x + weight * (x_far - x);
        if offset.is_finite() { offset } else { 0.0 }
    }
}
