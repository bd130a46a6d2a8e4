use canted_obb::Aabb;
use canted_trace::{Ray, Sphere, lanes::UNIT_ROUNDOFF, segment_overlaps_aabb};
use num_traits::{Signed, Zero};

use crate::inputs::{self, Q, Rng, SETTINGS, UNIT_ROUNDOFF_F64, q, q3};

#[test]
fn five_cases_of_a_sphere() {
    let sphere = Sphere { center: [0.0, 0.0, 10.0], radius: 2.0 };
    let towards = |z: f32| Ray::new([0.0, 0.0, z], [0.0, 0.0, 0.5]);
    assert_eq!(sphere.roots(&towards(0.0)), Some([16.0, 24.0]));
    assert_eq!(sphere.intersect(&towards(0.0)), Some(16.0));
    assert_eq!(sphere.intersect(&towards(20.0)), None);
    assert_eq!(sphere.roots(&towards(20.0)), Some([-24.0, -16.0]));
    assert_eq!(sphere.intersect(&Ray::new([2.0, 0.0, 0.0], [0.0, 0.0, 1.0])), Some(10.0));
    // From inside it is the exit, not zero.
    assert_eq!(sphere.intersect(&towards(10.0)), Some(4.0));
    assert_eq!(sphere.intersect(&Ray::new([2.001, 0.0, 0.0], [0.0, 0.0, 1.0])), None);
    // The interval is closed, and a first root before it leaves the second.
    assert_eq!(sphere.intersect(&Ray { t_min: 24.0, ..towards(0.0) }), Some(24.0));
    assert_eq!(sphere.intersect(&Ray { t_min: 17.0, t_max: 23.0, ..towards(0.0) }), None);
}

/// Rounding of `t` in f64, relative to the coordinates over the direction: some ten roundings, as a power of two.
const IN_F64: f64 = 16.0 * UNIT_ROUNDOFF_F64;

#[test]
fn small_distant_spheres_are_accurate() {
    let mut rng = Rng(40);
    let mut n_hits = 0;
    for (radius, distance) in [(1e-3, 1e4), (1.0, 3.0), (1e6, 10.0), (1e-10, 1e-3), (0.0, 1.0)] {
        for _ in 0..400 {
            let sphere = Sphere { center: rng.vector(distance), radius };
            let (origin, offset) = (rng.vector(distance), rng.vector(1.2 * radius));
            let direction = std::array::from_fn(|k| sphere.center[k] + offset[k] - origin[k]);
            let from_center = |t: &Q| -> Q {
                let at: inputs::Q3 = std::array::from_fn(|k| q(origin[k]) + t * q(direction[k]) - q(sphere.center[k]));
                inputs::dot(&at, &at)
            };
            let (d, m) = (q3(direction), inputs::sub(&q3(sphere.center), &q3(origin)));
            let closest = inputs::dot(&m, &d) / inputs::dot(&d, &d);
            let span = q(IN_F64) * (inputs::reach(&m) + q(radius)) / inputs::reach(&d);
            let squared = q(radius) * q(radius);
            let Some([near, far]) = sphere.roots(&Ray::new(origin, direction)) else {
                // A miss, or a tangent within f64.
                let slack = q(IN_F64) * inputs::dot(&m, &m);
                assert!(from_center(&closest) + slack > squared, "{sphere:?} is lost");
                continue;
            };
            n_hits += 1;
            // The exact roots lie where the distance crosses the radius; the chord of a near tangent may vanish.
            for (root, inward) in [(near, q(1.0)), (far, q(-1.0))] {
                let width = q(UNIT_ROUNDOFF) * q(root).abs() + &span;
                let (before, after) = (q(root) - &inward * &width, q(root) + &inward * &width);
                assert!(from_center(&before) > squared && (&closest - &before) * &inward > q(0.0), "{sphere:?}");
                let past_the_middle = (&closest - &after) * &inward <= q(0.0);
                assert!(past_the_middle || from_center(&after) < squared, "{sphere:?} from {origin:?}");
            }
        }
    }
    assert!(n_hits > 500, "{n_hits}");
}

/// Segments near a box; some boxes are flat.
fn segment_and_box(rng: &mut Rng) -> ([f32; 3], [f32; 3], Aabb) {
    let setting = SETTINGS[rng.below(4)];
    let triangle = rng.triangle(setting.around, setting.size);
    let aabb = Aabb::from_points(triangle);
    let near = |rng: &mut Rng| {
        let (offset, corner) = (rng.vector(2.0 * setting.size), aabb.corners()[rng.below(8)]);
        let on_grid = rng.below(3) == 0;
        std::array::from_fn(|k| if on_grid && offset[k] > 0.0 { corner[k] } else { setting.around[k] + offset[k] })
    };
    let p0: [f32; 3] = near(rng);
    let mut p1: [f32; 3] = near(rng);
    if rng.below(3) == 0 {
        let axis = rng.below(3);
        p1 = std::array::from_fn(|k| if k == axis { p1[k] } else { p0[k] });
    }
    (p0, p1, aabb)
}

/// Clips the segment against the six planes, in rationals.
fn overlaps_exactly(p0: [f32; 3], p1: [f32; 3], aabb: &Aabb, widened: &Q) -> bool {
    let (mut near, mut far) = (q(0.0), q(1.0));
    for k in 0..3 {
        let slope = q(p1[k]) - q(p0[k]);
        let (below, above) = (q(aabb.min[k]) - widened - q(p0[k]), q(aabb.max[k]) + widened - q(p0[k]));
        if slope.is_zero() {
            if below.is_positive() || above.is_negative() {
                return false;
            }
            continue;
        }
        let (a, b) = (below / &slope, above / &slope);
        let (enter, leave) = if slope.is_positive() { (a, b) } else { (b, a) };
        near = near.max(enter);
        far = far.min(leave);
    }
    near <= far
}

/// Results of `test` that differ from exact clipping: missed overlaps, false overlaps.
fn wrong_overlaps(n: u32, test: impl Fn([f32; 3], [f32; 3], &Aabb) -> bool) -> (u32, u32) {
    let mut rng = Rng(41);
    let (mut denied, mut closed) = (0, 0);
    for _ in 0..n {
        let (p0, p1, aabb) = segment_and_box(&mut rng);
        let found = test(p0, p1, &aabb);
        denied += u32::from(!found && overlaps_exactly(p0, p1, &aabb, &q(0.0)));
        // The gap that f64 may close, for the flattest angle between segment and face.
        let coordinates = p0.into_iter().chain(p1).chain(aabb.min).chain(aabb.max).map(|x| q(x.abs()));
        let widened = q(f64::from(UNIT_ROUNDOFF) * IN_F64.sqrt()) * coordinates.max().expect("twelve");
        closed += u32::from(found && !overlaps_exactly(p0, p1, &aabb, &widened));
    }
    (denied, closed)
}

#[test]
fn segment_overlaps_agree_with_exact_clipping() {
    assert_eq!(wrong_overlaps(100_000, segment_overlaps_aabb), (0, 0));
    assert!(!segment_overlaps_aabb([0.0; 3], [1.0; 3], &Aabb::EMPTY));
    let flat = Aabb { min: [-1.0, -1.0, 0.0], max: [1.0, 1.0, 0.0] };
    assert!(segment_overlaps_aabb([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], &flat));
    assert!(segment_overlaps_aabb([1.0, 2.0, 0.0], [1.0, -2.0, 0.0], &flat));
    assert!(!segment_overlaps_aabb([0.0, 0.0, 1e-12], [0.0, 0.0, 1.0], &flat));
}

#[test]
fn ignoring_the_center_of_the_box_is_detected() {
    let without_centre = |p0, p1, aabb: &Aabb| {
        let half: [f32; 3] = std::array::from_fn(|k| 0.5 * (aabb.max[k] - aabb.min[k]));
        segment_overlaps_aabb(p0, p1, &Aabb { min: half.map(|h| -h), max: half })
    };
    let (denied, closed) = wrong_overlaps(1000, without_centre);
    assert!(denied > 50 && closed > 0, "{denied} denied, {closed} closed");
}

/// A segment of one ulp at a distance of some ulps from a flat box: its slack is relative to its length, too.
#[test]
fn short_segments_do_not_overlap_boxes_that_they_miss() {
    let ulp = f32::EPSILON;
    let flat = Aabb { min: [1.0, 1.0, 0.0], max: [1.0, 1.0, 2.0] };
    // It passes the edge at (1, 1) diagonally, at a distance of less than one ulp.
    let [p0, p1] = [[1.0, 1.0 + ulp, 1.0], [1.0 + ulp, 1.0, 1.0]];
    assert!(!segment_overlaps_aabb(p0, p1, &flat));
    assert!(segment_overlaps_aabb([1.0, 1.0, 1.0], p1, &flat));
}
