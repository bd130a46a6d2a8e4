use std::{collections::HashMap, f64::consts::TAU};

use canted_obb::{
    PrimId,
    vector::{Vector, add, cross, dot, scale, sub, to_f32, unit},
};
use canted_trace::{
    BaldwinWeber, Hit, InstanceId, Kernel, MollerTrumbore, Projected, Ray, ScaledRay, Watertight, lanes::UNIT_ROUNDOFF,
};
use num_traits::{Signed, Zero};

use crate::{
    inputs::{self, Rng, SETTINGS, Triangle, UNIT_ROUNDOFF_F64, q, ray_at},
    kernels::hit,
};

/// A subdivided octahedron, its vertices shared bit for bit; then scaled and moved, which keeps it closed.
fn octasphere(levels: u32, scale: [f32; 3], around: [f32; 3]) -> Vec<Triangle> {
    let mut triangles: Vec<Triangle> = (0..8u32)
        .map(|i| {
            let side = |k: u32| if i >> k & 1 == 1 { 1.0 } else { -1.0 };
            let corners = [[side(0), 0.0, 0.0], [0.0, side(1), 0.0], [0.0, 0.0, side(2)]];
            if side(0) * side(1) * side(2) > 0.0 { corners } else { [corners[0], corners[2], corners[1]] }
        })
        .collect();
    for _ in 0..levels {
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                // Symmetric in its arguments, so neighbors agree.
                let middle = |p: [f32; 3], q: [f32; 3]| {
                    let sum: [f32; 3] = std::array::from_fn(|k| p[k] + q[k]);
                    sum.map(|x| x / dot(sum, sum).sqrt())
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let place = |p: [f32; 3]| std::array::from_fn(|k| p[k] * scale[k] + around[k]);
    triangles.into_iter().map(|t| t.map(place)).collect()
}

/// Each vertex, and a point of each edge.
fn targets(mesh: &[Triangle], rng: &mut Rng) -> Vec<[f32; 3]> {
    let mut unique = HashMap::new();
    for [a, b, c] in mesh {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let f = rng.signed().abs();
            let on_edge: [f32; 3] = std::array::from_fn(|k| p[k] + f * (q[k] - p[k]));
            unique.insert(p.map(f32::to_bits), *p);
            unique.insert(on_edge.map(f32::to_bits), on_edge);
        }
    }
    unique.into_values().collect()
}

/// Rays from inside a closed mesh that hit nothing.
fn leaks<K: Kernel>(mesh: &[Triangle], center: [f32; 3], inner: f32, rng: &mut Rng) -> u32 {
    let mut leaks = 0;
    for target in targets(mesh, rng) {
        let stray = rng.vector(inner);
        let origin = if rng.below(3) == 0 { center } else { std::array::from_fn(|k| center[k] + stray[k]) };
        let ray = ScaledRay::new(&Ray::new(origin, sub(target, origin))).unwrap();
        leaks += u32::from(!mesh.iter().any(|triangle| hit::<K>(&ray, triangle).is_some()));
    }
    leaks
}

#[test]
fn closed_meshes_do_not_leak() {
    let mut rng = Rng(30);
    let meshes: [([f32; 3], [f32; 3]); 5] = [
        ([1.0; 3], [0.0; 3]),
        ([1.0, 1e-3, 30.0], [0.0; 3]),
        ([100.0; 3], [1e7, -1e7, 3e6]),
        ([1e-20; 3], [0.0; 3]),
        ([1e15; 3], [0.0; 3]),
    ];
    for (scale, around) in meshes {
        let mesh = octasphere(3, scale, around);
        let inner = 0.2 * scale.into_iter().fold(f32::INFINITY, f32::min);
        for _ in 0..2 {
            assert_eq!(leaks::<Watertight>(&mesh, around, inner, &mut rng), 0, "{scale:?} at {around:?}");
        }
    }
}

#[test]
fn cracked_meshes_leak() {
    let mut rng = Rng(31);
    let center = [0.3, 0.1, 0.2];
    // Neighbors no longer share vertices: each triangle shrinks towards its centroid.
    let cracked: Vec<Triangle> = octasphere(4, [1.0; 3], center)
        .into_iter()
        .map(|[a, b, c]| {
            let middle: [f32; 3] = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
            [a, b, c].map(|p| std::array::from_fn(|k| p[k] + 1e-4 * (middle[k] - p[k])))
        })
        .collect();
    for leaks in [leaks::<Watertight>, leaks::<MollerTrumbore>, leaks::<BaldwinWeber>, leaks::<Projected>] {
        assert!(leaks(&cracked, center, 0.2, &mut rng) > 0, "the oracle sees no leak where some must be");
    }
}

#[test]
fn fans_are_hit_at_their_center() {
    let mut rng = Rng(32);
    for _ in 0..300 {
        let n = 3 + rng.below(12);
        let (hub, frame) = (rng.vector(3.0), rng.frame());
        let rim: Vec<[f32; 3]> = (0..n)
            .map(|i| {
                let angle = std::f32::consts::TAU * i as f32 / n as f32;
                let (x, y, z) = (angle.cos(), angle.sin(), 0.3 * rng.signed());
                std::array::from_fn(|k| hub[k] + x * frame[0][k] + y * frame[1][k] + z * frame[2][k])
            })
            .collect();
        let fan: Vec<Triangle> = (0..n).map(|i| [hub, rim[i], rim[(i + 1) % n]]).collect();
        let slant = rng.vector(0.3);
        let origin: [f32; 3] = std::array::from_fn(|k| hub[k] + 3.0 * frame[2][k] + slant[k]);
        let ray = ScaledRay::new(&Ray::new(origin, sub(hub, origin))).unwrap();
        assert!(fan.iter().any(|triangle| hit::<Watertight>(&ray, triangle).is_some()), "{fan:?}");
    }
}

/// The exact result for the rounded input of the kernel.
#[test]
fn distance_is_exact_for_the_sheared_triangle() {
    let mut rng = Rng(33);
    let mut n_hits = 0;
    for i in 0..4000 {
        let setting = SETTINGS[i % SETTINGS.len()];
        let triangle = rng.triangle(setting.around, setting.size);
        let ray = ray_at(&mut rng, &triangle, setting.distance);
        let shear = Watertight::prepare(&ray);
        let [s_x, s_y] = shear.factors();
        let [_, _, d_z] = shear.axis().permute(ray.direction);
        let sheared = triangle.map(|v| {
            let [x, y, z] = shear.axis().permute(sub(v, ray.origin));
            [x - s_x * z, y - s_y * z, z]
        });
        // Along +z from the origin of sheared space, with the distance along it in units of d_z.
        let straight = ScaledRay::new(&Ray::new([0.0; 3], [0.0, 0.0, 1.0])).unwrap();
        let (det, u, v, t) = inputs::triangle(&straight, &sheared);
        let inside = !det.is_zero() && !u.is_negative() && !v.is_negative() && u.clone() + &v <= det;
        let found = hit::<Watertight>(&ray, &triangle);
        if !inside {
            assert_eq!(found, None);
            continue;
        }
        let t = t / det.clone() / q(d_z);
        // Ten f64 roundings of terms whose coefficients sum to one, then one rounding to f32.
        let depth = sheared.iter().map(|v| q(v[2].abs())).max().unwrap() / q(d_z.abs());
        let in_f64 = q(10.0 * UNIT_ROUNDOFF_F64) * depth;
        match found {
            None => assert!(t < in_f64, "{t} is lost"),
            Some(found) => {
                let bound = in_f64 + q(UNIT_ROUNDOFF) * t.abs() + q(f32::from_bits(1));
                assert!((q(found.t) - t).abs() <= bound);
                assert!((q(found.u) - u / &det).abs() <= q(2.0 * UNIT_ROUNDOFF));
                assert!((q(found.v) - v / &det).abs() <= q(2.0 * UNIT_ROUNDOFF));
                n_hits += 1;
            }
        }
    }
    assert!(n_hits > 1000, "{n_hits}");
}

/// In the plane of a face, edge functions that round to one sign would "hit" triangles far away.
#[test]
fn grazing_rays_hit_only_what_they_touch() {
    let mut rng = Rng(34);
    let mut n_in_plane = 0;
    for _ in 0..20_000 {
        let triangle: Triangle = std::array::from_fn(|_| rng.vector(1.0));
        let [a, b, c] = triangle;
        let weight = rng.signed();
        let along: [f32; 3] = std::array::from_fn(|k| (b[k] - a[k]) + weight * (c[k] - a[k]));
        // Next to the triangle, in its plane, parallel to it or nearly.
        let origin: [f32; 3] = std::array::from_fn(|k| a[k] + 10.0 * (c[k] - a[k]) - 10.0 * along[k]);
        let normal = cross(sub(b, a), sub(c, a));
        let ray = ScaledRay::new(&Ray::new(origin, along)).unwrap();
        n_in_plane += u32::from(dot(normal, along).abs() < 1e-6);
        if let Some(found) = hit::<Watertight>(&ray, &triangle) {
            let bound = q(20.0 * UNIT_ROUNDOFF) * q(40.0);
            let point = inputs::at(&ray, &q(found.t));
            let near = (0..3).all(|k| {
                let (lo, hi) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
                q(lo) - &bound <= point[k] && point[k] <= q(hi) + &bound
            });
            assert!(near, "{found:?} of {triangle:?}");
        }
    }
    assert!(n_in_plane > 10_000, "{n_in_plane}");
}

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

fn unit_f32(v: [f32; 3]) -> [f32; 3] {
    v.map(|x| x / dot(v, v).sqrt())
}

/// A ribbon of so many ulps of its greatest distance from the ray's origin, of length 1 and in six triangles, and a ray at its
/// center line from a distance of 1 to 4.
fn ribbon_and_ray(rng: &mut Rng, n_ulps: f32) -> (Vec<Triangle>, ScaledRay) {
    let origin = rng.vector(1.0);
    let toward = unit_f32(rng.vector(1.0));
    let distance = 1.0 + 3.0 * rng.signed().abs();
    let center: [f32; 3] = std::array::from_fn(|k| origin[k] + distance * toward[k]);
    let across = unit_f32(cross(toward, rng.vector(1.0)));
    let along = unit_f32(std::array::from_fn(|k| cross(across, toward)[k] + 0.5 * rng.signed() * toward[k]));
    let half_width = 0.5 * n_ulps * 2.0 * UNIT_ROUNDOFF * (distance + 0.5);
    let at = |along_by: f32, across_by: f32| -> [f32; 3] {
        std::array::from_fn(|k| center[k] + along_by * along[k] + across_by * half_width * across[k])
    };
    let stations = [-0.5, -0.2, 0.1, 0.5];
    let triangles = stations.windows(2).flat_map(|pair| {
        let [a, b, c, d] = [at(pair[0], -1.0), at(pair[1], -1.0), at(pair[1], 1.0), at(pair[0], 1.0)];
        [[a, b, c], [a, c, d]]
    });
    let target = at(0.45 * rng.signed(), 0.0);
    let ray = ScaledRay::new(&Ray::new(origin, sub(target, origin))).expect("a direction");
    (triangles.collect(), ray)
}

/// Rays, of 20,000, that miss the ribbon at which they aim.
fn n_missed(n_ulps: f32) -> usize {
    let mut rng = Rng(77);
    let misses = (0..20_000).filter(|_| {
        let (ribbon, ray) = ribbon_and_ray(&mut rng, n_ulps);
        !ribbon.iter().any(|triangle| hit::<Watertight>(&ray, triangle).is_some())
    });
    misses.count()
}

#[test]
fn isolated_ribbons_of_64_ulps_are_hit() {
    assert_eq!(n_missed(64.0), 0);
}

/// The limit is real: rays pass beside ribbons of one ulp, whose vertices are rounded to either side of them.
#[test]
fn narrower_ribbons_may_be_missed() {
    assert!(n_missed(1.0) > 100);
}
