//! Intervals contain the exact projections.

use canted_fixtures::{SplitMix64, sum_is_positive};
use canted_obb::Aabb;
use canted_wide::{bounds_of_points, extent_of_box, extent_of_points};

/// Whether `lo <= direction·point <= hi`, by exact products and sums.
fn contains([lo, hi]: [f32; 2], direction: [f32; 3], point: [f32; 3]) -> bool {
    let [x, y, z]: [f64; 3] = std::array::from_fn(|k| f64::from(direction[k]) * f64::from(point[k]));
    sum_is_positive(&[x, y, z, -f64::from(lo)]) && sum_is_positive(&[-x, -y, -z, f64::from(hi)])
}

fn random(rng: &mut SplitMix64, scale: f64, offset: f64) -> [f32; 3] {
    std::array::from_fn(|_| (scale * rng.signed() + offset) as f32)
}

#[test]
fn intervals_contain_exact_projections_and_little_else() {
    let mut rng = SplitMix64::new(1);
    for i in 0..20_000 {
        let (scale, offset) = [(1.0, 0.0), (1e-30, 0.0), (1e15, 0.0), (1.0, 1e7), (1e-3, -1.0)][i % 5];
        let points = [(); 3].map(|()| random(&mut rng, scale, offset));
        let direction = rng.on_sphere().map(|x| x as f32);
        let extent = extent_of_points(points, 0.0, direction);
        assert!(points.iter().all(|&point| contains(extent, direction, point)), "{points:?} {direction:?}");
        // An interval one unit shorter at either end misses a point.
        for shorter in [[extent[0].next_up(), extent[1]], [extent[0], extent[1].next_down()]] {
            let loose = points.iter().all(|&point| contains(shorter, direction, point));
            // Errors of f64 may widen the interval by one unit of f32, not by two.
            let [lo, hi] = [shorter[0].next_up(), shorter[1].next_down()];
            assert!(!loose || !points.iter().all(|&point| contains([lo, hi], direction, point)));
        }
        let aabb = Aabb::from_points(points);
        let extent = extent_of_box(&aabb, direction);
        assert!(aabb.corners().iter().all(|&corner| contains(extent, direction, corner)));
    }
}

#[test]
fn radii_widen_intervals_and_boxes() {
    let (points, radius) = ([[1.0, 2.0, 3.0], [-4.0, 0.5, 0.25]], 0.1_f32);
    let bounds = bounds_of_points(points, radius);
    for k in 0..3 {
        let axis = std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 });
        let [lo, hi] = extent_of_points(points, radius, axis);
        let (least, greatest) = (points[0][k].min(points[1][k]), points[0][k].max(points[1][k]));
        for (lo, hi) in [(lo, hi), (bounds.min[k], bounds.max[k])] {
            // In f64 these sums are exact.
            assert!(f64::from(lo) <= f64::from(least) - f64::from(radius));
            assert!(f64::from(hi) >= f64::from(greatest) + f64::from(radius));
            assert!(hi - lo < 1.000_001 * (greatest - least + 2.0 * radius));
        }
    }
    assert_eq!(bounds_of_points([[3.0, 0.0, 0.0]], 1.0), Aabb { min: [2.0, -1.0, -1.0], max: [4.0, 1.0, 1.0] });
    // What f64 cannot hold is rounded outward, too.
    let tiny = bounds_of_points([[1.0; 3]], 1e-30);
    assert_eq!((tiny.min, tiny.max), ([1.0f32.next_down(); 3], [1.0f32.next_up(); 3]));
}

#[test]
fn no_points_and_nan_give_no_box() {
    assert!(bounds_of_points([], 1.0).is_empty());
    assert!(bounds_of_points([[0.0; 3], [0.0, f32::NAN, 0.0]], 1.0).min[0].is_nan());
    let [lo, hi] = extent_of_points([], 1.0, [1.0, 0.0, 0.0]);
    assert!(lo > hi);
}
