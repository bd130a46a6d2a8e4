//! Your own shape: a flat disk, in a BVH with oriented nodes.
#![expect(
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    reason = "an example prints its results; f32 is what hits hold"
)]

use canted::build::obb::vector::{cross, dot, sub, to_f64};
use canted::{
    Aabb, Config, Moments, NodeKind, Primitive, PrimitiveHit, Ray, ScaledRay, Side, WideBvh, bounds_of_points,
    extent_of_points,
};

/// All points `center + x·a + y·b` with `x² + y² <= 1`; `a` and `b` are orthogonal and of equal length.
struct Disk {
    center: [f32; 3],
    a: [f32; 3],
    b: [f32; 3],
}

impl Disk {
    /// Corners of a square around the disk.
    fn corners(&self) -> [[f32; 3]; 4] {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| [0, 1, 2].map(|k| self.center[k] + x * self.a[k] + y * self.b[k]))
    }
}

impl Primitive for Disk {
    fn bounds(&self) -> Aabb {
        bounds_of_points(self.corners(), 0.0)
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_points(self.corners(), 0.0, direction)
    }

    fn moments(&self) -> Moments {
        Moments::from_points(self.corners())
    }

    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let [o, d, c, a, b] = [ray.origin, ray.direction, self.center, self.a, self.b].map(to_f64);
        let normal = cross(a, b);
        let t = (dot(sub(c, o), normal) / dot(d, normal)) as f32;
        let p = sub(std::array::from_fn(|k| o[k] + f64::from(t) * d[k]), c);
        let (x, y) = (dot(p, a) / dot(a, a), dot(p, b) / dot(b, b));
        let is_hit = ray.t_min <= t && t <= t_max && x * x + y * y <= 1.0;
        let side = if dot(d, normal) < 0.0 { Side::Front } else { Side::Back };
        is_hit.then_some(PrimitiveHit { t, u: x as f32, v: y as f32, side })
    }
}

fn main() -> Result<(), canted::PrimitiveError> {
    // Clusters of large parallel disks, each cluster with its own orientation.
    let disks = (0..4096_u16)
        .map(|i| {
            let (sin, cos) = f32::from(i / 64).sin_cos();
            let [x, y] = [i / 64 % 8, i / 512].map(|k| 10.0 * f32::from(k));
            let along = 0.01 * f32::from(i % 64);
            Disk { center: [x - along * sin, y + along * cos, 0.0], a: [3.0 * cos, 3.0 * sin, 0.0], b: [0.0, 0.0, 3.0] }
        })
        .collect();
    let bvh = WideBvh::<Disk>::build(disks, &Config::default())?;
    let oriented = bvh.sizes().nodes[NodeKind::Oriented as usize];
    println!("{} primitives, {oriented} oriented nodes", bvh.n_primitives());
    let hit = bvh.closest_hit(&Ray::new([21.0, 60.0, 0.1], [0.0, -1.0, 0.0]));
    println!("{:?}", hit.map(|hit| (hit.primitive.0, hit.t)));
    Ok(())
}
