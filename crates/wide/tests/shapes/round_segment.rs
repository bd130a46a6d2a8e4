//! Round segments against the balls of which they are the union.

use canted_fixtures::SplitMix64;
use canted_trace::{Ray, RoundSegment, ScaledRay};

type Vector = [f64; 3];

/// Signed distance to the union of the balls at all positions, and the position of the nearest one: the least of a convex function,
/// by ternary search.
fn distance(segment: &RoundSegment, p: Vector) -> (f64, f64) {
    let [a, b] = segment.ends.map(|end| end.map(f64::from));
    let [r, q] = segment.radii.map(f64::from);
    let at = |s: f64| {
        let square: f64 = (0..3).map(|k| (p[k] - a[k] - s * (b[k] - a[k])).powi(2)).sum();
        square.sqrt() - r - s * (q - r)
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..90 {
        let (s, t) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(s) < at(t) { high = t } else { low = s }
    }
    [(at(0.0), 0.0), (at(low), low), (at(1.0), 1.0)].into_iter().min_by(|x, y| x.0.total_cmp(&y.0)).expect("three")
}

fn segments(rng: &mut SplitMix64) -> Vec<RoundSegment> {
    let mut segments = Vec::new();
    for length in [0.0, 1e-3, 1.0, 50.0] {
        for radii in [[1.0, 1.0], [0.5, 0.02], [0.0, 0.7], [1e-3, 1e-3], [1e-6, 1e-3], [2.0, 0.3], [0.0, 0.0]] {
            for along in [[1.0, 0.0, -0.0], rng.on_sphere(), rng.on_sphere()] {
                let a: [f32; 3] = rng.signed3().map(|x| 3.0 * x as f32);
                let b = std::array::from_fn(|k| a[k] + (length * along[k]) as f32);
                segments.push(RoundSegment { ends: [a, b], radii });
            }
        }
    }
    segments
}

/// Rays at a point of the axis plus some radii, from near and far, and rays along the axis.
fn ray_at(segment: &RoundSegment, rng: &mut SplitMix64, i: usize) -> Ray {
    let [a, b] = segment.ends;
    let s = [0.0, 1.0, rng.unit() as f32, 1.1][i % 4];
    let reach = segment.radii[0].max(segment.radii[1]) * [0.0, 0.5, 1.0, 1.2][i / 4 % 4];
    let off = rng.on_sphere();
    let target: [f32; 3] = std::array::from_fn(|k| a[k] + s * (b[k] - a[k]) + reach * off[k] as f32);
    let from = if i.is_multiple_of(7) { std::array::from_fn(|k| f64::from(a[k] - b[k])) } else { rng.on_sphere() };
    let far = [0.0, 0.3, 5.0, 1e3][i / 3 % 4];
    let origin: [f32; 3] = std::array::from_fn(|k| target[k] + (far * from[k]) as f32);
    let mut direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
    if direction.iter().all(|&x| x == 0.0) {
        direction = rng.on_sphere().map(|x| x as f32);
    }
    Ray::new(origin, direction)
}

/// Where the answer is wrong, if it is: ends of the span off the surface, a point outside of the balls between them, or a miss of a
/// line that passes through a ball. Distances are judged relative to the reach of ray and segment.
fn fault(segment: &RoundSegment, ray: &Ray, found: Option<[[f64; 2]; 2]>) -> Option<String> {
    let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
    let at = |t: f64| -> Vector { std::array::from_fn(|k| o[k] + t * d[k]) };
    let reach = (0..3)
        .map(|k| {
            (0..2)
                .map(|e| (f64::from(segment.ends[e][k]) - o[k]).abs() + f64::from(segment.radii[e]))
                .fold(0.0, f64::max)
        })
        .fold(0.0, f64::max);
    let tolerance = 4.0 * f64::from(f32::EPSILON) * reach;
    let Some([[entry, u], [exit, _]]) = found else {
        // The line is outside of every ball, as far as sampling shows.
        let [a, b] = segment.ends.map(|end| end.map(f64::from));
        let d2: f64 = d.iter().map(|x| x * x).sum();
        return (0..=64).find_map(|i| {
            let s = f64::from(i) / 64.0;
            let center: Vector = std::array::from_fn(|k| a[k] + s * (b[k] - a[k]));
            let t = (0..3).map(|k| (center[k] - o[k]) * d[k]).sum::<f64>() / d2;
            let (depth, _) = distance(segment, at(t));
            (depth < -tolerance).then(|| format!("missed, but {depth:e} inside at {t}"))
        });
    };
    if entry > exit {
        return Some(format!("enters at {entry} after it leaves at {exit}"));
    }
    for t in [entry, exit] {
        let (off, _) = distance(segment, at(t));
        if off.abs() > tolerance {
            return Some(format!("{off:e} off the surface at {t}, with a tolerance of {tolerance:e}"));
        }
    }
    for i in 0..=8 {
        let (off, _) = distance(segment, at(entry + f64::from(i) / 8.0 * (exit - entry)));
        if off > tolerance {
            return Some(format!("{off:e} outside between entry and exit"));
        }
    }
    // The position is that of a ball that touches the surface there.
    let [a, b] = segment.ends.map(|end| end.map(f64::from));
    let [r, q] = segment.radii.map(f64::from);
    let p = at(entry);
    let square: f64 = (0..3).map(|k| (p[k] - a[k] - u * (b[k] - a[k])).powi(2)).sum();
    let off = square.sqrt() - r - u * (q - r);
    (off.abs() > 2.0 * tolerance).then(|| format!("the ball at {u} is {off:e} away"))
}

fn found(segment: &RoundSegment, ray: &Ray) -> Option<[[f64; 2]; 2]> {
    let scaled = ScaledRay::new(ray)?;
    let points = segment.span_scaled(&scaled)?;
    Some(points.map(|point| [f64::from(point.t) / scaled.scale(), f64::from(point.u)]))
}

#[test]
fn lines_enter_and_leave_at_the_surface_of_the_balls() {
    let mut rng = SplitMix64::new(3);
    let (mut n, mut n_hits) = (0, 0);
    for segment in segments(&mut rng) {
        for i in 0..200 {
            let ray = ray_at(&segment, &mut rng, i);
            let found = found(&segment, &ray);
            n += 1;
            n_hits += usize::from(found.is_some());
            assert_eq!(fault(&segment, &ray, found), None, "{segment:?} {ray:?} {found:?}");
        }
    }
    assert!(n_hits > n / 4, "{n_hits} of {n}");
}

#[test]
fn the_check_finds_spans_of_other_segments() {
    let mut rng = SplitMix64::new(5);
    let segment = RoundSegment { ends: [[0.0; 3], [2.0, 1.0, 0.0]], radii: [0.5, 0.1] };
    let thicker = RoundSegment { radii: [0.5, 0.1001], ..segment };
    let n = 400;
    let n_faults = (0..n).filter(|&i| {
        let ray = ray_at(&segment, &mut rng, i);
        fault(&segment, &ray, found(&thicker, &ray)).is_some()
    });
    assert!(n_faults.count() > n / 10);
}
