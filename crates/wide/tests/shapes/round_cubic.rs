//! Round cubic curves against the balls of which they are the union, one by one.

use canted_fixtures::SplitMix64;
use canted_trace::{Intersect as _, Ray, RoundCubic, ScaledRay};
use canted_wide::{Config, Primitive as _, WideBvh};

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

/// Spans of a line within the balls at `n` parameters, joined where they overlap, in order.
fn spans(curve: &RoundCubic, ray: &Ray, n: u32) -> Vec<[f64; 2]> {
    let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
    let mut all: Vec<[f64; 2]> = (0..=n)
        .filter_map(|i| {
            let ([x, y, z, radius], _) = curve.ball(f64::from(i) / f64::from(n));
            let to_center = [x - o[0], y - o[1], z - o[2]];
            let closest = dot(to_center, d) / dot(d, d);
            let off: Vector = std::array::from_fn(|k| to_center[k] - closest * d[k]);
            let square = (radius * radius - dot(off, off)) / dot(d, d);
            (square >= 0.0).then(|| [closest - square.sqrt(), closest + square.sqrt()])
        })
        .collect();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut joined: Vec<[f64; 2]> = Vec::new();
    for span in all {
        match joined.last_mut() {
            Some(last) if span[0] <= last[1] => last[1] = last[1].max(span[1]),
            _ => joined.push(span),
        }
    }
    joined
}

/// Curves of many kinds: gentle, looped, with a cusp, of one point, straight, with radii from 0 and up to more than the curvature.
fn curves(rng: &mut SplitMix64) -> Vec<RoundCubic> {
    let mut curves = Vec::new();
    for radii in [[0.05; 4], [0.3, 0.1, 0.02, 0.0], [0.0, 0.0, 0.0, 0.4], [1.0, 0.2, 0.2, 0.7], [0.01; 4]] {
        for kind in 0..7 {
            let mut points: [[f32; 3]; 4] = std::array::from_fn(|_| rng.signed3().map(|x| 2.0 * x as f32));
            match kind {
                0 => points = std::array::from_fn(|i| [i as f32, 0.1 * (i * i) as f32, 0.0]),
                1 => points = [[0.0; 3], [3.0, 2.0, 0.0], [-1.0, 2.0, 0.1], [2.0, 0.0, 0.0]],
                2 => points = [[0.0; 3], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0], [2.0, 0.0, 0.0]],
                3 => points = [points[0]; 4],
                4 => points = std::array::from_fn(|i| [i as f32, 0.0, 0.0]),
                _ => {}
            }
            curves.push(RoundCubic { points, radii });
        }
    }
    curves
}

/// A ray at a ball of the curve or beside it, from afar or from within.
fn ray_at(curve: &RoundCubic, rng: &mut SplitMix64, i: usize) -> Ray {
    let ([x, y, z, radius], slope) = curve.ball(rng.unit());
    let reach = radius * [0.0, 0.7, 0.99, 1.3][i % 4];
    let (off, mut from) = (rng.on_sphere(), rng.on_sphere());
    if i.is_multiple_of(5) && slope[..3].iter().any(|x| x.abs() > 1e-3) {
        from = [slope[0], slope[1], slope[2]];
    }
    let target: Vector = std::array::from_fn(|k| [x, y, z][k] + reach * off[k]);
    let far = [4.0, 0.0, 0.5][i / 4 % 3];
    let origin: [f32; 3] = std::array::from_fn(|k| (target[k] + far * from[k]) as f32);
    Ray::new(origin, from.map(|x| -x as f32))
}

#[test]
fn rays_enter_and_leave_the_union_of_the_balls() {
    let mut rng = SplitMix64::new(7);
    let (mut n, mut n_hits, mut n_inside) = (0, 0, 0);
    for curve in curves(&mut rng) {
        for i in 0..24 {
            let ray = ray_at(&curve, &mut rng, i);
            let scaled = ScaledRay::new(&ray).expect("a valid ray");
            let found = curve.event_scaled(&scaled, f32::INFINITY);
            let spans = spans(&curve, &ray, 2000);
            let ends = spans.as_flattened().iter().copied();
            let want = ends.enumerate().find(|&(_, t)| t >= 0.0);
            n += 1;
            let found = found.map(|point| (f64::from(point.t) / scaled.scale(), point));
            let Some((t, point)) = found else {
                // Balls that are barely reached may be missed; the line is never deep in one.
                let depth = want.map_or(0.0, |(index, t)| (t - spans[index / 2][0]).max(spans[index / 2][1] - t));
                assert!(depth < 2e-2, "{curve:?} {ray:?}: missed {spans:?}");
                continue;
            };
            n_hits += 1;
            n_inside += usize::from(!point.is_entry);
            // The point lies on the ball at its parameter, and in the interior of none.
            let at: Vector = std::array::from_fn(|k| f64::from(ray.origin[k]) + t * f64::from(ray.direction[k]));
            let distance = |u: f64| {
                let ([x, y, z, radius], _) = curve.ball(u);
                let off = [at[0] - x, at[1] - y, at[2] - z];
                dot(off, off).sqrt() - radius
            };
            let least = (0..=2000).map(|i| distance(f64::from(i) / 2000.0)).fold(f64::INFINITY, f64::min);
            let tolerance = 1e-5;
            assert!(distance(point.u.into()).abs() < tolerance, "{curve:?} {ray:?} {point:?}");
            assert!(least > -tolerance, "{curve:?} {ray:?} {point:?}: {least:e}");
        }
    }
    assert!(n_hits > n / 2 && n_inside > 20, "{n_hits} of {n}, {n_inside} from inside");
}

/// A later start hides events but does not change those after it, nor does an earlier end; entries and exits take turns.
#[test]
fn events_do_not_depend_on_the_interval() {
    let mut rng = SplitMix64::new(17);
    let (mut n, mut n_later) = (0, 0);
    for curve in curves(&mut rng) {
        for i in 0..120 {
            let ray = ray_at(&curve, &mut rng, i);
            let mut scaled = ScaledRay::new(&ray).expect("a valid ray");
            let mut was_entry = None;
            while let Some(event) = curve.event_scaled(&scaled, f32::INFINITY) {
                n += 1;
                assert!(was_entry != Some(event.is_entry), "{curve:?} {ray:?} {event:?}");
                n_later += usize::from(was_entry.is_some());
                was_entry = Some(event.is_entry);
                assert_eq!(curve.event_scaled(&scaled, event.t), Some(event), "{curve:?} {ray:?}");
                if event.t > scaled.t_min {
                    assert_eq!(curve.event_scaled(&scaled, event.t.next_down()), None, "{curve:?} {ray:?} {event:?}");
                    let mut later = scaled;
                    later.t_min = event.t;
                    assert_eq!(curve.event_scaled(&later, f32::INFINITY), Some(event), "{curve:?} {ray:?}");
                }
                scaled.t_min = event.t.next_up();
            }
        }
    }
    assert!(n > 3000 && n_later > 1000, "{n} events, {n_later} later ones");
}

#[test]
fn a_straight_curve_is_a_round_segment() {
    let curve = RoundCubic { points: std::array::from_fn(|i| [i as f32, 0.0, 0.0]), radii: [0.5; 4] };
    let ray = Ray::new([0.75, 0.0, 4.0], [0.0, 0.0, -2.0]);
    let hit = curve.event_scaled(&ScaledRay::new(&ray).unwrap(), f32::INFINITY).unwrap();
    assert_eq!((hit.u, hit.is_entry), (0.25, true));
    assert!((hit.t / ScaledRay::new(&ray).unwrap().scale() as f32 - 1.75).abs() < 1e-6);
}

/// Bounds along any direction contain the balls, and touch them where the curve is straight.
#[test]
fn bounds_contain_the_balls() {
    let mut rng = SplitMix64::new(11);
    for curve in curves(&mut rng) {
        for _ in 0..20 {
            let direction = rng.on_sphere().map(|x| x as f32);
            let [lo, hi] = curve.extent_along(direction);
            for i in 0..=200 {
                let ([x, y, z, radius], _) = curve.ball(f64::from(i) / 200.0);
                let d = direction.map(f64::from);
                let (at, reach) = (dot(d, [x, y, z]), radius * dot(d, d).sqrt());
                assert!(f64::from(lo) <= at - reach && at + reach <= f64::from(hi), "{curve:?} {direction:?}");
            }
        }
    }
    let straight = RoundCubic { points: std::array::from_fn(|i| [i as f32, 0.0, 0.0]), radii: [0.5; 4] };
    let [lo, hi] = straight.extent_along([1.0, 0.0, 0.0]);
    assert!((lo + 0.5).abs() < 1e-6 && (hi - 3.5).abs() < 1e-6);
}

/// The loop over all curves gives the same bits: of usual size, far away, and tiny.
#[test]
fn hits_do_not_depend_on_the_bvh() {
    let mut rng = SplitMix64::new(13);
    let all: Vec<RoundCubic> = (0..6).flat_map(|_| curves(&mut rng)).collect();
    let rays: Vec<Ray> = (0..300).map(|i| ray_at(&all[i % all.len()], &mut rng, i)).collect();
    for (scale, shift) in [(1.0, 0.0), (1024.0, 1e7), (1e-6, 0.0)] {
        let point = |p: [f32; 3]| p.map(|x| scale * x + shift);
        let moved =
            |curve: &RoundCubic| RoundCubic { points: curve.points.map(point), radii: curve.radii.map(|r| scale * r) };
        let rays: Vec<Ray> = rays.iter().map(|ray| Ray::new(point(ray.origin), ray.direction)).collect();
        is_complete(&all.iter().map(moved).collect::<Vec<_>>(), &rays);
    }
}

fn is_complete(all: &[RoundCubic], rays: &[Ray]) {
    let mut n_hits = 0;
    for config in [Config::default(), Config::default().axis_aligned()] {
        let bvh = WideBvh::over_with(all.to_vec(), config).unwrap();
        for ray in rays {
            let scaled = ScaledRay::new(ray).unwrap();
            let alone =
                all.iter().enumerate().filter_map(|(i, curve)| Some((curve.event_scaled(&scaled, f32::INFINITY)?, i)));
            let want = alone.min_by(|a, b| a.0.t.total_cmp(&b.0.t).then(a.1.cmp(&b.1)));
            let want = want.map(|(point, i)| (scaled.caller_t(point.t).to_bits(), point.u.to_bits(), i as u32));
            let hit = bvh.closest_hit(ray).map(|hit| (hit.t.to_bits(), hit.u.to_bits(), hit.primitive.0));
            n_hits += usize::from(want.is_some());
            assert_eq!(hit, want, "{ray:?}");
        }
    }
    assert!(n_hits > 100, "{n_hits}");
}
