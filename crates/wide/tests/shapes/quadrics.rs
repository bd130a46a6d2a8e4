//! Disks, cones and ellipsoids against samples of points.

use canted_fixtures::SplitMix64;
use canted_trace::{Cone, Disk, Ellipsoid, Ray, ScaledRay};

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn wide(v: [f32; 3]) -> Vector {
    v.map(f64::from)
}

fn sub(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Whether a point is deeper in the cone than `margin`, which may be negative.
fn in_cone(cone: &Cone, p: Vector, margin: f64) -> bool {
    let [a, b] = cone.ends.map(wide);
    let axis = sub(b, a);
    let length = dot(axis, axis).sqrt();
    let along = dot(sub(p, a), axis) / length;
    let off: Vector = std::array::from_fn(|k| p[k] - a[k] - along / length * axis[k]);
    let radius = f64::from(cone.radii[0]) + along / length * f64::from(cone.radii[1] - cone.radii[0]);
    along > margin && along < length - margin && dot(off, off).sqrt() < radius - margin
}

fn in_ellipsoid(ellipsoid: &Ellipsoid, p: Vector, margin: f64) -> bool {
    // The axes of these tests are orthogonal.
    let off = sub(p, wide(ellipsoid.center));
    let square: f64 =
        ellipsoid.axes.iter().map(|axis| (dot(off, wide(*axis)) / dot(wide(*axis), wide(*axis))).powi(2)).sum();
    let least = ellipsoid.axes.iter().map(|axis| dot(wide(*axis), wide(*axis)).sqrt()).fold(f64::INFINITY, f64::min);
    square.sqrt() < 1.0 - margin / least
}

fn cones(rng: &mut SplitMix64) -> Vec<Cone> {
    let mut cones = Vec::new();
    for radii in [[0.5, 0.5], [0.5, 0.1], [0.0, 0.7], [1.0, 0.0], [0.01, 0.01], [2.0, 1.0]] {
        for axis in [[1.0, 0.0, 0.0], rng.on_sphere(), rng.on_sphere()] {
            let from: [f32; 3] = rng.signed3().map(|x| x as f32);
            let length = 0.2 + 2.0 * rng.unit();
            cones.push(Cone { ends: [from, std::array::from_fn(|k| from[k] + (length * axis[k]) as f32)], radii });
        }
    }
    cones
}

fn ellipsoids(rng: &mut SplitMix64) -> Vec<Ellipsoid> {
    let scales = [[1.0, 1.0, 1.0], [1.0, 0.2, 0.5], [0.01, 1.0, 2.0]];
    scales
        .map(|[x, y, z]| Ellipsoid {
            center: rng.signed3().map(|x| x as f32),
            axes: [[x, 0.0, 0.0], [0.0, 0.8 * y, 0.6 * y], [0.0, -0.6 * z, 0.8 * z]],
        })
        .to_vec()
}

/// Rays at a point near a center, from afar, from within and along the axes.
fn ray_at(center: [f32; 3], rng: &mut SplitMix64, i: usize) -> Ray {
    let target: Vector = std::array::from_fn(|k| f64::from(center[k]) + 0.6 * rng.signed());
    let from = if i.is_multiple_of(5) {
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]][i / 5 % 3]
    } else {
        rng.on_sphere()
    };
    let far = [5.0, 0.0, 1.0][i % 3];
    let origin = std::array::from_fn(|k| (target[k] + far * from[k]) as f32);
    Ray::new(origin, from.map(|x| -x as f32))
}

/// Points between the ends of the span are inside, those before and after are outside, and a line that misses has no point inside.
fn check(ray: &Ray, span: Option<[f32; 2]>, inside: impl Fn(Vector, f64) -> bool, what: &dyn std::fmt::Debug) {
    let scaled = ScaledRay::new(ray).unwrap();
    let span = span.map(|ends| ends.map(|t| f64::from(t) / scaled.scale()));
    const MARGIN: f64 = 2e-6;
    for i in 0..=600 {
        let t = -12.0 + f64::from(i) * 0.04;
        let p = std::array::from_fn(|k| f64::from(ray.origin[k]) + t * f64::from(ray.direction[k]));
        let is_within = span.is_some_and(|[entry, exit]| entry <= t && t <= exit);
        assert!(!inside(p, MARGIN) || is_within, "{what:?} {ray:?} {span:?}: {t} is inside");
        assert!(!is_within || inside(p, -MARGIN), "{what:?} {ray:?} {span:?}: {t} is outside");
    }
    for t in span.into_iter().flatten() {
        let p = std::array::from_fn(|k| f64::from(ray.origin[k]) + t * f64::from(ray.direction[k]));
        assert!(inside(p, -MARGIN) && !inside(p, MARGIN), "{what:?} {ray:?}: {t} is off the surface");
    }
}

#[test]
fn lines_enter_and_leave_at_the_surface() {
    let mut rng = SplitMix64::new(21);
    let mut n_hits = 0;
    for cone in cones(&mut rng) {
        for i in 0..120 {
            let ray = ray_at(cone.ends[i % 2], &mut rng, i);
            let span = cone.span_scaled(&ScaledRay::new(&ray).unwrap()).map(|ends| ends.map(|(t, _)| t));
            n_hits += usize::from(span.is_some());
            check(&ray, span, |p, margin| in_cone(&cone, p, margin), &cone);
        }
    }
    for ellipsoid in ellipsoids(&mut rng) {
        for i in 0..120 {
            let ray = ray_at(ellipsoid.center, &mut rng, i);
            let span = ellipsoid.roots_scaled(&ScaledRay::new(&ray).unwrap());
            n_hits += usize::from(span.is_some());
            check(&ray, span, |p, margin| in_ellipsoid(&ellipsoid, p, margin), &ellipsoid);
        }
    }
    assert!(n_hits > 700, "{n_hits}");
}

/// Lines through a tip, which touch the other half of the double cone there, enter or leave at the base.
#[test]
fn lines_through_a_tip_cross_the_cone() {
    let mut rng = SplitMix64::new(22);
    for i in 0..1500 {
        let radius = [0.05, 0.3, 1.0][i % 3];
        let tip: [f32; 3] = if i % 2 == 0 { [0.0; 3] } else { rng.signed3().map(|x| x as f32) };
        let (axis, other) = (rng.on_sphere(), rng.on_sphere());
        let across: Vector = std::array::from_fn(|k| other[k] - dot(other, axis) * axis[k]);
        let base: [f32; 3] = std::array::from_fn(|k| tip[k] + axis[k] as f32);
        let cone = Cone { ends: [tip, base], radii: [0.0, radius] };
        let cone = if i % 4 < 2 { cone } else { Cone { ends: [base, tip], radii: [radius, 0.0] } };
        let off = [0.0, 0.6 * rng.unit()][i / 3 % 2] * f64::from(radius);
        let forward: [f32; 3] = std::array::from_fn(|k| (axis[k] + off * across[k]) as f32);
        let sign = [1.0, -1.0][i / 6 % 2];
        let start = [0.25, -2.0, 3.0][i / 12 % 3];
        let origin = std::array::from_fn(|k| tip[k] + start * forward[k]);
        let ray = Ray::new(origin, forward.map(|x| sign * x));
        let scaled = ScaledRay::new(&ray).unwrap();
        let span = cone.span_scaled(&scaled).map(|ends| ends.map(|(t, _)| t));
        let length = span.map(|[entry, exit]| (f64::from(exit) - f64::from(entry)) / scaled.scale());
        assert!(length.is_some_and(|length| (length - 1.0).abs() < 1e-5), "{cone:?} {ray:?} {span:?}");
        check(&ray, span, |p, margin| in_cone(&cone, p, margin), &cone);
    }
}

#[test]
fn values_of_simple_rays() {
    let scaled = |origin, direction| ScaledRay::new(&Ray::new(origin, direction)).unwrap();
    let down = scaled([0.5, 0.0, 3.0], [0.0, 0.0, -1.0]);
    let t = |t: f32| t / down.scale() as f32;
    let disk = Disk { center: [0.0, 0.0, 1.0], normal: [0.0, 0.0, 2.0], radius: 1.0 };
    assert_eq!(disk.point_scaled(&down).map(|(at, u, front)| (t(at), u, front)), Some((2.0, 0.5, true)));
    assert_eq!(disk.point_scaled(&scaled([2.0, 0.0, 3.0], [0.0, 0.0, -1.0])), None);
    assert_eq!(disk.point_scaled(&scaled([0.0, 0.0, 1.0], [1.0, 0.0, 0.0])), None, "in its plane");
    // A cylinder along x; a cone with its tip at x = 1; through the flat end.
    let cylinder = Cone { ends: [[0.0; 3], [1.0, 0.0, 0.0]], radii: [0.5; 2] };
    assert_eq!(cylinder.span_scaled(&down).map(|ends| ends.map(|(at, u)| (t(at), u))), Some([(2.5, 0.5), (3.5, 0.5)]));
    let cone = Cone { radii: [1.0, 0.0], ..cylinder };
    assert_eq!(cone.span_scaled(&down).map(|ends| ends.map(|(at, u)| (t(at), u))), Some([(2.5, 0.5), (3.5, 0.5)]));
    let along = cylinder.span_scaled(&scaled([-2.0, 0.1, 0.1], [1.0, 0.0, 0.0])).unwrap();
    assert_eq!(along.map(|(at, u)| (t(at), u)), [(2.0, 0.0), (3.0, 1.0)]);
    assert_eq!(cylinder.span_scaled(&scaled([-2.0, 0.6, 0.1], [1.0, 0.0, 0.0])), None);
    assert_eq!(Cone { ends: [[0.0; 3]; 2], radii: [1.0; 2] }.span_scaled(&down), None, "a cone without length");
}
