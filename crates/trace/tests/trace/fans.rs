//! Isolated ribbons, which no closed surface backs: [`Watertight`] states down to which width they are hit.

use crate::inputs::{Rng, Triangle};
use crate::kernels::hit;
use canted_obb::vector::{cross, dot, sub};
use canted_trace::lanes::UNIT_ROUNDOFF;
use canted_trace::{Ray, ScaledRay, Watertight};

fn unit(v: [f32; 3]) -> [f32; 3] {
    v.map(|x| x / dot(v, v).sqrt())
}

/// A ribbon of so many ulps of its greatest distance from the ray's origin, of length 1 and in six triangles, and a ray at its
/// center line from a distance of 1 to 4.
fn ribbon_and_ray(rng: &mut Rng, n_ulps: f32) -> (Vec<Triangle>, ScaledRay) {
    let origin = rng.vector(1.0);
    let toward = unit(rng.vector(1.0));
    let distance = 1.0 + 3.0 * rng.signed().abs();
    let center: [f32; 3] = std::array::from_fn(|k| origin[k] + distance * toward[k]);
    let across = unit(cross(toward, rng.vector(1.0)));
    let along = unit(std::array::from_fn(|k| cross(across, toward)[k] + 0.5 * rng.signed() * toward[k]));
    let half_width = 0.5 * n_ulps * 2.0 * UNIT_ROUNDOFF * (distance + 0.5);
    let at = |along_by: f32, across_by: f32| -> [f32; 3] {
        std::array::from_fn(|k| center[k] + along_by * along[k] + across_by * half_width * across[k])
    };
    let stations = [-0.5, -0.2, 0.1, 0.5];
    let triangles = stations.windows(2).flat_map(|pair| {
        let [a, b, c, d] = [at(pair[0], -1.0), at(pair[1], -1.0), at(pair[1], 1.0), at(pair[0], 1.0)];
        [[a, b, c], [a, c, d]]
    });
    let target = at(0.45 * rng.signed(), 0.0);
    let ray = ScaledRay::new(&Ray::new(origin, sub(target, origin))).expect("a direction");
    (triangles.collect(), ray)
}

/// Rays, of 20,000, that miss the ribbon at which they aim.
fn n_missed(n_ulps: f32) -> usize {
    let mut rng = Rng(77);
    let misses = (0..20_000).filter(|_| {
        let (ribbon, ray) = ribbon_and_ray(&mut rng, n_ulps);
        !ribbon.iter().any(|triangle| hit::<Watertight>(&ray, triangle).is_some())
    });
    misses.count()
}

#[test]
fn isolated_ribbons_of_64_ulps_are_hit() {
    assert_eq!(n_missed(64.0), 0);
}

/// The limit is real: rays pass beside ribbons of one ulp, whose vertices are rounded to either side of them.
#[test]
fn narrower_ribbons_may_be_missed() {
    assert!(n_missed(1.0) > 100);
}
