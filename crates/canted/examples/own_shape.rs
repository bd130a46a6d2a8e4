//! Your own shape: a flat disk. Two methods are enough; the others have defaults.
#![expect(clippy::print_stdout, reason = "an example prints its results")]

use canted::kernel::{PrimitiveHit, ScaledRay};
use canted::{Aabb, Intersect, Primitive, Ray, Side, WideBvh};

/// A disk across z.
struct Disk {
    center: [f32; 3],
    radius: f32,
}

impl Primitive for Disk {
    fn bounds(&self) -> Aabb {
        let ([x, y, z], r) = (self.center, self.radius);
        Aabb { min: [x - r, y - r, z], max: [x + r, y + r, z] }
    }

    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let t = (self.center[2] - ray.origin[2]) / ray.direction[2];
        let [x, y] = [0, 1].map(|k| (ray.origin[k] + t * ray.direction[k] - self.center[k]) / self.radius);
        let is_hit = ray.t_min <= t && t <= t_max && x * x + y * y <= 1.0;
        let side = if ray.direction[2] < 0.0 { Side::Front } else { Side::Back };
        is_hit.then_some(PrimitiveHit { t, u: x, v: y, side })
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let disks = (0..4096_u16)
        .map(|i| {
            let [x, y, z] = [i % 16, i / 16 % 16, i / 256].map(f32::from);
            Disk { center: [x, y, z], radius: 0.4 }
        })
        .collect();
    let bvh = WideBvh::over(disks)?;
    let hit = bvh.closest_hit(&Ray::new([5.1, 7.2, 20.5], [0.0, 0.0, -1.0]));
    println!("{} disks, {:?}", bvh.n_primitives(), hit.map(|hit| (hit.primitive.0, hit.t)));
    Ok(())
}
