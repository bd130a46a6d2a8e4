//! Rays that continue from hits: no ray hits the surface that it leaves, and no other surface is skipped.
//!
//! Every ray is tested against every triangle of its mesh. Not covered: BVHs, which report the same hits.

use canted_obb::{
    Aabb, Affine, PrimId,
    vector::{Vector, add, cross, dot, length, scale, sub, to_f32, to_f64},
};
use canted_trace::{
    BaldwinWeber, Hit, InstanceId, Kernel, MollerTrumbore, Projected, Ray, Side, SurfacePoint, Watertight,
};

use crate::{
    inputs::Triangle,
    watertight::{Random, closest_hit, needles, sphere, torus},
};

/// Rays at random points of random triangles from random sides, and their hits.
fn hits<K: Kernel>(mesh: &[Triangle], n: u32, mut check: impl FnMut(&mut Random, &Ray, Hit)) {
    let (mut random, bounds) = (Random(1), bounds(mesh));
    let size = length(bounds.extent());
    let mut n_hits = 0;
    for i in 0..n {
        let corners = mesh[i as usize * mesh.len() / n as usize].map(to_f64);
        let (u, v) = (random.signed().abs(), random.signed().abs());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let target = add(corners[0], add(scale(sub(corners[1], corners[0]), u), scale(sub(corners[2], corners[0]), v)));
        let origin = to_f32(add(target, scale(random.direction(), 2.0 * size)));
        let ray = Ray::new(origin, to_f32(sub(target, to_f64(origin))));
        if let Some(hit) = closest_hit::<K>(mesh, &ray) {
            n_hits += 1;
            check(&mut random, &ray, hit);
        }
    }
    assert!(2 * n_hits > n, "{n_hits} of {n} rays hit");
}

fn bounds(mesh: &[Triangle]) -> Aabb {
    Aabb::from_points(mesh.iter().flatten().copied())
}

fn surface_point(mesh: &[Triangle], hit: &Hit) -> SurfacePoint {
    SurfacePoint::new(hit, mesh[hit.primitive.index()], bounds(mesh).reach())
}

/// A random direction into the half space of `normal`, often close to its plane.
fn above(random: &mut Random, normal: Vector) -> [f32; 3] {
    let direction = random.direction();
    let height = dot(direction, normal);
    let flattened = sub(direction, scale(normal, height));
    // Steep enough that rounding the direction does not take it to the other side.
    let slope = if random.signed() > 0.0 { height.abs() } else { 1e-6 };
    to_f32(add(flattened, scale(normal, slope)))
}

/// Placements: at the origin, far off, tiny, huge, and where the spacing of coordinates is a hundredth of the mesh.
const PLACES: [(Vector, f64); 6] = [
    ([0.0; 3], 1.0),
    ([1000.0, -700.0, 400.0], 1.0),
    ([0.0, 3.0, 0.0], 1e-3),
    ([0.0; 3], 1e-20),
    ([2e15, 0.0, 0.0], 1e15),
    ([1e7, -1e7, 3e6], 100.0),
];

fn leaves_convex_bodies<K: Kernel>() {
    for (center, size) in PLACES {
        let mesh = sphere(center, size);
        hits::<K>(&mesh, 400, |random, _, hit| {
            let point = surface_point(&mesh, &hit);
            // Outward even where rounded coordinates make the body slightly concave: along the normal's half space only.
            let outward = if dot(point.normal, sub(point.position, center)) > 0.0 { 1.0 } else { -1.0 };
            let ray = point.spawn_ray(above(random, scale(point.normal, outward)));
            let again = closest_hit::<K>(&mesh, &ray).filter(|again| again.primitive == hit.primitive);
            assert_eq!(again, None, "{center:?} {size}");
        });
    }
}

#[test]
fn no_kernel_hits_the_triangle_that_a_ray_leaves() {
    leaves_convex_bodies::<Watertight>();
    leaves_convex_bodies::<MollerTrumbore>();
    leaves_convex_bodies::<BaldwinWeber>();
    leaves_convex_bodies::<Projected>();
}

#[test]
fn outward_rays_leave_a_convex_body() {
    for (center, size) in &PLACES[..5] {
        let mesh = sphere(*center, *size);
        hits::<Watertight>(&mesh, 1000, |random, _, hit| {
            let point = surface_point(&mesh, &hit);
            let side = if hit.side == Side::Front { 1.0 } else { -1.0 };
            let ray = point.spawn_ray(above(random, scale(point.normal, side)));
            assert_eq!(closest_hit::<Watertight>(&mesh, &ray), None, "{center:?} {size}");
        });
    }
}

#[test]
fn rays_from_needles_do_not_hit_them_again() {
    let mut n = 0;
    for (center, size) in PLACES {
        let mesh = needles(center, size);
        for (i, needle) in (0..).zip(&mesh) {
            let hit = Hit { t: 1.0, u: 0.3, v: 0.2, primitive: PrimId(i), instance: InstanceId(0), side: Side::Front };
            let point = surface_point(&mesh, &hit);
            let [a, b, c] = needle.map(to_f64);
            if cross(sub(b, a), sub(c, a)) == [0.0; 3] {
                continue;
            }
            n += 1;
            let mut random = Random(u64::from(i));
            for side in [1.0, -1.0] {
                let ray = point.spawn_ray(above(&mut random, scale(point.normal, side)));
                for hit in
                    [closest_hit::<Watertight>(&[*needle], &ray), closest_hit::<MollerTrumbore>(&[*needle], &ray)]
                {
                    assert_eq!(hit, None, "{center:?} {size}");
                }
            }
        }
    }
    assert!(n > 1000, "{n} needles have an area");
}

/// Sabotage: a ray from the rounded hit point itself often hits its triangle again.
#[test]
fn rays_without_the_offset_hit_their_triangle_again() {
    let mesh = torus([100.0, 20.0, 3.0], 1.0);
    let (mut n, mut n_again) = (0, 0);
    hits::<Watertight>(&mesh, 1000, |_, ray, hit| {
        let (point, naive) = (surface_point(&mesh, &hit), to_f32(ray.at(f64::from(hit.t))));
        let side = if hit.side == Side::Front { 1.0 } else { -1.0 };
        let direction = to_f32(scale(point.normal, side));
        let is_own = |ray: &Ray| closest_hit::<Watertight>(&mesh, ray).is_some_and(|h| h.primitive == hit.primitive);
        n += 1;
        n_again += u32::from(is_own(&Ray::new(naive, direction)));
        assert!(!is_own(&point.spawn_ray(direction)));
    });
    assert!(4 * n_again > n, "{n_again} of {n}");
}

/// Distance, height over the plane, and least barycentric coordinate of the crossing of a line with a triangle, in `f64`.
fn crossing(from: Vector, direction: Vector, triangle: &Triangle) -> Option<(f64, f64, f64)> {
    let [a, b, c] = triangle.map(to_f64);
    let (e1, e2) = (sub(b, a), sub(c, a));
    let normal = cross(e1, e2);
    let height = dot(normal, sub(from, a)) / length(normal);
    let t = -dot(normal, sub(from, a)) / dot(normal, direction);
    let p = sub(add(from, scale(direction, t)), a);
    let area = dot(normal, normal);
    let (u, v) = (dot(cross(p, e2), normal) / area, dot(cross(e1, p), normal) / area);
    (t > 0.0).then_some((t, height.abs(), u.min(v).min(1.0 - u - v)))
}

#[test]
fn no_triangle_farther_than_the_offset_is_skipped() {
    let mut n_expected = 0;
    for (center, size) in &PLACES[..5] {
        let mesh = torus(*center, *size);
        hits::<Watertight>(&mesh, 600, |random, _, hit| {
            let point = surface_point(&mesh, &hit);
            let direction = to_f32(random.direction());
            let found = closest_hit::<Watertight>(&mesh, &point.spawn_ray(direction));
            for (i, triangle) in (0..).zip(&mesh) {
                let Some((t, height, inside)) = crossing(point.position, to_f64(direction), triangle) else { continue };
                // A shift by the offset, twice with roundings, must not leave the triangle, nor cross its plane.
                let shift = 4.0 * point.offset;
                let edge = length(sub(to_f64(triangle[1]), to_f64(triangle[0])));
                if i != hit.primitive.0 && height > shift && inside > 0.05 + shift * t / (height * edge) {
                    n_expected += 1;
                    let found = found.expect("a triangle in front is hit");
                    assert!(f64::from(found.t) <= t * (1.0 + shift / height), "{center:?} {size}");
                }
            }
        });
    }
    assert!(n_expected > 500, "{n_expected}");
}

/// Maps that rotate, mirror, shear, stretch and move far away.
fn maps() -> Vec<Affine> {
    let columns = [[0.36, 0.48, -0.8], [0.8, -0.6, 0.1], [0.0, 0.3, 2.0]];
    let mut maps = vec![Affine::IDENTITY];
    for (stretch, shift, mirror) in [(1.0f32, 1e4, 1.0), (1e-3, 10.0, -1.0), (1e3, 1e6, 1.0), (50.0, 1e7, -1.0)] {
        let [x, y, z] = columns.map(|c: [f32; 3]| c.map(|c| c * stretch));
        maps.push(Affine { columns: [x.map(|c| c * mirror), y, z, [shift, 0.3 * shift, -0.7 * shift]] });
    }
    maps
}

/// The ray in object space, as a two-level BVH rounds it.
fn to_object(ray: &Ray, world_from_object: &Affine) -> Ray {
    let [x, y, z, shift] = world_from_object.columns.map(to_f64);
    let determinant = world_from_object.determinant();
    let rows = [cross(y, z), cross(z, x), cross(x, y)];
    let linear = |v: Vector| to_f32(rows.map(|row| dot(row, v) / determinant));
    Ray { origin: linear(sub(to_f64(ray.origin), shift)), direction: linear(to_f64(ray.direction)), ..*ray }
}

#[test]
fn rays_leave_instances_with_one_level_and_with_two() {
    let mesh = sphere([0.2, -0.1, 0.3], 1.0);
    let reach = bounds(&mesh).reach();
    for map in maps() {
        let world: Vec<Triangle> = mesh.iter().map(|triangle| triangle.map(|p| map.point(p))).collect();
        let center = map.point_f64([0.2, -0.1, 0.3].map(|x: f32| f64::from(x)));
        hits::<Watertight>(&mesh, 500, |random, ray, hit| {
            let point = SurfacePoint::in_instance(&hit, mesh[hit.primitive.index()], reach, &map);
            // The normal keeps to the front side, mirrored or not.
            let towards = map.vector_f64(to_f64(ray.direction));
            assert_eq!(hit.side == Side::Front, dot(point.normal, towards) <= 0.0, "{map:?}");
            let side = dot(point.normal, sub(point.position, center)).signum();
            let ray = point.spawn_ray(above(random, scale(point.normal, side)));
            assert_eq!(closest_hit::<Watertight>(&mesh, &to_object(&ray, &map)), None, "two levels, {map:?}");
            // Vertices rounded to world space may leave a dent between neighbors, but never before the own plane.
            let again = closest_hit::<Watertight>(&world, &ray).filter(|again| again.primitive == hit.primitive);
            assert_eq!(again, None, "one level, {map:?}");
        });
    }
}

#[test]
fn shadow_rays_between_two_points_see_each_other() {
    let (floor, wall) = (sphere([0.0; 3], 1.0), sphere([1e5, 0.0, 0.0], 1e4));
    let mut points = vec![];
    for mesh in [&floor, &wall] {
        hits::<Watertight>(mesh, 100, |_, _, hit| points.push(surface_point(mesh, &hit)));
    }
    let both: Vec<Triangle> = [floor, wall].concat();
    let is_facing = |a: &SurfacePoint, b: &SurfacePoint| {
        let center = if b.position[0] < 10.0 { [0.0; 3] } else { [1e5, 0.0, 0.0] };
        let outward = scale(b.normal, dot(b.normal, sub(b.position, center)).signum());
        dot(outward, sub(a.position, b.position)) > 1e-3 * length(sub(a.position, b.position))
    };
    let mut n = 0;
    for a in points.iter().filter(|a| a.position[0] < 10.0) {
        for b in points.iter().filter(|b| b.position[0] > 10.0).step_by(7) {
            if is_facing(a, b) && is_facing(b, a) {
                n += 1;
                let ray = a.spawn_ray_to_point(b).expect("far apart");
                assert_eq!(closest_hit::<Watertight>(&both, &ray), None);
                assert!(ray.t_max < 1.0 && ray.t_max > 0.999);
            }
        }
    }
    assert!(n > 50, "{n}");
    // To itself nothing is left of the ray.
    assert!(points[0].spawn_ray_to(to_f32(points[0].position)).is_none_or(|ray| ray.t_max < 0.1));
}
