use canted_obb::vector::{cross, dot, reach, sub, to_f64};
use canted_trace::{
    BaldwinWeber, HIT_ERROR, Kernel, MollerTrumbore, Projected, Ray, ScaledRay, Side, TriangleHit, Watertight,
    lanes::UNIT_ROUNDOFF,
};
use num_traits::{Signed, Zero};

use crate::inputs::{self, Q, Rng, SETTINGS, Triangle, any_bits, q, q3, ray_at};

pub(crate) fn hit<K: Kernel>(ray: &ScaledRay, triangle: &Triangle) -> Option<TriangleHit> {
    K::intersect(&K::prepare(ray), ray, &K::record(*triangle), ray.t_max)
}

/// Whether every coordinate of the point at `t` is within `bound` of the triangle, in rationals.
///
/// Candidates for the nearest point are the exact coordinates of the hit on the plane, or those of the kernel, clamped to
/// the triangle; any candidate within the bound is a proof.
fn lies_near(ray: &ScaledRay, triangle: &Triangle, hit: &TriangleHit, bound: &Q) -> bool {
    let (det, u, v, _) = inputs::triangle(ray, triangle);
    let on_ray = inputs::at(ray, &q(hit.t));
    let mut guesses = vec![(q(hit.u), q(hit.v))];
    if !det.is_zero() {
        guesses.push((u / &det, v / &det));
    }
    guesses.into_iter().any(|(u, v)| {
        let one = q(1.0);
        let (u, v) = (u.max(Q::zero()), v.max(Q::zero()));
        let sum = (&u + &v).max(one.clone());
        let (u, v) = (u / &sum, v / &sum);
        let [v0, v1, v2] = triangle.map(q3);
        (0..3).all(|k| {
            let place = (&one - &u - &v) * &v0[k] + &u * &v1[k] + &v * &v2[k];
            (place - &on_ray[k]).abs() <= *bound
        })
    })
}

/// `n_roundings` of `|o|∞ + ρ∞`, plus underflow.
fn hit_bound(ray: &ScaledRay, triangle: &Triangle, n_roundings: f32) -> Q {
    let vertices = triangle.iter().map(|&v| inputs::reach(&q3(v))).max().expect("three vertices");
    let relative = q(n_roundings) * q(UNIT_ROUNDOFF);
    relative * (inputs::reach(&q3(ray.origin)) + vertices) + q(f32::MIN_POSITIVE) / q(2.0)
}

fn points_lie_near<K: Kernel>(name: &str, n_roundings: f32) {
    assert!(n_roundings * UNIT_ROUNDOFF <= HIT_ERROR);
    let mut rng = Rng(10);
    let mut check = |case: &dyn Fn(&mut Rng) -> (Triangle, ScaledRay), reach: f32| {
        let mut n_hits = 0;
        for _ in 0..400 {
            let (triangle, ray) = case(&mut rng);
            let Some(found) = hit::<K>(&ray, &triangle) else { continue };
            n_hits += 1;
            let bound = hit_bound(&ray, &triangle, n_roundings);
            assert!(lies_near(&ray, &triangle, &found, &bound), "{name} {found:?}\n{ray:?}\n{triangle:?}");
            let moved = TriangleHit { t: found.t + reach, ..found };
            assert!(!lies_near(&ray, &triangle, &moved, &bound), "the oracle sees nothing");
        }
        assert!(n_hits > 20, "the case is void: {n_hits} hits of {name}");
    };
    for setting in SETTINGS {
        check(&|rng| inputs::case(rng, &setting), 4.0 * setting.distance);
    }
    check(&any_bits, 1e20);
}

#[test]
fn hits_are_within_the_bound_of_the_exact_triangle() {
    // The proven 6.1, and the rounding of two barycentric coordinates in the check, each up to 1 of `2·ρ∞`.
    points_lie_near::<Watertight>("watertight", 10.1);
    points_lie_near::<MollerTrumbore>("moller-trumbore", 20.0);
    points_lie_near::<BaldwinWeber>("baldwin-weber", 20.0);
    points_lie_near::<Projected>("projected", 20.0);
}

/// `(t, barycentric coordinates, their error in f32)` of a well-posed case, in f64.
fn solve(ray: &ScaledRay, triangle: &Triangle) -> Option<(f64, [f64; 3], f64)> {
    let [v0, v1, v2] = triangle.map(to_f64);
    let (o, d) = (to_f64(ray.origin), to_f64(ray.direction));
    let (e1, e2) = (sub(v1, v0), sub(v2, v0));
    let normal = cross(e1, e2);
    let slope = dot(normal, d);
    let t = dot(normal, sub(v0, o)) / slope;
    let point: [f64; 3] = std::array::from_fn(|k| o[k] + t * d[k] - v0[k]);
    let area = dot(normal, normal);
    let (u, v) = (dot(cross(point, e2), normal) / area, dot(cross(e1, point), normal) / area);
    // Every f32 kernel commits a few roundings of the coordinates and of the distance; divided by the least
    // height of the triangle over the angle, they bound the error of a coordinate. 40 roundings cover the longest chain, Baldwin
    // and Weber's map: 3 for each entry and the height, 4 for the distance, 4 for the weight, over three axes.
    let edge = reach(e1).max(reach(e2)).max(reach(sub(v2, v1)));
    let height = area.sqrt() / edge;
    let sine = slope.abs() / (area.sqrt() * dot(d, d).sqrt());
    let span = reach(o) + reach(v0) + reach(v1) + reach(v2);
    let error = 40.0 * f64::from(UNIT_ROUNDOFF) * span / (height * sine) * (edge / height);
    (error < 0.1).then_some((t, [1.0 - u - v, u, v], error))
}

/// Compares with f64 wherever that decides; counts those rays.
fn agrees_with_f64<K: Kernel>(name: &str) -> (u32, u32) {
    let mut rng = Rng(11);
    let (mut hits, mut misses) = (0, 0);
    for i in 0..150_000 {
        let setting = SETTINGS[[0, 0, 1, 3, 4][i % 5]];
        let triangle = rng.triangle(setting.around, setting.size);
        let at = if i % 2 == 0 { triangle } else { rng.triangle(setting.around, setting.size) };
        let ray = ray_at(&mut rng, &at, setting.distance);
        let Some((t, weights, error)) = solve(&ray, &triangle) else { continue };
        let least = weights.into_iter().fold(f64::INFINITY, f64::min);
        let found = hit::<K>(&ray, &triangle);
        let span = reach(to_f64(ray.origin)) + triangle.iter().map(|&v| reach(to_f64(v))).fold(0.0, f64::max);
        if least > error && t > error * span {
            let found = found.unwrap_or_else(|| panic!("{name} misses {ray:?} {triangle:?}"));
            let off = [f64::from(found.u) - weights[1], f64::from(found.v) - weights[2]];
            assert!(off.iter().all(|x| x.abs() <= error), "{name} {found:?} for {weights:?}");
            assert!((f64::from(found.t) - t).abs() <= error * span, "{name} {found:?} for {t}");
            hits += 1;
        } else if least < -error || t < -error * span {
            assert_eq!(found, None, "{name} {ray:?} {triangle:?}");
            misses += 1;
        }
    }
    (hits, misses)
}

#[test]
fn kernels_agree_with_f64() {
    for (hits, misses) in [
        agrees_with_f64::<Watertight>("watertight"),
        agrees_with_f64::<MollerTrumbore>("moller-trumbore"),
        agrees_with_f64::<BaldwinWeber>("baldwin-weber"),
        agrees_with_f64::<Projected>("projected"),
    ] {
        assert!(hits > 10_000 && misses > 10_000, "{hits} hits, {misses} misses");
    }
}

#[test]
fn filtered_kernels_share_their_bits() {
    let mut rng = Rng(12);
    let mut n_hits = 0;
    for i in 0..100_000 {
        let (triangle, ray) = inputs::case(&mut rng, &SETTINGS[i % SETTINGS.len()]);
        let found = [
            hit::<MollerTrumbore>(&ray, &triangle),
            hit::<BaldwinWeber>(&ray, &triangle),
            hit::<Projected>(&ray, &triangle),
        ];
        assert_eq!(found.map(|hit| hit.map(bits)), [found[0].map(bits); 3], "{ray:?} {triangle:?}");
        n_hits += u32::from(found[0].is_some());
    }
    assert!(n_hits > 20_000, "{n_hits}");
}

pub(crate) fn bits(hit: TriangleHit) -> ([u32; 3], Side) {
    ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.side)
}

fn one_hit<K: Kernel>() {
    let triangle = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let ray = |origin, direction| ScaledRay::new(&Ray::new(origin, direction)).unwrap();
    // Counter-clockwise from above: seen from there, the front. u belongs to the second vertex.
    let above = hit::<K>(&ray([2.0, 1.0, 3.0], [0.0, 0.0, -1.0]), &triangle).unwrap();
    assert_eq!(above, TriangleHit { t: 3.0, u: 0.5, v: 0.25, side: Side::Front });
    let below = hit::<K>(&ray([2.0, 1.0, -3.0], [0.0, 0.0, 1.0]), &triangle).unwrap();
    assert_eq!(below, TriangleHit { t: 3.0, u: 0.5, v: 0.25, side: Side::Back });
    // The other two axes as z, both signs.
    for shift in 1..3 {
        for sign in [1.0, -1.0] {
            let turn = |p: [f32; 3]| std::array::from_fn(|k| p[(k + shift) % 3]);
            let found = hit::<K>(&ray(turn([2.0, 1.0, 3.0 * sign]), turn([0.0, 0.0, -sign])), &triangle.map(turn));
            let side = if sign > 0.0 { Side::Front } else { Side::Back };
            assert_eq!(found, Some(TriangleHit { t: 3.0, u: 0.5, v: 0.25, side }));
        }
    }
    // The interval is closed at both ends.
    let within = |t_min, t_max| {
        let ray = Ray::new([1.0, 1.0, 2.0], [0.0, 0.0, -1.0]).between(t_min, t_max);
        hit::<K>(&ScaledRay::new(&ray).unwrap(), &triangle).is_some()
    };
    assert!(within(0.0, 2.0) && within(2.0, 2.0) && within(2.0, f32::INFINITY));
    assert!(!within(0.0, 2.0f32.next_down()) && !within(2.0f32.next_up(), 3.0));
    // In the plane, and degenerate.
    assert_eq!(hit::<K>(&ray([-1.0, 1.0, 0.0], [1.0, 0.0, 0.0]), &triangle), None);
    assert_eq!(hit::<K>(&ray([1.0, 0.0, 1.0], [0.0, 0.0, -1.0]), &[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), None);
    assert_eq!(hit::<K>(&ray([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]), &[[0.0; 3]; 3]), None);
}

#[test]
fn barycentric_coordinates_sides_and_interval_ends() {
    one_hit::<Watertight>();
    one_hit::<MollerTrumbore>();
    one_hit::<BaldwinWeber>();
    one_hit::<Projected>();
}

/// Three different points of a line, exactly: multiples of a step that is an integer times a power of two.
fn on_a_line(rng: &mut Rng) -> Triangle {
    let scale = 2.0_f32.powi(i32::try_from(rng.below(40)).unwrap() - 20);
    let mut small = || (rng.below(2001) as f32 - 1000.0) * scale;
    let (start, step) = ([0; 3].map(|_| small()), [0; 3].map(|_| small()));
    let mut places = [0.0, 3.0, 7.0];
    places.rotate_left(rng.below(3));
    places.map(|n| std::array::from_fn(|k| start[k] + n * step[k]))
}

/// Rays aimed at points of triangles without area, from everywhere, along and across them.
#[test]
fn triangles_without_area_are_never_hit() {
    let mut rng = Rng(91);
    let mut n_as_given = 0;
    for _ in 0..5_000 {
        let triangle = on_a_line(&mut rng);
        let size = triangle.iter().map(|&v| reach(to_f64(v))).fold(0.0, f64::max) as f32;
        let [a, b, c] = rng.weights();
        let target: [f32; 3] = std::array::from_fn(|k| a * triangle[0][k] + b * triangle[1][k] + c * triangle[2][k]);
        let distance = [0.01, 1.0, 100.0][rng.below(3)] * size;
        let away = rng.vector(distance);
        let origin: [f32; 3] = std::array::from_fn(|k| target[k] + away[k]);
        let direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
        let Some(ray) = ScaledRay::new(&Ray::new(origin, direction)) else { continue };
        // The test of the three vertices as they are, which roundings move off their line.
        let given = Watertight::intersect(&Watertight::prepare(&ray), &ray, &triangle, ray.t_max);
        n_as_given += usize::from(given.is_some());
        let found = [
            hit::<Watertight>(&ray, &triangle),
            hit::<MollerTrumbore>(&ray, &triangle),
            hit::<BaldwinWeber>(&ray, &triangle),
            hit::<Projected>(&ray, &triangle),
        ];
        assert_eq!(found, [None; 4], "{triangle:?} {ray:?}");
    }
    assert!(n_as_given > 100, "the test is void: {n_as_given}");
}

/// Rays at edges and vertices: weights lie in [0, 1], and sum to at most 1 + 2^-21.
#[test]
fn weights_are_from_zero_to_one() {
    let triangle = [[0.1_f32, 0.2, 0.3], [1.7, -0.4, 0.9], [-0.6, 1.1, 2.3]];
    let mut n_hits = 0;
    for vertex in triangle {
        for i in 0..20_000_u16 {
            // Within some ulps of the vertex.
            let moved: [f32; 3] = std::array::from_fn(|k| {
                let steps = ((u32::from(i) * 7919) >> (3 * k)) % 9;
                vertex[k] + (f32::from(u8::try_from(steps).unwrap()) - 4.0) * f32::EPSILON * vertex[k]
            });
            let origin = [3.0_f32, 2.0, -5.0];
            let ray = Ray::new(origin, std::array::from_fn::<f32, 3, _>(|k| moved[k] - origin[k]));
            let ray = ScaledRay::new(&ray).unwrap();
            let found = [
                MollerTrumbore::intersect(&(), &ray, &MollerTrumbore::record(triangle), ray.t_max),
                BaldwinWeber::intersect(&(), &ray, &BaldwinWeber::record(triangle), ray.t_max),
                Projected::intersect(&(), &ray, &Projected::record(triangle), ray.t_max),
                Watertight::intersect(&Watertight::prepare(&ray), &ray, &Watertight::record(triangle), ray.t_max),
            ];
            for hit in found.into_iter().flatten() {
                n_hits += 1;
                assert!((0.0..=1.0).contains(&hit.u) && (0.0..=1.0).contains(&hit.v), "{hit:?}");
                assert!(f64::from(hit.u) + f64::from(hit.v) <= 1.0 + 2.0_f64.powi(-21), "{hit:?}");
            }
        }
    }
    assert!(n_hits > 10_000, "{n_hits}");
}

/// Ends of intervals are those of the caller's ray, also where the scaled ones underflow or overflow.
#[test]
fn intervals_are_rounded_inward() {
    let with = |length: f32, t_min: f32, t_max: f32| {
        ScaledRay::new(&Ray { t_min, t_max, ..Ray::new([0.0; 3], [length, 0.0, 0.0]) })
    };
    let least = f32::from_bits(1);
    // 2^-149 of a short direction is less than any f32, but not zero.
    let ray = with(2.0_f32.powi(-10), least, f32::INFINITY).unwrap();
    assert_eq!(ray.t_min, least);
    assert_eq!(with(2.0_f32.powi(-10), 0.0, least).unwrap().t_max, 0.0);
    assert_eq!(with(2.0_f32.powi(-10), least, least), None);
    assert_eq!(with(2.0_f32.powi(100), 0.0, f32::MAX).unwrap().t_max, f32::MAX);
    // An infinite interval ends at the greatest finite `t`, and one that begins beyond it is empty.
    assert_eq!(with(2.0_f32.powi(100), 0.0, f32::INFINITY).unwrap().t_max, f32::MAX);
    for length in [2.0_f32.powi(-10), 1.5, 2.0_f32.powi(100)] {
        assert_eq!(with(length, f32::INFINITY, f32::INFINITY), None);
    }
    assert_eq!(with(1.5, 0.5, 2.0).unwrap().t_min, 0.5);
}
