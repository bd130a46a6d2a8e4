use canted_trace::{
    BaldwinWeber, Kernel, Projected, ScaledRay,
    lanes::{Weights, baldwin_weber_weights, finish, moller_trumbore_weights, projected_weights},
};
use num_traits::{Signed, Zero};

use crate::inputs::{self, Q, Rng, SETTINGS, Setting, TWO_POW_60, Triangle, any_bits, q, q3};

type Filter = fn(&ScaledRay, &Triangle) -> Weights;

const FILTERS: [(&str, Filter); 3] = [
    ("moller-trumbore", moller_trumbore_weights),
    ("baldwin-weber", |ray, triangle| baldwin_weber_weights(ray, &BaldwinWeber::record(*triangle))),
    ("projected", |ray, triangle| projected_weights(ray, &Projected::record(*triangle))),
];

/// Triangles up to 10^4 edges from the coordinate origin, with ray origins near, equally far, or farther.
const FAR: [Setting; 6] = [
    Setting { around: [250.0, -120.0, 90.0], size: 0.05, distance: 0.1 },
    Setting { around: [250.0, -120.0, 90.0], size: 0.05, distance: 300.0 },
    Setting { around: [250.0, -120.0, 90.0], size: 0.05, distance: 5e4 },
    Setting { around: [3.0, 1.0, 1e4], size: 1.0, distance: 1e4 },
    Setting { around: [3.0 * TWO_POW_60, 0.0, TWO_POW_60], size: TWO_POW_60 / 1e3, distance: 3.0 * TWO_POW_60 },
    Setting { around: [3.0 / TWO_POW_60, 0.0, 1.0 / TWO_POW_60], size: 1e-3 / TWO_POW_60, distance: 9.0 / TWO_POW_60 },
];

/// Cases of every setting, and with arbitrary bits.
fn cases(seed: u64, n_each: usize) -> impl Iterator<Item = (Triangle, ScaledRay)> {
    let mut rng = Rng(seed);
    let settings: Vec<_> = SETTINGS.into_iter().chain(FAR).map(Some).chain([None]).collect();
    (0..n_each * settings.len()).map(move |i| match &settings[i % settings.len()] {
        Some(setting) => inputs::case(&mut rng, setting),
        None => any_bits(&mut rng),
    })
}

/// Whether the line intersects the closed triangle, in rationals.
fn pierces(ray: &ScaledRay, triangle: &Triangle) -> bool {
    let (det, u, v, _) = inputs::triangle(ray, triangle);
    !det.is_zero() && !u.is_negative() && !v.is_negative() && u + v <= det
}

#[test]
fn filters_reject_no_line_that_hits_the_triangle() {
    let mut n_pierced = 0;
    for (triangle, ray) in cases(40, 1500).filter(|(triangle, ray)| pierces(ray, triangle)) {
        n_pierced += 1;
        for (name, filter) in FILTERS {
            let weights = filter(&ray, &triangle);
            assert!(!weights.misses(), "{name} {weights:?}\n{ray:?}\n{triangle:?}");
        }
    }
    assert!(n_pierced > 5_000, "{n_pierced}");
}

/// How many hits of `finish` each filter rejects if its error is multiplied by `factor`.
fn rejected(factor: f32) -> ([u32; 3], u32) {
    let (mut lost, mut n_hits) = ([0; 3], 0);
    for (triangle, ray) in cases(41, 20_000).filter(|(triangle, ray)| finish(ray, triangle, ray.t_max).is_some()) {
        n_hits += 1;
        for (lost, (_, filter)) in lost.iter_mut().zip(FILTERS) {
            let weights = filter(&ray, &triangle);
            *lost += u32::from(Weights { error: factor * weights.error, ..weights }.misses());
        }
    }
    (lost, n_hits)
}

#[test]
fn filters_reject_nothing_that_finish_accepts() {
    let (lost, n_hits) = rejected(1.0);
    assert!(n_hits > 50_000, "{n_hits}");
    assert_eq!(lost, [0; 3]);
}

#[test]
fn filters_without_their_error_reject_hits() {
    let (lost, _) = rejected(0.0);
    assert!(lost.iter().all(|&n| n > 100), "{lost:?}");
}

/// `det`, `u·det`, `v·det` in rationals, by Möller and Trumbore's formulas.
fn exact_weights(ray: &ScaledRay, triangle: &Triangle) -> [Q; 3] {
    let [v0, v1, v2] = triangle.map(q3);
    let (e1, e2, s) = (inputs::sub(&v1, &v0), inputs::sub(&v2, &v0), inputs::sub(&q3(ray.origin), &v0));
    let d = q3(ray.direction);
    let p = inputs::cross(&d, &e2);
    [inputs::dot(&p, &e1), inputs::dot(&p, &s), inputs::dot(&inputs::cross(&s, &e1), &d)]
}

/// The greatest component of the normal, negated: the factor between the maps of Baldwin and Weber and the above.
fn scale(triangle: &Triangle) -> Q {
    let [v0, v1, v2] = triangle.map(q3);
    let normal = inputs::cross(&inputs::sub(&v1, &v0), &inputs::sub(&v2, &v0));
    -normal.into_iter().reduce(|a, b| if b.abs() > a.abs() { b } else { a }).expect("three components")
}

#[test]
fn weights_lie_within_their_error() {
    let mut n_checked = [0; 3];
    for (triangle, ray) in cases(42, 500) {
        let exact = exact_weights(&ray, &triangle);
        // Minus the determinant of Möller and Trumbore is that of the projection.
        let scales = [q(1.0), scale(&triangle), q(-1.0)];
        for (((name, filter), scale), n) in FILTERS.into_iter().zip(scales).zip(&mut n_checked) {
            let weights = filter(&ray, &triangle);
            if !weights.error.is_finite() {
                continue;
            }
            *n += 1;
            for (found, exact) in [weights.det, weights.u, weights.v].into_iter().zip(&exact) {
                let off = (q(found) - exact / &scale).abs();
                assert!(off <= q(weights.error), "{name} {weights:?}\n{ray:?}\n{triangle:?}");
            }
        }
    }
    assert!(n_checked.iter().all(|&n| n > 5_000), "{n_checked:?}");
}

#[test]
fn filters_reject_most_misses() {
    // Most rays towards other triangles within 20 edges are rejected by the filter.
    let mut rng = Rng(43);
    let mut n_passed = [0; 3];
    let n_rays = 10_000;
    for _ in 0..n_rays {
        let around = rng.vector(300.0);
        let triangle: Triangle = std::array::from_fn(|_| {
            let corner = rng.vector(0.05);
            std::array::from_fn(|k| around[k] + corner[k])
        });
        let beside = [around[0] + 0.5, around[1] - 0.4, around[2] + 0.5];
        let near = Setting { around: beside, size: 0.05, distance: 10.0 };
        let (_, ray) = inputs::case(&mut rng, &near);
        for (n, (_, filter)) in n_passed.iter_mut().zip(FILTERS) {
            *n += u32::from(!filter(&ray, &triangle).misses());
        }
    }
    assert!(n_passed.iter().all(|&n| n * 10 < n_rays), "{n_passed:?} of {n_rays}");
}
