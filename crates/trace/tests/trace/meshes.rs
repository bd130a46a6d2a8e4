//! Meshes for continued rays, and the closest hit by linear scan.

use std::f64::consts::TAU;

use canted_obb::PrimId;
use canted_obb::vector::{Vector, add, scale, to_f32, unit};
use canted_trace::{Hit, InstanceId, Kernel, Ray, ScaledRay};

pub(crate) type Triangle = [[f32; 3]; 3];

/// Closest hit by linear scan; ties to the lower index.
pub(crate) fn closest_hit<K: Kernel>(mesh: &[Triangle], ray: &Ray) -> Option<Hit> {
    let scaled = ScaledRay::new(ray)?;
    let prepared = K::prepare(&scaled);
    let mut closest: Option<Hit> = None;
    for (i, triangle) in (0..).zip(mesh) {
        let t_max = closest.map_or(scaled.t_max, |hit| scaled.scaled_t(hit.t));
        if let Some(hit) = K::intersect(&prepared, &scaled, &K::record(*triangle), t_max) {
            let (t, u, v, side) = (scaled.caller_t(hit.t), hit.u, hit.v, hit.side);
            let hit = Hit { t, u, v, primitive: PrimId(i), instance: InstanceId(0), side };
            if closest.is_none_or(|best| hit.before(&best)) {
                closest = Some(hit);
            }
        }
    }
    closest
}

/// A surface over a grid of `n` by `m` quads, closed where `point` has the period 2π in both angles.
pub(crate) fn surface(n: u32, m: u32, wraps: bool, point: impl Fn(f64, f64) -> Vector) -> Vec<Triangle> {
    let at = |i: u32, j: u32| {
        to_f32(point(
            TAU * f64::from(i % n) / f64::from(n),
            TAU * f64::from(if wraps { j % m } else { j }) / f64::from(m),
        ))
    };
    let quads = (0..n).flat_map(|i| (0..m).map(move |j| (i, j)));
    quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect()
}

/// A sphere about `center`: convex, so outward rays hit nothing.
pub(crate) fn sphere(center: Vector, radius: f64) -> Vec<Triangle> {
    surface(24, 12, false, |i, j| {
        let (theta, phi) = (0.5 * j, i);
        // One point at the poles, so that no sliver is left there.
        let sin = if theta.sin() < 1e-9 { 0.0 } else { theta.sin() };
        add(center, scale([sin * phi.cos(), sin * phi.sin(), theta.cos()], radius))
    })
}

/// A torus with bumps: closed and concave.
pub(crate) fn torus(center: Vector, size: f64) -> Vec<Triangle> {
    surface(40, 20, true, |i, j| {
        let r = 0.4 + 0.08 * (5.0 * i).sin() * (3.0 * j).cos();
        let ring = 1.0 + r * j.cos();
        add(center, scale([ring * i.cos(), ring * i.sin(), r * j.sin()], size))
    })
}

/// Triangles with a height of a millionth of their length, in all directions.
pub(crate) fn needles(center: Vector, size: f64) -> Vec<Triangle> {
    let mut random = Random(7);
    let needle = |_| {
        let (a, direction) = (random.direction(), random.direction());
        let across = scale(random.direction(), 1e-6);
        [a, add(a, direction), add(a, across)].map(|p| to_f32(add(center, scale(p, size))))
    };
    (0..400).map(needle).collect()
}

/// SplitMix64 (Steele, Lea, Flood 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        let unit = ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64;
        2.0 * unit - 1.0
    }

    pub(crate) fn direction(&mut self) -> Vector {
        unit([self.signed(), self.signed(), self.signed()]).unwrap_or([1.0, 0.0, 0.0])
    }
}
