//! Spheres that move, compared with a bisection of distances.

use canted_collide::{SphereContact, cast_sphere};
use canted_obb::PrimId;
use canted_trace::{Ray, Side, closest_to_zero};
use canted_wide::Preset;

use crate::common::{Random, Triangle, bvh, config_of, configs, mapped, needles, soup};

/// The distance of a triangle from the center at `t`.
fn distance_at(triangle: &Triangle, ray: &Ray, t: f64) -> f64 {
    let center = ray.at(t);
    closest_to_zero(&triangle.map(|vertex| std::array::from_fn(|k| f64::from(vertex[k]) - center[k])))
        .distance_squared
        .sqrt()
}

/// When a sphere first touches a triangle. The distance of a convex set is convex along a line: it falls to its least, then grows.
fn truth(triangle: &Triangle, ray: &Ray, radius: f64) -> Option<f64> {
    let (start, end) = (f64::from(ray.t_min), f64::from(ray.t_max));
    if distance_at(triangle, ray, start) <= radius {
        return Some(start);
    }
    let (mut low, mut high) = (start, end);
    for _ in 0..200 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if distance_at(triangle, ray, a) <= distance_at(triangle, ray, b) { high = b } else { low = a }
    }
    let (mut outside, mut inside) = (start, low);
    if distance_at(triangle, ray, inside) > radius {
        return None;
    }
    for _ in 0..200 {
        let middle = outside + (inside - outside) / 2.0;
        if distance_at(triangle, ray, middle) <= radius { inside = middle } else { outside = middle }
    }
    Some(inside)
}

/// The center at contact is as far from the triangle as the radius, and no triangle is touched before.
fn check(name: &str, triangles: &[Triangle], rays: &[Ray], radius: f64) {
    let size = triangles.iter().flatten().flatten().fold(0.0_f64, |most, x| most.max(f64::from(x.abs())));
    let mut n_hits = 0;
    for config in configs() {
        let bvh = bvh(triangles, config);
        for (i, ray) in rays.iter().enumerate() {
            let found = cast_sphere(&bvh, ray, radius);
            let first = triangles.iter().filter_map(|t| truth(t, ray, radius)).min_by(f64::total_cmp);
            match (found, first) {
                (Some(contact), Some(first)) => {
                    n_hits += 1;
                    let triangle = &triangles[contact.primitive.index()];
                    let distance = distance_at(triangle, ray, contact.t);
                    if contact.starts_inside {
                        assert!(contact.t == f64::from(ray.t_min) && distance <= radius, "{name}, ray {i}");
                    } else {
                        assert!(
                            (distance - radius).abs() <= 1e-12 * (size + radius),
                            "{name}, ray {i}: {distance} and {radius}"
                        );
                    }
                    // A root is as uncertain as the grazing of the sphere makes it: compare distances, not times.
                    let before = contact.t - 1e-4;
                    assert!(first >= before && contact.t <= first + 1e-4, "{name}, ray {i}: {} and {first}", contact.t);
                    let early = f64::from(ray.t_min).max(contact.t - 1e-6);
                    let nearest = triangles.iter().map(|t| distance_at(t, ray, early)).fold(f64::INFINITY, f64::min);
                    assert!(
                        contact.starts_inside || nearest >= radius - 1e-12 * (size + radius),
                        "{name}, ray {i}: touched before"
                    );
                }
                (None, None) => {}
                (found, first) => panic!("{name}, ray {i}: {found:?} but {first:?}"),
            }
        }
    }
    assert!(n_hits > rays.len() / 4, "{name}: {n_hits} hits");
}

fn rays(n: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    let ray = |random: &mut Random| {
        let (origin, target) = (random.near([0.5; 3], 2.0), random.point());
        Ray::new(origin, std::array::from_fn(|k| target[k] - origin[k])).between(0.0, 3.0)
    };
    (0..n).map(|_| ray(&mut random)).collect()
}

#[test]
fn first_contacts_are_those_of_a_loop() {
    for radius in [0.01, 0.1, 0.7] {
        check("soup", &soup(40, 0.1, 30), &rays(60, 31), radius);
        check("needles", &needles(40, 32), &rays(60, 33), radius);
    }
    let far = mapped(&soup(40, 0.1, 34), |p| p.map(|x| 100.0 * x + 1e5));
    let moved: Vec<Ray> = rays(60, 35)
        .iter()
        .map(|ray| Ray {
            origin: ray.origin.map(|x| 100.0 * x + 1e5),
            direction: ray.direction.map(|x| 100.0 * x),
            ..*ray
        })
        .collect();
    check("far", &far, &moved, 5.0);
}

const BASE: Triangle = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

fn on_base(origin: [f32; 3], direction: [f32; 3], radius: f64) -> Option<SphereContact> {
    cast_sphere(&bvh(&[BASE], config_of(Preset::Balanced)), &Ray::new(origin, direction), radius)
}

/// Right values from a drawing.
#[test]
fn faces_edges_and_vertices() {
    let face = on_base([1.0, 1.0, 5.0], [0.0, 0.0, -2.0], 1.0).expect("onto the face");
    assert_eq!((face.t, face.position, face.normal, face.side), (2.0, [1.0, 1.0, 0.0], [0.0, 0.0, 1.0], Side::Front));
    let below = on_base([1.0, 1.0, -5.0], [0.0, 0.0, 1.0], 1.0).expect("from below");
    assert_eq!((below.t, below.normal, below.side), (4.0, [0.0, 0.0, -1.0], Side::Back));
    let edge = on_base([2.0, -5.0, 0.0], [0.0, 1.0, 0.0], 1.0).expect("onto an edge, in the plane");
    assert_eq!((edge.t, edge.position, edge.normal), (4.0, [2.0, 0.0, 0.0], [0.0, -1.0, 0.0]));
    let vertex = on_base([9.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 1.0).expect("onto a vertex");
    assert_eq!((vertex.t, vertex.position, vertex.uv), (4.0, [4.0, 0.0, 0.0], [1.0, 0.0]));
    // Past the edge by exactly the radius: it touches.
    let grazing = on_base([-3.0, -1.0, 0.0], [1.0, 0.0, 0.0], 1.0).expect("grazes an edge");
    assert_eq!(grazing.t, 3.0);
    assert_eq!(on_base([-3.0, -1.001, 0.0], [1.0, 0.0, 0.0], 1.0), None);
    assert_eq!(on_base([1.0, 1.0, 5.0], [0.0, 0.0, 1.0], 1.0), None);
}

#[test]
fn starts_and_ends() {
    let inside = on_base([1.0, 1.0, 0.5], [0.0, 0.0, 1.0], 1.0).expect("overlaps at the start");
    assert!(inside.starts_inside && inside.t == 0.0 && inside.normal == [0.0, 0.0, 1.0]);
    let on_it = on_base([1.0, 1.0, 0.0], [0.0, 0.0, 1.0], 1.0).expect("the center is on the triangle");
    assert_eq!((on_it.t, on_it.normal), (0.0, [0.0, 0.0, 1.0]));
    let touching = on_base([1.0, 1.0, 1.0], [0.0, 0.0, -1.0], 1.0).expect("touches at the start");
    assert!(touching.starts_inside && touching.t == 0.0);
    let resting = on_base([1.0, 1.0, 0.5], [0.0; 3], 1.0).expect("a sphere at rest");
    assert!(resting.starts_inside);
    assert_eq!(on_base([1.0, 1.0, 5.0], [0.0; 3], 1.0), None);
    for radius in [-1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(on_base([1.0, 1.0, 5.0], [0.0, 0.0, -1.0], radius), None);
    }
    let point = on_base([1.0, 1.0, 5.0], [0.0, 0.0, -1.0], 0.0).expect("a sphere without radius is a ray");
    assert_eq!(point.t, 5.0);
    let bvh = bvh(&[BASE], config_of(Preset::Balanced));
    let ray = Ray::new([1.0, 1.0, 5.0], [0.0, 0.0, -1.0]);
    assert_eq!(cast_sphere(&bvh, &ray.between(0.0, 3.9), 1.0), None);
    assert_eq!(cast_sphere(&bvh, &ray.between(0.0, 4.0), 1.0).map(|contact| contact.t), Some(4.0));
    let later = cast_sphere(&bvh, &ray.between(4.5, 9.0), 1.0).expect("overlaps where the interval starts");
    assert!(later.starts_inside && later.t == 4.5);
    assert_eq!(cast_sphere(&bvh, &ray.between(7.0, 9.0), 1.0), None);
}

/// The lowest of triangles that are touched at once, and the nearest of those overlapped at the start.
#[test]
fn ties_and_order() {
    let above = BASE.map(|[x, y, z]| [x, y, z + 0.25]);
    let bvh = bvh(&[BASE, BASE, above], config_of(Preset::Balanced));
    let hit = |z: f32, d: f32| {
        cast_sphere(&bvh, &Ray::new([1.0, 1.0, z], [0.0, 0.0, d]), 1.0).map(|contact| (contact.primitive, contact.t))
    };
    assert_eq!(hit(-5.0, 1.0), Some((PrimId(0), 4.0)));
    assert_eq!(hit(5.25, -1.0), Some((PrimId(2), 4.0)));
    assert_eq!(hit(0.75, -1.0), Some((PrimId(2), 0.0)));
    assert_eq!(hit(-0.25, -1.0), Some((PrimId(0), 0.0)));
}
