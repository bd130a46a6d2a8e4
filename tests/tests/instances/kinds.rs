//! Bottom-level BVHs of every kind: triangles, spheres and a shape of the caller's, by value, shared and mixed; builders, volumes and
//! triangle tests mixed in one top level.

use std::sync::Arc;

use canted_bih::{Bih, BihConfig};
use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::Mesh;
use canted_kdtree::{KdTree, KdTreeConfig};
use canted_lbvh::{self as lbvh, Strategy, VolumeConfig};
use canted_obb::{Aabb, Affine, Moments, PrimId};
use canted_renderer::obvhs_tree;
use canted_tests::{
    brute::{self, in_order, ray_object},
    variants::binary,
};
use canted_tlas::{Instance, Tlas};
use canted_trace::{Crossings, Hit, InstanceId, Intersect, Ray, ScaledRay, Sphere, TriangleTest};
use canted_wide::{Primitive, PrimitiveHit, TriangleBvh, WideBvh, bounds_of_points, extent_of_points};

use super::{
    queries::loop_over_all,
    setup::{Altered, all_rays, build, crowd, first_difference, instances, meshes, tops},
};

/// Every hit on `primitives`, tested one by one.
fn hits_on<P: Primitive>(primitives: &[P], ray_object: &Ray, instance: InstanceId) -> Vec<Hit> {
    let Some(ray) = ScaledRay::new(ray_object) else { return vec![] };
    let mut hits = vec![];
    for (primitive, shape) in (0..).map(PrimId).zip(primitives) {
        let mut rest = ray;
        while let Some(PrimitiveHit { t, u, v, side }) = shape.intersect(&rest, ray.t_max) {
            hits.push(Hit { t: ray.caller_t(t), u, v, primitive, instance, side });
            rest.t_min = t.next_up();
        }
    }
    hits
}

fn spheres() -> Vec<Sphere> {
    meshes()[0].positions.iter().step_by(7).map(|&center| Sphere { center, radius: 0.2 }).collect()
}

#[test]
fn instances_of_spheres_equal_the_loop() {
    let placed = crowd();
    let all = spheres();
    let bvh = || WideBvh::over(spheres()).unwrap();
    let instances: Vec<Instance> = placed.iter().map(|&affine| Instance::new(0, affine)).collect();
    let rays = all_rays(&placed, 3);
    for top in tops() {
        let tlas = Tlas::new(vec![bvh()], &instances, top.clone()).unwrap();
        let loaded = Tlas::<WideBvh<Sphere>>::from_bytes(&tlas.to_bytes(), top).unwrap();
        let (mut hits, mut n_hits) = (vec![], 0);
        for ray in &rays {
            let of = |(i, affine): (u32, &Affine)| hits_on(&all, &ray_object(affine, ray), InstanceId(i));
            let want = in_order((0..).zip(&placed).flat_map(of).collect());
            for tlas in [&tlas, &loaded] {
                tlas.all_hits(ray, &mut hits);
                assert_eq!(hits, want, "{ray:?}");
                assert_eq!(tlas.closest_hit(ray), want.first().copied(), "{ray:?}");
                assert_eq!(tlas.occluded(ray), !want.is_empty(), "{ray:?}");
            }
            n_hits += want.len();
        }
        assert!(n_hits > rays.len(), "{n_hits} hits of {} rays", rays.len());
    }
}

/// A sphere that reports hits up to a twentieth of its radius outside of its bounds, and says so.
#[derive(Clone, Copy)]
struct Loose(Sphere);

impl Primitive for Loose {
    const ERROR: f32 = 0.125;

    fn bounds(&self) -> Aabb {
        bounds_of_points([self.0.center], self.0.radius)
    }
    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_points([self.0.center], self.0.radius, direction)
    }
    fn moments(&self) -> Moments {
        Moments::from_points([self.0.center])
    }
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let larger = Sphere { radius: 1.05 * self.0.radius, ..self.0 };
        Primitive::intersect(&larger, ray, t_max)
    }
}

#[test]
fn the_top_level_allows_for_the_error_of_a_shape() {
    let unit = Sphere { center: [0.0; 3], radius: 1.0 };
    let bvh = || WideBvh::over(vec![Loose(unit)]).unwrap();
    let apart = |x: f32| Instance::new(0, Affine::translation([x, 0.0, 0.0]));
    // Outside of the bounds, inside of the larger sphere.
    let ray = Ray::new([1.03, 0.0, -3.0], [0.0, 0.0, 1.0]);
    assert!(bvh().closest_hit(&ray).is_some());
    for top in tops() {
        let tlas = Tlas::new(vec![bvh()], &[apart(0.0), apart(50.0)], top.clone()).unwrap();
        assert_eq!(tlas.closest_hit(&ray), bvh().closest_hit(&ray));
        let lost = Tlas::new(vec![Altered::with_error_of_triangles(bvh())], &[apart(0.0), apart(50.0)], top).unwrap();
        assert_eq!(lost.closest_hit(&ray), None);
    }
}

#[test]
fn triangles_and_spheres_share_a_tlas() {
    let [soup, torus] = meshes();
    let placed = crowd();
    let shapes = || -> Vec<Box<dyn Intersect>> {
        let wide = TriangleBvh::build(&soup.positions, &soup.triangles).unwrap();
        let spheres = WideBvh::over(spheres()).unwrap();
        vec![Box::new(wide), Box::new(build(&torus, Strategy::Dop)), Box::new(spheres)]
    };
    let rays = all_rays(&placed, 4);
    let of_triangles = loop_over_all(&placed, TriangleTest::Watertight, &rays);
    let all_spheres = spheres();
    let n = u32::try_from(placed.len()).unwrap();
    // The triangles of every instance, then spheres in every third position.
    let thirds = || (n..).zip(placed.iter().step_by(3));
    let mut both = instances(&placed);
    both.extend(placed.iter().step_by(3).map(|&affine| Instance::new(2, affine)));
    for top in tops() {
        let tlas = Tlas::new(shapes(), &both, top).unwrap();
        let mut n_spheres = 0;
        for (ray, of_triangles) in rays.iter().zip(&of_triangles) {
            let of = |(i, affine): (u32, &Affine)| hits_on(&all_spheres, &ray_object(affine, ray), InstanceId(i));
            let of_spheres = in_order(thirds().flat_map(of).collect()).first().copied();
            let want = match (of_triangles, of_spheres) {
                (Some(a), Some(b)) => Some(if a.before(&b) { *a } else { b }),
                (a, b) => a.or(b),
            };
            assert_eq!(tlas.closest_hit(ray), want, "{ray:?}");
            assert_eq!(tlas.occluded(ray), want.is_some(), "{ray:?}");
            n_spheres += usize::from(want.is_some_and(|hit| hit.instance.0 >= n));
        }
        assert!(n_spheres > 50, "{n_spheres}");
    }
}

#[test]
fn pointers_share_a_bvh() {
    let [soup, torus] = meshes();
    let build = |mesh: &Mesh| TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap();
    let [wide, binary] = tops();
    let placed = instances(&crowd());
    let rays = all_rays(&crowd(), 2);
    let shared = [Arc::new(build(&soup)), Arc::new(build(&torus))];
    let owned = Tlas::new(vec![build(&soup), build(&torus)], &placed, wide.clone()).unwrap();
    let first = Tlas::new(shared.to_vec(), &placed, wide.clone()).unwrap();
    let second = Tlas::new(shared.to_vec(), &placed[..5], binary.clone()).unwrap();
    assert_eq!(shared.each_ref().map(Arc::strong_count), [3, 3]);
    let boxed: Vec<Box<TriangleBvh>> = owned.blas().iter().cloned().map(Box::new).collect();
    let boxed = Tlas::new(boxed, &placed, binary.clone()).unwrap();
    let borrowed = Tlas::new(owned.blas().iter().collect(), &placed, binary.clone()).unwrap();
    let (mut hits, mut want, mut crossings) = (vec![], vec![], vec![]);
    for ray in &rays {
        owned.all_hits(ray, &mut want);
        first.all_hits(ray, &mut hits);
        assert_eq!(hits, want);
        boxed.all_hits(ray, &mut hits);
        assert_eq!(hits, want);
        let closest = owned.closest_hit(ray);
        assert_eq!([first.closest_hit(ray), boxed.closest_hit(ray), borrowed.closest_hit(ray)], [closest; 3]);
        assert_eq!([first.occluded(ray), boxed.occluded(ray)], [closest.is_some(); 2]);
        owned.crossings(ray, &mut crossings);
        first.crossings(ray, &mut hits);
        assert_eq!(hits, crossings);
    }
    drop((first, second));
    assert_eq!(shared.each_ref().map(Arc::strong_count), [1, 1]);
}

/// A bottom level over the topology of `obvhs`, with our volumes.
fn foreign(mesh: &Mesh, strategy: Strategy, test: TriangleTest) -> Bvh2 {
    let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let tree = obvhs_tree(&corners, obvhs::BvhBuildParams::medium_build()).unwrap();
    let volumes = VolumeConfig { strategy, fallback: true };
    Bvh2::over(tree, &corners, &bounds, &Bvh2Config { volumes, test, ..Bvh2Config::default() })
}

/// Several kinds with the watertight test, then one of each other test; even ones over the soup.
fn every_kind() -> [Box<dyn Intersect>; 10] {
    let [soup, torus] = meshes();
    let [watertight, moller_trumbore, baldwin_weber] = TriangleTest::ALL;
    [
        Box::new(build(&soup, Strategy::Aabb)),
        Box::new(foreign(&torus, Strategy::Dop, watertight)),
        Box::new(foreign(&soup, Strategy::Quaternion, watertight)),
        Box::new(build(&torus, Strategy::PcaUnbounded)),
        Box::new(Bih::build(&soup.positions, &soup.triangles, &BihConfig::default()).unwrap()),
        Box::new(KdTree::build(&torus.positions, &torus.triangles, &KdTreeConfig::default()).unwrap()),
        Box::new(TriangleBvh::build(&soup.positions, &soup.triangles).unwrap()),
        Box::new(TriangleBvh::build(&torus.positions, &torus.triangles).unwrap()),
        Box::new(foreign(&soup, Strategy::PcaBounded, moller_trumbore)),
        Box::new(binary(&torus, Strategy::Dop, baldwin_weber)),
    ]
}

/// A top level whose instances cycle through these bottom levels.
fn tlas(order: &[u32]) -> Tlas<Box<dyn Intersect>> {
    let placed = crowd().into_iter().zip(order.iter().cycle());
    let instances: Vec<Instance> = placed.map(|(map, &blas)| Instance::new(blas, map)).collect();
    let [_, top] = tops();
    Tlas::new(every_kind().into(), &instances, top).unwrap()
}

fn hits(tlas: &dyn Intersect, rays: &[Ray]) -> Vec<Option<Hit>> {
    rays.iter().map(|ray| tlas.closest_hit(ray)).collect()
}

#[test]
fn mixed_kinds_builders_and_volumes_change_no_bit() {
    let rays = all_rays(&crowd(), 10);
    let same = hits(&tlas(&[0, 1]), &rays);
    for order in [&[2, 3][..], &[0, 1, 2, 3], &[4, 5], &[6, 7], &[6, 1, 4, 3, 2, 5]] {
        assert_eq!(hits(&tlas(order), &rays), same, "{order:?}");
    }
    assert_ne!(hits(&tlas(&[1, 0]), &rays), same);
}

#[test]
fn mixed_triangle_tests_match_the_loop() {
    let (placed, [soup, torus]) = (crowd(), meshes());
    let rays = all_rays(&placed, 10);
    let order = [8, 9, 0, 1, 2, 3];
    let test = |kind: u32| TriangleTest::ALL[kind.saturating_sub(7) as usize];
    let loops = order.map(|kind| brute::of_mesh([&soup, &torus][kind as usize % 2], test(kind)));
    let trace = |i: usize, ray: &Ray| loops[i % order.len()](ray);
    let wants: Vec<_> = rays.iter().map(|ray| brute::closest_hit_of_instances(&placed, ray, trace)).collect();
    assert_eq!(first_difference(&tlas(&order), &rays, &wants), None);
}
