//! Rays that pass a box at a known distance; aimed rays only miss by a rounding.

use canted_fixtures::SplitMix64;
use canted_obb::Obb;
use canted_tests::{clouds::random_rotation, extremes::slab};
use canted_trace::Ray;

/// Distances relative to the size of the box, and their names.
pub(super) const SHARES: [(f64, &str); 3] = [
    (1e-6, "passes an oriented box at 1e-6 of its size"),
    (1e-3, "passes it at 1e-3 of its size"),
    (1.0, "passes it at its size"),
];

/// Distance of the origin, relative to the size of the box.
const AWAY: f64 = 2.0;

/// `n` rays that pass oriented boxes at `share` of their greatest edge, up to the rounding of origin and direction.
pub(super) fn pairs(share: f64, n: usize) -> Vec<slab::Pair> {
    let mut rng = SplitMix64::new(72);
    (0..n).map(|_| pair(&mut rng, share)).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "rays and boxes are rounded like everything")]
fn pair(rng: &mut SplitMix64, share: f64) -> slab::Pair {
    let [center, half] = [0; 2].map(|_: u8| rng.signed3());
    let obb = Obb {
        center: center.map(|x| x as f32),
        frame: random_rotation(rng).frame(),
        half_extents: half.map(|x| x.abs() as f32),
    };
    let size = 2.0 * obb.half_extents.into_iter().fold(0.0, |most: f64, half| most.max(f64::from(half)));
    // A corner, or a point of an edge or a face: `place` is in half-extents, at least one of them ±1.
    let mut place: [f64; 3] = std::array::from_fn(|_| [-1.0, 1.0, rng.signed()][rng.below(3)]);
    place[rng.below(3)] = [-1.0, 1.0][rng.below(2)];
    let axis = |k: usize| obb.frame[k].map(f64::from);
    let sum =
        |of: &dyn Fn(usize) -> f64| -> [f64; 3] { std::array::from_fn(|i| (0..3).map(|k| of(k) * axis(k)[i]).sum()) };
    let point = sum(&|k| place[k] * f64::from(obb.half_extents[k]));
    // The box lies behind any plane through the point whose normal points outward along every axis that ends there.
    let weights: [f64; 3] = std::array::from_fn(|_| rng.unit());
    let outward = |k: usize| if place[k].abs() == 1.0 { place[k] * (0.1 + weights[k]) } else { 0.0 };
    let normal = unit(sum(&outward));
    let any = rng.on_sphere();
    let along = any.iter().zip(normal).map(|(a, b)| a * b).sum::<f64>();
    let direction = unit(std::array::from_fn(|i| any[i] - along * normal[i]));
    let origin = std::array::from_fn(|i| {
        (f64::from(obb.center[i]) + point[i] + size * (share * normal[i] - AWAY * direction[i])) as f32
    });
    (Ray::new(origin, direction.map(|x| x as f32)), obb)
}

fn unit(x: [f64; 3]) -> [f64; 3] {
    let length = x.iter().map(|x| x * x).sum::<f64>().sqrt();
    x.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use canted_tests::exact::intersects_box;

    use super::*;

    #[test]
    fn rays_pass_at_the_stated_distance() {
        for (share, what) in SHARES {
            let pairs = pairs(share, 60);
            let n_hit = pairs.iter().filter(|(ray, obb)| intersects_box(ray, obb)).count();
            // Rounding moves a distant origin by a few 1e-7 of the size.
            assert!(n_hit <= if share < 1e-5 { 12 } else { 0 }, "{what}: {n_hit}");
            // A box enlarged by a third of the distance is still missed, one enlarged by twice the distance is hit.
            let grown = |obb: &Obb, by: f64| {
                let size = 2.0 * obb.half_extents.into_iter().fold(0.0, f32::max);
                #[expect(clippy::cast_possible_truncation, reason = "a box that is about so large")]
                let by = (by * share) as f32 * size;
                Obb { half_extents: obb.half_extents.map(|half| half + by), ..*obb }
            };
            let n_of = |by: f64| pairs.iter().filter(|(ray, obb)| intersects_box(ray, &grown(obb, by))).count();
            assert!(share < 1e-5 || n_of(0.33) == 0, "{what}");
            assert!(n_of(2.0) == pairs.len(), "{what}: {} of {}", n_of(2.0), pairs.len());
        }
    }
}
