use std::collections::HashMap;

use num_traits::{Signed, Zero};

use crate::exact::{self, q};
use crate::inputs::{Rng, SETTINGS, Triangle, ray_at};
use crate::kernels::hit;
use canted_trace::lanes::UNIT_ROUNDOFF;

use crate::exact::UNIT_ROUNDOFF_F64;
use canted_obb::vector::{cross, dot, sub};
use canted_trace::{BaldwinWeber, Kernel, MollerTrumbore, Ray, ScaledRay, Watertight};

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
    for leaks in [leaks::<Watertight>, leaks::<MollerTrumbore>, leaks::<BaldwinWeber>] {
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
        let (det, u, v, t) = exact::triangle(&straight, &sheared);
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
            let point = exact::at(&ray, &q(found.t));
            let near = (0..3).all(|k| {
                let (lo, hi) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
                q(lo) - &bound <= point[k] && point[k] <= q(hi) + &bound
            });
            assert!(near, "{found:?} of {triangle:?}");
        }
    }
    assert!(n_in_plane > 10_000, "{n_in_plane}");
}
