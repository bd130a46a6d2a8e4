//! Hit positions compared with exact geometry within derived bounds: all triangles in world space, in `f64`.

use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::{
    Affine,
    vector::{Vector, cross, dot, length, sub},
};
use canted_tests::{
    brute::{self, distance},
    exact,
};
use canted_tlas::{Tlas, TopConfig};
use canted_trace::{Hit, Intersect, Ray};

use super::setup::{all_rays, binary_top, blas_of, build, crowd, instances, meshes, rays, transforms};

/// A triangle in world space with the error bound of its hits.
struct Target {
    corners: [Vector; 3],
    /// Along each axis.
    error: f64,
}

/// Length bound of a vector with components of at most one.
const SQRT_3: f64 = 1.732_050_81;

/// The parameter at which the ray certainly hits the target, and by how much the reported one may exceed it.
///
/// Seen along the ray, a vertex moved by `error` along each axis moves by at most `2·error` on both axes of the projection,
/// because sheared coordinates are differences of two; so the ray misses an edge with certainty if it is farther away than √2
/// times that. The reported point lies within `√3·error` of the plane, so `t` differs by at most that divided by the ray's
/// speed towards the plane.
fn certainly_pierced(ray: &Ray, target: &Target) -> Option<(f64, f64)> {
    let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
    let z = (0..3).fold(0, |best, k| if d[k].abs() > d[best].abs() { k } else { best });
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let seen = target.corners.map(|corner| {
        let a = sub(corner, o);
        [a[x] - d[x] / d[z] * a[z], a[y] - d[y] / d[z] * a[z]]
    });
    let sides = [0, 1, 2].map(|i| {
        let (p, q) = (seen[i], seen[(i + 1) % 3]);
        (p[0] * q[1] - p[1] * q[0]) / (q[0] - p[0]).hypot(q[1] - p[1])
    });
    let margin = 2.0 * std::f64::consts::SQRT_2 * target.error;
    if !(sides.iter().all(|&s| s > margin) || sides.iter().all(|&s| s < -margin)) {
        return None;
    }
    let [a, b, c] = target.corners;
    let normal = cross(sub(b, a), sub(c, a));
    let t = dot(normal, sub(a, o)) / dot(normal, d);
    let slack = SQRT_3 * target.error * length(normal) / dot(normal, d).abs();
    (t - slack > f64::from(ray.t_min) && t + slack < f64::from(ray.t_max)).then_some((t, slack))
}

/// Compares an answer with all triangles of all instances; returns the number of certain hits.
pub(crate) fn check_hit(ray: &Ray, hit: Option<&Hit>, placed: &[Affine], reaches: [f32; 2]) -> Result<usize, String> {
    let meshes = meshes();
    let target = |i: usize, triangle: usize| {
        let corners = meshes[blas_of(i)].corners(triangle).map(|p| placed[i].point_f64(p));
        // A thousandth covers the rounding of the f64 computations here.
        Target { corners, error: 1.001 * brute::hit_error(&placed[i], reaches[blas_of(i)], ray) }
    };
    if let Some(hit) = hit {
        let Target { corners, error } = target(hit.instance.0 as usize, hit.primitive.index());
        let off = distance(ray.at(f64::from(hit.t)), corners);
        if off > SQRT_3 * error {
            return Err(format!("{ray:?}: {hit:?} lies {off:e} off its triangle, {error:e} is allowed"));
        }
    }
    let mut n_certain = 0;
    for i in 0..placed.len() {
        for triangle in 0..meshes[blas_of(i)].triangles.len() {
            let Some((t, slack)) = certainly_pierced(ray, &target(i, triangle)) else { continue };
            n_certain += 1;
            if hit.is_none_or(|hit| f64::from(hit.t) > t + slack + f64::from(hit.t) * f64::from(f32::EPSILON)) {
                return Err(format!("{ray:?} pierces triangle {triangle} of instance {i} at {t}, not {hit:?}"));
            }
        }
    }
    Ok(n_certain)
}

pub(crate) fn reaches() -> [f32; 2] {
    meshes().map(|mesh| mesh.positions.iter().flatten().fold(0.0, |all: f32, x| all.max(x.abs())))
}

/// Each transform alone, with each of the two meshes.
#[test]
fn hits_lie_on_the_images_of_triangles_and_none_is_nearer() {
    for (name, affine) in transforms() {
        let placed = [affine, affine];
        let [soup, torus] = meshes();
        let bottom = vec![build(&soup, Strategy::Dop), build(&torus, Strategy::Quaternion)];
        let tlas = Tlas::new(bottom, &instances(&placed), TopConfig::default()).unwrap();
        let mut n_certain = 0;
        for ray in rays(&soup, &affine, 60, 9).iter().chain(&rays(&torus, &affine, 60, 10)) {
            let hit = tlas.closest_hit(ray);
            n_certain +=
                check_hit(ray, hit.as_ref(), &placed, reaches()).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
        // Far away, a small instance is no larger than the error of its hits.
        let from_itself = Ray::new(affine.columns[3], [1.0, 0.0, 0.0]);
        let size = length(sub(affine.point_f64([1.0; 3]), affine.point_f64([0.0; 3])));
        let is_blurred = brute::hit_error(&affine, 1.0, &from_itself) > 0.02 * size;
        assert_eq!(n_certain > 100, !is_blurred, "{name}: {n_certain} certain crossings");
    }
}

#[test]
fn a_crowd_of_instances_agrees_with_exact_geometry() {
    let placed = crowd();
    let [soup, torus] = meshes();
    let bottom = vec![build(&soup, Strategy::Aabb), build(&torus, Strategy::Dop)];
    let top = binary_top(VolumeConfig { strategy: Strategy::Combined, fallback: true });
    let tlas = Tlas::new(bottom, &instances(&placed), top).unwrap();
    let n_certain: usize = all_rays(&placed, 4)
        .iter()
        .map(|ray| check_hit(ray, tlas.closest_hit(ray).as_ref(), &placed, reaches()).unwrap())
        .sum();
    assert!(n_certain > 1000, "{n_certain} certain crossings");
}

#[test]
fn the_check_detects_displaced_late_and_lost_hits() {
    let placed = [transforms()[1].1; 2];
    let [soup, torus] = meshes();
    let bottom = vec![build(&soup, Strategy::Dop), build(&torus, Strategy::Dop)];
    let tlas = Tlas::new(bottom, &instances(&placed), TopConfig::default()).unwrap();
    let (mut n_lost, mut n_off) = (0, 0);
    for ray in rays(&torus, &placed[1], 40, 3) {
        let Some(hit) = tlas.closest_hit(&ray) else { continue };
        n_lost += usize::from(check_hit(&ray, None, &placed, reaches()).is_err());
        // Later by a ten-thousandth: far beyond rounding, unless the ray hardly moves.
        let late = Hit { t: hit.t * 1.0001, ..hit };
        n_off += usize::from(check_hit(&ray, Some(&late), &placed, reaches()).is_err());
    }
    assert!(n_lost > 50 && n_off > 50, "{n_lost} lost and {n_off} late hits were seen");
}

#[test]
fn object_space_rays_are_rounded_once() {
    // Only the rounding to f32, and 2^-46 of the operands of a cancellation.
    const SLACK_BITS: u32 = 46;
    for (name, affine) in transforms() {
        let mesh = &meshes()[0];
        for ray in rays(mesh, &affine, 20, 77) {
            let object = brute::ray_object(&affine, &ray);
            let mut linear = affine;
            linear.columns[3] = [0.0; 3];
            let size = |matrix: &Affine, v: [f32; 3]| {
                let greatest = matrix.columns[3].iter().chain(&v).fold(0.0, |all: f32, x| all.max(x.abs()));
                let backward = brute::object_from_world(matrix)
                    .iter()
                    .flat_map(|row| row[..3].to_vec())
                    .fold(0.0, |all: f64, x| all.max(x.abs()));

                (6.0 * backward) as f32 * greatest
            };
            let is_image =
                |matrix: &Affine, from, to| exact::is_inverse_image(matrix, from, to, size(matrix, from), SLACK_BITS);
            assert!(is_image(&affine, ray.origin, object.origin), "{name}: {ray:?} -> {object:?}");
            assert!(is_image(&linear, ray.direction, object.direction), "{name}: {ray:?} -> {object:?}");
            let off = object.origin.map(|x| x * (1.0 + 2.0 * f32::EPSILON));
            assert!(object.origin == [0.0; 3] || !is_image(&affine, ray.origin, off), "{name}: {off:?} passes too");
        }
    }
}

#[test]
fn root_boxes_contain_the_images_of_all_vertices() {
    let [soup, torus] = meshes();
    for (name, affine) in transforms() {
        for strategy in Strategy::ALL {
            for mesh in [&soup, &torus] {
                let image = build(mesh, strategy).bounds().transformed(&affine).aabb();
                for p in mesh.positions.iter().map(|p| affine.point_f64(p.map(f64::from))) {
                    let inside = (0..3).all(|k| f64::from(image.min[k]) <= p[k] && p[k] <= f64::from(image.max[k]));
                    assert!(inside, "{name}, {strategy:?}: {p:?} outside {image:?}");
                }
            }
        }
    }
}
