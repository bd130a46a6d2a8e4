//! Ribbons against a search for the least distances between line and center line, and chains of them against the polyline.

use canted_fixtures::SplitMix64;
use canted_trace::{Intersect as _, Ray, RibbonCubic, RibbonSegment, ScaledRay};
use canted_wide::{Config, Primitive, WideBvh};

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn cross(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
}

fn wide(v: [f32; 3]) -> Vector {
    v.map(f64::from)
}

fn sub(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] - b[k])
}

/// What the oracle needs to know of a ribbon.
trait Ribbon: Primitive + Copy + std::fmt::Debug {
    /// Center and radius at a parameter.
    fn ball(&self, u: f64) -> (Vector, f64);
    /// The end, the direction there, and the direction of the next ribbon, if any.
    fn joint(&self) -> (Vector, Vector, Option<Vector>);
    /// Another width, another next ribbon, moved.
    fn changed(&self, width: f32, follows: bool, place: impl Fn([f32; 3]) -> [f32; 3]) -> Self;
    /// All forms of these tests.
    fn all(rng: &mut SplitMix64) -> Vec<Self>;
}

fn next_of(end: [f32; 3], next: [f32; 3]) -> Option<Vector> {
    (next != end).then(|| sub(wide(next), wide(end)))
}

impl Ribbon for RibbonSegment {
    fn ball(&self, u: f64) -> (Vector, f64) {
        let ([a, b], [r, s]) = (self.ends.map(wide), self.radii.map(f64::from));
        (std::array::from_fn(|k| a[k] + u * (b[k] - a[k])), r + u * (s - r))
    }

    fn joint(&self) -> (Vector, Vector, Option<Vector>) {
        let [a, b] = self.ends.map(wide);
        (b, sub(b, a), next_of(self.ends[1], self.next))
    }

    fn changed(&self, width: f32, follows: bool, place: impl Fn([f32; 3]) -> [f32; 3]) -> Self {
        let next = place(if follows { self.next } else { self.ends[1] });
        Self { ends: self.ends.map(place), radii: self.radii.map(|r| width * r), next }
    }

    fn all(rng: &mut SplitMix64) -> Vec<Self> {
        let mut all = Vec::new();
        for length in [1e-3, 1.0, 50.0] {
            for radii in [[1.0, 1.0], [0.5, 0.02], [0.0, 0.7], [1e-3, 1e-3], [1e-6, 1e-3]] {
                for along in [[1.0, 0.0, -0.0], rng.on_sphere(), rng.on_sphere()] {
                    let a: [f32; 3] = rng.signed3().map(|x| 3.0 * x as f32);
                    let b: [f32; 3] = std::array::from_fn(|k| a[k] + (length * along[k]) as f32);
                    let off = rng.on_sphere();
                    let next = std::array::from_fn(|k| b[k] + off[k] as f32);
                    all.push(Self { ends: [a, b], radii, next });
                }
            }
        }
        all
    }
}

impl Ribbon for RibbonCubic {
    fn ball(&self, u: f64) -> (Vector, f64) {
        let v = 1.0 - u;
        let weights = [v * v * v, 3.0 * u * v * v, 3.0 * u * u * v, u * u * u];
        let sum = |value: &dyn Fn(usize) -> f32| (0..4).map(|i| weights[i] * f64::from(value(i))).sum();
        (std::array::from_fn(|k| sum(&|i| self.points[i][k])), sum(&|i| self.radii[i]))
    }

    fn joint(&self) -> (Vector, Vector, Option<Vector>) {
        let end = wide(self.points[3]);
        let before = self.points.iter().rev().find(|&&point| point != self.points[3]);
        (end, before.map_or([0.0; 3], |&point| sub(end, wide(point))), next_of(self.points[3], self.next))
    }

    fn changed(&self, width: f32, follows: bool, place: impl Fn([f32; 3]) -> [f32; 3]) -> Self {
        let next = place(if follows { self.next } else { self.points[3] });
        Self { points: self.points.map(&place), radii: self.radii.map(|r| width * r), next }
    }

    /// Gentle, looped, with a cusp, straight, with coincident control points; narrow, and wider than the radius of curvature.
    fn all(rng: &mut SplitMix64) -> Vec<Self> {
        let mut all = Vec::new();
        for radii in [[0.05; 4], [0.3, 0.1, 0.02, 0.0], [0.0, 0.0, 0.0, 0.4], [1.0, 0.2, 0.2, 0.7], [1e-5; 4], [3.0; 4]]
        {
            for kind in 0..9 {
                let mut points: [[f32; 3]; 4] = std::array::from_fn(|_| rng.signed3().map(|x| 2.0 * x as f32));
                match kind {
                    0 => points = std::array::from_fn(|i| [i as f32, 0.1 * (i * i) as f32, 0.0]),
                    1 => points = [[0.0; 3], [3.0, 2.0, 0.0], [-1.0, 2.0, 0.1], [2.0, 0.0, 0.0]],
                    2 => points = [[0.0; 3], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0], [2.0, 0.0, 0.0]],
                    3 => points = std::array::from_fn(|i| [i as f32, 0.0, 0.0]),
                    4 => points[1] = points[0],
                    5 => points[2] = points[3],
                    _ => {}
                }
                let off = rng.on_sphere();
                let next = std::array::from_fn(|k| points[3][k] + off[k] as f32);
                all.push(Self { points, radii, next });
            }
        }
        all
    }
}

/// A ray at a center or beside it, from afar or from within, also along the center line.
fn ray_at(ribbon: &impl Ribbon, rng: &mut SplitMix64, i: usize) -> Ray {
    let u = [0.0, rng.unit(), rng.unit(), 1.0][i % 4];
    let (center, radius) = ribbon.ball(u);
    let reach = radius * [0.0, 0.3, 0.9, 0.999, 1.3][i / 4 % 5];
    let (mut off, mut from) = (rng.on_sphere(), rng.on_sphere());
    let ahead = sub(ribbon.ball((u + 0.01).min(1.0)).0, ribbon.ball((u - 0.01).max(0.0)).0);
    if i.is_multiple_of(3) {
        // At the edge.
        let side = cross(ahead, from);
        off = side.map(|x| x / dot(side, side).sqrt().max(f64::MIN_POSITIVE));
    } else if i.is_multiple_of(11) && dot(ahead, ahead) > 1e-12 {
        from = std::array::from_fn(|k| ahead[k] / dot(ahead, ahead).sqrt() + 0.02 * off[k]);
    }
    let target: Vector = std::array::from_fn(|k| center[k] + reach * off[k]);
    let far = [4.0, 0.0, 0.5][i % 3];
    Ray::new(target.map(|x| x as f32), from.map(|x| -x as f32)).shifted(far, from)
}

trait Shifted {
    fn shifted(self, far: f64, from: Vector) -> Self;
}

impl Shifted for Ray {
    fn shifted(mut self, far: f64, from: Vector) -> Self {
        self.origin = std::array::from_fn(|k| self.origin[k] + (far * from[k]) as f32);
        self
    }
}

/// Least distances that decide by less than this part of their size are decided by roundings.
const UNCERTAIN: f64 = 1e-9;

/// Where the rule says that the line of a ray hits, by increasing `t`; `None` where roundings decide. All minima of the distance, by a search of
/// many intervals with ternary searches.
fn wanted(ribbon: &impl Ribbon, ray: &Ray) -> Option<Vec<(f64, f64)>> {
    const N: u32 = 2400;
    let (o, d) = (wide(ray.origin), wide(ray.direction));
    let depth = |center: Vector| dot(sub(center, o), d) / dot(d, d);
    // From the center to the line.
    let aside = |center: Vector| -> Vector {
        let t = depth(center);
        std::array::from_fn(|k| o[k] + t * d[k] - center[k])
    };
    let distance = |u: f64| {
        let off = aside(ribbon.ball(u).0);
        dot(off, off).sqrt()
    };
    let size = (0..=8).map(|i| distance(f64::from(i) / 8.0)).fold(0.0, f64::max) + ribbon.ball(0.0).1;
    let mut hits = Vec::new();
    let mut is_certain = true;
    let values: Vec<f64> = (0..=N).map(|i| distance(f64::from(i) / f64::from(N))).collect();
    for i in 0..=N as usize {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(N as usize));
        if values[before] < values[i] || values[after] < values[i] {
            continue;
        }
        let (mut low, mut high) = (before as f64 / f64::from(N), after as f64 / f64::from(N));
        for _ in 0..80 {
            let (s, t) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if distance(s) < distance(t) { high = t } else { low = s }
        }
        let (least, radius) = (distance(low), ribbon.ball(low).1);
        // A search by values knows a minimum to about the square root of their roundings.
        let is_at_end = !(1e-6..=1.0 - 1e-6).contains(&low);
        if is_at_end && least < radius + UNCERTAIN * size {
            // The parabola through three squares is least clearly outside: an end, and no minimum.
            let square = |h: f64| distance(if low < 0.5 { h } else { 1.0 - h }).powi(2);
            let [a, b, c] = [0.0, 1e-3, 2e-3].map(square);
            let (first, second) = ((4.0 * b - 3.0 * a - c) / 2e-3, (a - 2.0 * b + c).abs() / 1e-6);
            is_certain &= first > 2e-3 * second && first > 1e-9 * size * size;
            continue;
        }
        is_certain &= is_at_end || (least - radius).abs() > UNCERTAIN * size;
        is_certain &= is_at_end || least > radius || (2e-3..1.0 - 2e-3).contains(&low);
        // Flat minima are not known well.
        let flat = distance((low - 1e-3).max(0.0)).min(distance((low + 1e-3).min(1.0))) - least;
        if !is_at_end && least <= radius {
            is_certain &= flat > 1e-10 * size;
            hits.push((depth(ribbon.ball(low).0), low));
        }
    }
    let (end, tangent, next) = ribbon.joint();
    let (off, radius) = (aside(end), ribbon.ball(1.0).1);
    let far = dot(off, off).sqrt();
    // Across the line, as everything here.
    let flat = |v: Vector| -> Vector {
        let along = dot(v, d) / dot(d, d);
        std::array::from_fn(|k| v[k] - along * d[k])
    };
    let side = |v: Vector| dot(off, flat(v)) / (dot(v, v).sqrt() + f64::MIN_POSITIVE) / size;
    if let Some(next) = next
        && far <= radius + UNCERTAIN * size
    {
        let (beyond, before) = (side(tangent), -side(next));
        is_certain &= beyond.abs() > 1e-7 && before.abs() > 1e-7 && (far - radius).abs() > UNCERTAIN * size;
        if beyond > 0.0 && before > 0.0 {
            hits.push((depth(end), 1.0));
        }
    }
    hits.sort_by(|a, b| a.0.total_cmp(&b.0));
    is_certain.then_some(hits)
}

/// All hits of a ray that starts before everything, one after the other, with the `t` of the caller, and `u` and `v`.
fn found(ribbon: &impl Ribbon, ray: &Ray) -> Vec<(f64, f64, f64)> {
    let mut scaled = ScaledRay::new(ray).expect("a valid ray");
    scaled.t_min = f32::MIN;
    let mut hits = Vec::new();
    while let Some(hit) = ribbon.intersect(&scaled, f32::INFINITY) {
        hits.push((f64::from(hit.t) / scaled.scale(), f64::from(hit.u), f64::from(hit.v)));
        scaled.t_min = hit.t.next_up();
    }
    hits
}

/// Counts of rays that were compared, of their hits, of rays with several, and of rays with other hits.
fn compare<R: Ribbon>(all: &[R], tested: &[R], n: usize) -> [usize; 4] {
    let mut rng = SplitMix64::new(17);
    let mut counts = [0; 4];
    for (ribbon, tested) in all.iter().zip(tested) {
        for i in 0..n {
            let ray = ray_at(ribbon, &mut rng, i);
            let Some(want) = wanted(ribbon, &ray) else { continue };
            let found = found(tested, &ray);
            let tolerance = |t: f64| 1e-5 * (1.0 + t.abs());
            // Hits at one `t` are one.
            if want.windows(2).any(|pair| pair[1].0 - pair[0].0 < tolerance(pair[0].0)) {
                continue;
            }
            let is_same = want.len() == found.len()
                && want.iter().zip(&found).all(|(want, found)| (want.0 - found.0).abs() < tolerance(want.0));
            counts[0] += 1;
            counts[1] += want.len();
            counts[2] += usize::from(want.len() > 1);
            counts[3] += usize::from(!is_same);
        }
    }
    counts
}

#[test]
fn ribbons_are_hit_where_the_distance_is_least() {
    let mut rng = SplitMix64::new(7);
    let segments = RibbonSegment::all(&mut rng);
    let [n, n_hits, _, n_other] = compare(&segments, &segments, 200);
    assert!(n_other == 0 && n > 5000 && n_hits > 3000, "segments: {n_other} of {n} differ, {n_hits} hits");
    let cubics = RibbonCubic::all(&mut rng);
    let [n, n_hits, n_several, n_other] = compare(&cubics, &cubics, 200);
    let message = format!("cubics: {n_other} of {n} differ, {n_hits} hits, {n_several} rays with several");
    assert!(n_other == 0 && n > 6000 && n_hits > 5000 && n_several > 500, "{message}");
}

/// The comparison finds ribbons that are a little too narrow, and those without the wedge at a joint.
#[test]
fn the_comparison_finds_other_ribbons() {
    fn check<R: Ribbon>() {
        let all = R::all(&mut SplitMix64::new(7));
        for (width, follows) in [(0.998, true), (1.0, false)] {
            let other: Vec<R> = all.iter().map(|ribbon| ribbon.changed(width, follows, |p| p)).collect();
            let [.., n_other] = compare(&all, &other, 100);
            assert!(n_other > 30, "{n_other} with {width} of the width, followed: {follows}");
        }
    }
    check::<RibbonSegment>();
    check::<RibbonCubic>();
}

/// The point of a hit is in the ball at its parameter, but for the rounding of `t`, and `v` states where, from left to right.
#[test]
fn hits_are_at_the_center_of_their_parameter() {
    fn check<R: Ribbon>() {
        let mut rng = SplitMix64::new(9);
        let mut n_hits = 0;
        for ribbon in R::all(&mut rng) {
            for i in 0..200 {
                let ray = ray_at(&ribbon, &mut rng, i);
                for (t, u, v) in found(&ribbon, &ray) {
                    n_hits += 1;
                    let (center, radius) = ribbon.ball(u);
                    let d = wide(ray.direction);
                    let at: Vector = std::array::from_fn(|k| f64::from(ray.origin[k]) + t * d[k]);
                    let off = sub(at, center);
                    let reach = 60.0 + 6.0;
                    assert!(dot(off, off).sqrt() < radius + f64::from(f32::EPSILON) * reach, "{ribbon:?} {ray:?} {u}");
                    // At a joint the point may be beyond the edge.
                    if u < 1.0 && radius > 1e-3 {
                        let ahead = sub(ribbon.ball(u + 1e-6).0, ribbon.ball(u - 1e-6).0);
                        let right = cross(d, ahead);
                        let length = dot(right, right).sqrt();
                        // Where the ray looks along the line, and at cusps, the sides are not known well.
                        if length > 1e-2 * (dot(d, d) * dot(ahead, ahead)).sqrt() && dot(ahead, ahead) > 1e-16 {
                            let want = 0.5 + 0.5 * dot(off, right) / length / radius;
                            assert!((v - want).abs() < 1e-2, "{ribbon:?} {ray:?} {u}: {v} for {want}");
                        }
                    }
                }
            }
        }
        assert!(n_hits > 3000, "{n_hits}");
    }
    check::<RibbonSegment>();
    check::<RibbonCubic>();
}

#[test]
fn ribbons_face_every_ray() {
    let ribbon = RibbonSegment { ends: [[0.0, -2.0, 0.0], [0.0, 2.0, 0.0]], radii: [0.5; 2], next: [0.0, 2.0, 0.0] };
    for (origin, direction) in [
        ([0.25, 1.0, 5.0], [0.0, 0.0, -1.0]),
        ([-0.25, 1.0, -5.0], [0.0, 0.0, 1.0]),
        ([5.0, 1.0, -0.25], [-1.0, 0.0, 0.0]),
        ([-5.0, 1.0, 0.25], [1.0, 0.0, 0.0]),
    ] {
        // To the right of the middle for each of them.
        let [(t, u, v)] = found(&ribbon, &Ray::new(origin, direction))[..] else { panic!("one hit") };
        assert_eq!((t, u, v), (5.0, 0.75, 0.75), "{origin:?}");
    }
    // A straight edge at the end, where a round segment has half a ball.
    assert!(found(&ribbon, &Ray::new([0.0, 2.125, 5.0], [0.0, 0.0, -1.0])).is_empty());
    // A disk, for who looks along it.
    let [(t, ..)] = found(&ribbon, &Ray::new([0.375, 5.0, 0.25], [0.0, -1.0, 0.0]))[..] else { panic!("one hit") };
    assert_eq!(t, 7.0);
}

/// Edges, centers and parameters at which halving decides, in numbers without roundings.
#[test]
fn lines_through_edges_and_halves_are_hits() {
    let along = |points: [[f32; 3]; 4]| RibbonCubic { points, radii: [0.5; 4], next: points[3] };
    let straight = along(std::array::from_fn(|i| [i as f32, 0.0, 0.0]));
    for (x, u) in [(0.0, 0.0), (1.5, 0.5), (3.0, 1.0), (0.75, 0.25)] {
        for y in [0.0, 0.5, -0.5, 0.25] {
            let hits = found(&straight, &Ray::new([x, y, 4.0], [0.0, 0.0, -1.0]));
            assert_eq!(hits, [(4.0, u, 0.5 - f64::from(y))], "{x} {y}");
        }
    }
    // Through the double point of a loop: two hits, the nearer one first.
    let looped = along([[0.0; 3], [4.0, 4.0, 0.0], [-2.0, 4.0, 1.0], [2.0, 0.0, 1.0]]);
    let hits = found(&looped, &Ray::new([1.0, 1.6, 5.0], [0.0, 0.0, -1.0]));
    assert!(
        hits.len() > 1 && hits.iter().any(|&(_, u, _)| u < 0.4) && hits.iter().any(|&(_, u, _)| u > 0.6),
        "{hits:?}"
    );
    // One point is a disk.
    let point = along([[1.0, 2.0, 3.0]; 4]);
    assert_eq!(found(&point, &Ray::new([1.25, 2.0, 5.0], [0.0, 0.0, -1.0])).len(), 1);
    assert!(found(&point, &Ray::new([1.6, 2.0, 5.0], [0.0, 0.0, -1.0])).is_empty());
}

/// The points of a line that bends by up to half a turn at each point.
fn polyline(rng: &mut SplitMix64, n: usize) -> Vec<[f32; 3]> {
    let mut at = [0.0_f32; 3];
    let point = |_| {
        let step = rng.on_sphere();
        at = std::array::from_fn(|k| at[k] + step[k] as f32);
        at
    };
    (0..n).map(point).collect()
}

/// Ribbons along a polyline, or along the uniform B-spline of its points.
fn segments(points: &[[f32; 3]], radius: f32) -> Vec<RibbonSegment> {
    let next = |i: usize| points.get(i + 2).copied().unwrap_or(points[i + 1]);
    let ribbon = |i: usize| RibbonSegment { ends: [points[i], points[i + 1]], radii: [radius; 2], next: next(i) };
    (0..points.len() - 1).map(ribbon).collect()
}

fn spline(points: &[[f32; 3]], radius: f32) -> Vec<RibbonCubic> {
    let curve = |p: &[[f32; 3]]| -> [[f32; 3]; 4] {
        let at = |w: [f32; 4]| std::array::from_fn(|k| (0..4).map(|i| w[i] * p[i][k]).sum::<f32>() / 6.0);
        let first = at([1.0, 4.0, 1.0, 0.0]);
        [first, at([0.0, 4.0, 2.0, 0.0]), at([0.0, 2.0, 4.0, 0.0]), at([0.0, 1.0, 4.0, 1.0])]
    };
    let curves: Vec<_> = points.windows(4).map(curve).collect();
    let next = |i: usize| curves.get(i + 1).map_or(curves[i][3], |next| next[1]);
    (0..curves.len()).map(|i| RibbonCubic { points: curves[i], radii: [radius; 4], next: next(i) }).collect()
}

/// Rays at the joints of a chain, where gaps would be: rays from everywhere, of which the target is next to a joint.
fn rays_at_joints(chain: &[impl Ribbon], rng: &mut SplitMix64, n: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let (joint, radius) = chain[i % (chain.len() - 1)].ball(1.0);
        let (off, from) = (rng.on_sphere(), rng.on_sphere());
        let reach = radius * [0.0, 1e-6, 0.5, 0.99][i % 4];
        let origin: [f32; 3] = std::array::from_fn(|k| (joint[k] + reach * off[k] + 8.0 * from[k]) as f32);
        let target: Vector = std::array::from_fn(|k| joint[k] + reach * off[k]);
        Ray::new(origin, std::array::from_fn(|k| (target[k] - f64::from(origin[k])) as f32))
    };
    (0..n).map(ray).collect()
}

/// No ray at a joint passes between the ribbons of a chain; without the wedge many do.
#[test]
fn chains_have_no_gaps_at_joints() {
    fn n_lost<R: Ribbon>(chain: &[R], rays: &[Ray]) -> usize {
        let is_lost = |ray: &&Ray| chain.iter().all(|ribbon| found(ribbon, ray).is_empty());
        rays.iter().filter(is_lost).count()
    }
    let mut rng = SplitMix64::new(41);
    let (mut without, mut without_curves) = (0, 0);
    for i in 0..40 {
        let points = polyline(&mut rng, 12);
        let radius = [0.1, 0.01, 1e-4][i % 3];
        let chain = segments(&points, radius);
        let rays = rays_at_joints(&chain, &mut rng, 200);
        assert_eq!(n_lost(&chain, &rays), 0, "segments {i}");
        let open: Vec<_> = chain.iter().map(|ribbon| ribbon.changed(1.0, false, |p| p)).collect();
        without += n_lost(&open, &rays);
        // Kinks where splines are not smooth: each second curve is mirrored.
        let mut curves = spline(&points, radius);
        let rays = rays_at_joints(&curves, &mut rng, 200);
        assert_eq!(n_lost(&curves, &rays), 0, "B-splines {i}");
        for k in 1..curves.len() {
            let joint = curves[k - 1].points[3];
            let [_, b, ..] = curves[k].points;
            let kink = std::array::from_fn(|k| joint[k] + 0.7 * (b[(k + 1) % 3] - joint[(k + 1) % 3]));
            curves[k].points[1] = kink;
            curves[k - 1].next = kink;
        }
        assert_eq!(n_lost(&curves, &rays), 0, "kinked curves {i}");
        let open: Vec<_> = curves.iter().map(|ribbon| ribbon.changed(1.0, false, |p| p)).collect();
        without_curves += n_lost(&open, &rays);
    }
    assert!(without > 300 && without_curves > 300, "{without} and {without_curves}");
}

/// A gentle spline is covered once: opacity counts once at its joints, too.
#[test]
fn smooth_chains_are_hit_once() {
    let mut rng = SplitMix64::new(43);
    let points: Vec<[f32; 3]> = (0..14).map(|i| [i as f32, (0.4 * i as f32).sin(), (0.3 * i as f32).cos()]).collect();
    let chain = spline(&points, 0.1);
    let rays = rays_at_joints(&chain, &mut rng, 8000);
    let mut n = 0;
    // Not those at the joint itself: tangents on both sides differ by roundings.
    for (i, ray) in rays.iter().enumerate().filter(|(i, _)| i % 4 > 1) {
        // Rays from ahead see several parts of the chain at one place.
        let d = wide(ray.direction);
        if d[0] * d[0] > 0.5 * dot(d, d) {
            continue;
        }
        n += 1;
        assert_eq!(chain.iter().map(|ribbon| found(ribbon, ray).len()).sum::<usize>(), 1, "{i} {ray:?}");
    }
    assert!(n > 2000, "{n}");
}

/// A later start hides hits but does not change those after it, nor does an earlier end.
#[test]
fn hits_do_not_depend_on_the_interval() {
    let mut rng = SplitMix64::new(19);
    let mut n_later = 0;
    for ribbon in RibbonCubic::all(&mut rng) {
        for i in 0..60 {
            let mut scaled = ScaledRay::new(&ray_at(&ribbon, &mut rng, i)).expect("a valid ray");
            let mut n = 0;
            while let Some(hit) = ribbon.intersect(&scaled, f32::INFINITY) {
                n += 1;
                assert_eq!(ribbon.intersect(&scaled, hit.t), Some(hit));
                assert!(
                    ribbon
                        .intersect(&scaled, hit.t.next_down())
                        .is_none_or(|other| hit.t <= scaled.t_min && other == hit)
                );
                scaled.t_min = hit.t;
                assert_eq!(ribbon.intersect(&scaled, f32::INFINITY), Some(hit));
                scaled.t_min = hit.t.next_up();
            }
            n_later += usize::from(n > 1);
        }
    }
    assert!(n_later > 100, "{n_later}");
}

/// The loop over all ribbons gives the same bits: of usual size, far away, and tiny; saved and loaded, too.
#[test]
fn hits_do_not_depend_on_the_bvh() {
    fn check<R: Ribbon + canted_wide::SavedPrimitive + PartialEq>() {
        let mut rng = SplitMix64::new(13);
        let all: Vec<R> = (0..4).flat_map(|_| R::all(&mut rng)).collect();
        let rays: Vec<Ray> = (0..500).map(|i| ray_at(&all[i % all.len()], &mut rng, i)).collect();
        for (scale, shift) in [(1.0, 0.0), (1024.0, 1e7), (1e-6, 0.0)] {
            let place = |p: [f32; 3]| p.map(|x| scale * x + shift);
            let moved: Vec<R> = all.iter().map(|ribbon| ribbon.changed(scale, true, place)).collect();
            let mut n_hits = 0;
            for config in [Config::default(), Config::default().axis_aligned()] {
                let bvh = WideBvh::over_with(moved.clone(), config).unwrap();
                let loaded = WideBvh::<R>::from_bytes(&bvh.to_bytes()).unwrap();
                for ray in &rays {
                    let ray = Ray::new(place(ray.origin), ray.direction);
                    let scaled = ScaledRay::new(&ray).unwrap();
                    let one = |(i, ribbon): (usize, &R)| Some((ribbon.intersect(&scaled, f32::INFINITY)?, i));
                    let alone = moved.iter().enumerate().filter_map(one);
                    let want = alone.min_by(|a, b| a.0.t.total_cmp(&b.0.t).then(a.1.cmp(&b.1)));
                    let want = want
                        .map(|(hit, i)| (scaled.caller_t(hit.t).to_bits(), hit.u.to_bits(), hit.v.to_bits(), i as u32));
                    n_hits += usize::from(want.is_some());
                    for bvh in [&bvh, &loaded] {
                        let hit = bvh.closest_hit(&ray);
                        let hit = hit.map(|h| (h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive.0));
                        assert_eq!(hit, want, "{ray:?}");
                    }
                }
            }
            assert!(n_hits > 200, "{n_hits}");
        }
    }
    check::<RibbonSegment>();
    check::<RibbonCubic>();
}
