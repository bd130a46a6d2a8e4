//! Shapes of all sizes and orientations, and rays at them.

use canted_fixtures::SplitMix64;
use canted_obb::Aabb;
use canted_trace::{Ray, Sphere};
use canted_wide::Primitive;

use crate::shape::{Capsule, Disk};

/// A lattice of thin diagonal capsules, like struts.
pub(crate) fn struts(n: usize) -> Vec<Capsule> {
    let mut rng = SplitMix64::new(3);
    let directions = [[1.0, 1.0, 1.0], [1.0, -1.0, 0.5], [-0.5, 1.0, 1.0]];
    (0..n)
        .map(|i| {
            let a: [f32; 3] = std::array::from_fn(|_| (10.0 * rng.unit()).floor() as f32);
            let b = std::array::from_fn(|k| a[k] + 5.0 * directions[i % 3][k]);
            Capsule { ends: [a, b], radius: 0.02 }
        })
        .collect()
}

/// Capsules from points to needles, some without radius, some twice, all moved by `offset`.
pub(crate) fn capsules(n: usize, scale: f32, offset: f32) -> Vec<Capsule> {
    let mut rng = SplitMix64::new(5);
    let mut capsules: Vec<Capsule> = (0..n)
        .map(|i| {
            let a: [f32; 3] = std::array::from_fn(|_| scale * (8.0 * rng.unit() as f32 - 4.0) + offset);
            let length = scale * [0.0, 0.01, 1.0, 4.0][i % 4];
            let along: [f32; 3] = match i % 5 {
                0 => [1.0, 0.0, -0.0],
                1 => [0.0, 0.0, 1.0],
                _ => rng.on_sphere().map(|x| x as f32),
            };
            let b = std::array::from_fn(|k| a[k] + length * along[k]);
            Capsule { ends: [a, b], radius: scale * [0.0, 1e-4, 0.02, 0.3][i / 4 % 4] }
        })
        .collect();
    capsules.extend_from_within(..n / 5);
    capsules
}

/// Thin disks in all directions, some in planes of the axes, some almost without width.
pub(crate) fn disks(n: usize, scale: f32, offset: f32) -> Vec<Disk> {
    let mut rng = SplitMix64::new(7);
    (0..n)
        .map(|i| {
            let center = std::array::from_fn(|_| scale * (8.0 * rng.unit() as f32 - 4.0) + offset);
            let mut axes = [rng.on_sphere(), rng.on_sphere()].map(|axis| axis.map(|x| x as f32));
            if i % 6 == 0 {
                axes = [[1.0, 0.0, 0.0], [0.0, -0.0, 1.0]];
            }
            let sizes = [[1.0, 1.0], [1.0, 0.01], [0.1, 0.05], [2.0, 0.3]][i % 4];
            Disk { center, axes: std::array::from_fn(|k| axes[k].map(|x| scale * sizes[k] * x)) }
        })
        .collect()
}

pub(crate) fn spheres(n: usize, scale: f32, offset: f32) -> Vec<Sphere> {
    capsules(n, scale, offset).iter().map(|c| Sphere { center: c.ends[0], radius: c.radius }).collect()
}

/// Boxes, some flat, some points.
pub(crate) fn boxes(n: usize, scale: f32, offset: f32) -> Vec<Aabb> {
    capsules(n, scale, offset).iter().map(|c| Aabb::from_points(c.ends)).collect()
}

/// Rays at, past, along and from inside the shapes, from all distances, some bounded.
pub(crate) fn rays<P: Primitive>(shapes: &[P], n: usize) -> Vec<Ray> {
    let mut rng = SplitMix64::new(11);
    let all = shapes.iter().fold(Aabb::EMPTY, |all, shape| all.union(shape.bounds()));
    let size = all.extent().into_iter().fold(1e-30, f64::max) as f32;
    (0..n)
        .map(|i| {
            // A point at a corner, on the border, or inside the bounds of a shape.
            let bounds = shapes[rng.below(shapes.len())].bounds();
            let target: [f32; 3] = std::array::from_fn(|k| {
                let weight = [0.0, 1.0, 0.5, rng.unit() as f32][(i + 3 * k) % 4];
                bounds.min[k] + weight * (bounds.max[k] - bounds.min[k])
            });
            let from: [f32; 3] = rng.on_sphere().map(|x| x as f32);
            let distance = size * [0.0, 0.01, 1.0, 100.0, 1e5][i % 5];
            let origin: [f32; 3] = std::array::from_fn(|k| target[k] + distance * from[k]);
            let mut direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
            if i % 6 == 0 || direction == [0.0; 3] {
                direction = [[1.0, -0.0, 0.0], [-0.0, 0.0, -3.0], from][i / 6 % 3];
            }
            let mut ray = Ray::new(origin, direction);
            if i % 7 == 0 {
                (ray.t_min, ray.t_max) = (0.5, 1.25);
            }
            ray
        })
        .collect()
}
