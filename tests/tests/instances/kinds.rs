//! Bottom-level BVHs of every kind: triangles, spheres and a shape of the caller's, by value, shared and mixed; builders, volumes and
//! triangle tests mixed in one top level.

use std::sync::Arc;

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::Mesh;
use canted_lbvh::{self as lbvh, Strategy, VolumeConfig};
use canted_obb::{Aabb, Affine, Moments, Obb, PrimId};
use canted_renderer::obvhs_tree;
use canted_tests::brute::{self, ray_object};
use canted_tlas::{Blas, Instance, Tlas, TopConfig};
use canted_trace::{
    BaldwinWeber, HIT_ERROR, Hit, InstanceId, Kernel, MollerTrumbore, Query, Ray, ScaledRay, Sphere, Watertight,
};
use canted_wide::{Config, Primitive, PrimitiveHit, TriangleBvh, WideBvh, bounds_of_points, extent_of_points};

use super::{
    queries::loop_over_all,
    setup::{Altered, all_rays, build, crowd, instances, meshes},
};

fn tops() -> [TopConfig; 2] {
    [TopConfig::default(), TopConfig::Binary(VolumeConfig { strategy: Strategy::Dop, fallback: true })]
}

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

fn sorted(mut hits: Vec<Hit>) -> Vec<Hit> {
    hits.sort_by(|a, b| if a.before(b) { std::cmp::Ordering::Less } else { std::cmp::Ordering::Greater });
    hits
}

fn spheres() -> Vec<Sphere> {
    meshes()[0].positions.iter().step_by(7).map(|&center| Sphere { center, radius: 0.2 }).collect()
}

#[test]
fn instances_of_spheres_equal_the_loop() {
    let placed = crowd();
    let all = spheres();
    let bvh = || WideBvh::<Sphere>::build(spheres(), &Config::default()).unwrap();
    let instances: Vec<Instance> = placed.iter().map(|&affine| Instance::new(0, affine)).collect();
    let rays = all_rays(&placed, 3);
    for top in tops() {
        let tlas = Tlas::new(vec![bvh()], &instances, top).unwrap();
        let loaded = Tlas::<WideBvh<Sphere>>::from_bytes(&tlas.to_bytes(), top).unwrap();
        let (mut hits, mut n_hits) = (vec![], 0);
        for ray in &rays {
            let of = |(i, affine): (u32, &Affine)| hits_on(&all, &ray_object(affine, ray), InstanceId(i));
            let want = sorted((0..).zip(&placed).flat_map(of).collect());
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
    let bvh = || WideBvh::<Loose>::build(vec![Loose(unit)], &Config::default()).unwrap();
    let apart = |x: f32| Instance::new(0, Affine::translation([x, 0.0, 0.0]));
    // Outside of the bounds, inside of the larger sphere.
    let ray = Ray::new([1.03, 0.0, -3.0], [0.0, 0.0, 1.0]);
    assert!(bvh().closest_hit(&ray).is_some());
    for top in tops() {
        let tlas = Tlas::new(vec![bvh()], &[apart(0.0), apart(50.0)], top).unwrap();
        assert_eq!(tlas.closest_hit(&ray), bvh().closest_hit(&ray));
        let lost = Tlas::new(vec![Altered::with_error_of_triangles(bvh())], &[apart(0.0), apart(50.0)], top).unwrap();
        assert_eq!(lost.closest_hit(&ray), None);
    }
}

/// A BVH of any kind.
enum Shape {
    Wide(TriangleBvh<Watertight>),
    Binary(Bvh2<Watertight>),
    Spheres(WideBvh<Sphere>),
}

impl Blas for Shape {
    fn bounds(&self) -> Obb {
        match self {
            Self::Wide(bvh) => bvh.bounds(),
            Self::Binary(bvh) => bvh.bounds(),
            Self::Spheres(bvh) => bvh.bounds(),
        }
    }
    fn hit_error(&self) -> f32 {
        match self {
            Self::Wide(bvh) => bvh.hit_error(),
            Self::Binary(bvh) => bvh.hit_error(),
            Self::Spheres(bvh) => bvh.hit_error(),
        }
    }
    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        match self {
            Self::Wide(bvh) => bvh.closest_hit_with(ray_object, instance, query),
            Self::Binary(bvh) => bvh.closest_hit_with(ray_object, instance, query),
            Self::Spheres(bvh) => bvh.closest_hit_with(ray_object, instance, query),
        }
    }
    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        match self {
            Self::Wide(bvh) => bvh.occluded_with(ray_object, instance, query),
            Self::Binary(bvh) => bvh.occluded_with(ray_object, instance, query),
            Self::Spheres(bvh) => bvh.occluded_with(ray_object, instance, query),
        }
    }
    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        match self {
            Self::Wide(bvh) => bvh.all_hits_with(ray_object, instance, query, hits),
            Self::Binary(bvh) => bvh.all_hits_with(ray_object, instance, query, hits),
            Self::Spheres(bvh) => bvh.all_hits_with(ray_object, instance, query, hits),
        }
    }
}

#[test]
fn triangles_and_spheres_share_a_tlas() {
    let [soup, torus] = meshes();
    let placed = crowd();
    let shapes = || {
        let wide = TriangleBvh::build(&soup.positions, &soup.triangles, &Config::default()).unwrap();
        let spheres = WideBvh::<Sphere>::build(spheres(), &Config::default()).unwrap();
        vec![Shape::Wide(wide), Shape::Binary(build(&torus, Strategy::Dop)), Shape::Spheres(spheres)]
    };
    let rays = all_rays(&placed, 4);
    let of_triangles = loop_over_all::<Watertight>(&placed, &rays);
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
            let of_spheres = sorted(thirds().flat_map(of).collect()).first().copied();
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
    let build = |mesh: &canted_fixtures::Mesh| {
        TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::default()).unwrap()
    };
    let placed = instances(&crowd());
    let rays = all_rays(&crowd(), 2);
    let shared = [Arc::new(build(&soup)), Arc::new(build(&torus))];
    let owned = Tlas::new(vec![build(&soup), build(&torus)], &placed, tops()[0]).unwrap();
    let first = Tlas::new(shared.to_vec(), &placed, tops()[0]).unwrap();
    let second = Tlas::new(shared.to_vec(), &placed[..5], tops()[1]).unwrap();
    assert_eq!(shared.each_ref().map(Arc::strong_count), [3, 3]);
    let boxed: Vec<Box<TriangleBvh<Watertight>>> = owned.blas().iter().cloned().map(Box::new).collect();
    let boxed = Tlas::new(boxed, &placed, tops()[1]).unwrap();
    let borrowed = Tlas::new(owned.blas().iter().collect(), &placed, tops()[1]).unwrap();
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

/// A bottom level of either kind.
enum Mixed {
    Watertight(Bvh2<Watertight>),
    MollerTrumbore(Bvh2<MollerTrumbore>),
    BaldwinWeber(Bvh2<BaldwinWeber>),
}

impl Blas for Mixed {
    fn bounds(&self) -> Obb {
        match self {
            Self::Watertight(blas) => blas.bounds(),
            Self::MollerTrumbore(blas) => blas.bounds(),
            Self::BaldwinWeber(blas) => blas.bounds(),
        }
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn closest_hit_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        match self {
            Self::Watertight(blas) => blas.closest_hit_with(ray_object, instance, query),
            Self::MollerTrumbore(blas) => blas.closest_hit_with(ray_object, instance, query),
            Self::BaldwinWeber(blas) => blas.closest_hit_with(ray_object, instance, query),
        }
    }

    fn occluded_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        match self {
            Self::Watertight(blas) => blas.occluded_with(ray_object, instance, query),
            Self::MollerTrumbore(blas) => blas.occluded_with(ray_object, instance, query),
            Self::BaldwinWeber(blas) => blas.occluded_with(ray_object, instance, query),
        }
    }

    fn all_hits_with<Q: Query>(&self, ray_object: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        match self {
            Self::Watertight(blas) => blas.all_hits_with(ray_object, instance, query, hits),
            Self::MollerTrumbore(blas) => blas.all_hits_with(ray_object, instance, query, hits),
            Self::BaldwinWeber(blas) => blas.all_hits_with(ray_object, instance, query, hits),
        }
    }
}

/// A bottom level over the topology of `obvhs`, with our volumes.
fn foreign<K: Kernel>(mesh: &Mesh, strategy: Strategy) -> Bvh2<K> {
    let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let tree = obvhs_tree(&corners, obvhs::BvhBuildParams::medium_build()).unwrap();
    let volumes = VolumeConfig { strategy, fallback: true };
    Bvh2::over(tree, &corners, &bounds, &BuildConfig { volumes, ..BuildConfig::default() })
}

/// Several every_kind with the watertight test, then one of each other test; even ones over the soup.
fn every_kind() -> Vec<Mixed> {
    let [soup, torus] = meshes();
    vec![
        Mixed::Watertight(build(&soup, Strategy::Aabb)),
        Mixed::Watertight(foreign(&torus, Strategy::Dop)),
        Mixed::Watertight(foreign(&soup, Strategy::Quaternion)),
        Mixed::Watertight(build(&torus, Strategy::PcaUnbounded)),
        Mixed::MollerTrumbore(foreign(&soup, Strategy::PcaBounded)),
        Mixed::BaldwinWeber(build(&torus, Strategy::Dop)),
    ]
}

/// A top level whose instances cycle through these bottom levels.
fn tlas(order: &[u32]) -> Tlas<Mixed> {
    let instances: Vec<Instance> = crowd()
        .into_iter()
        .zip(order.iter().cycle())
        .map(|(world_from_object, &blas)| Instance::new(blas, world_from_object))
        .collect();
    Tlas::new(
        every_kind(),
        &instances,
        TopConfig::Binary(VolumeConfig { strategy: Strategy::Combined, fallback: true }),
    )
    .unwrap()
}

fn hits(tlas: &Tlas<Mixed>, rays: &[Ray]) -> Vec<Option<Hit>> {
    rays.iter().map(|ray| tlas.closest_hit(ray)).collect()
}

#[test]
fn mixed_builders_and_volumes_change_no_bit() {
    let rays = all_rays(&crowd(), 10);
    let same = hits(&tlas(&[0, 1]), &rays);
    assert_eq!(hits(&tlas(&[2, 3]), &rays), same);
    assert_eq!(hits(&tlas(&[0, 1, 2, 3]), &rays), same);
    assert_ne!(hits(&tlas(&[1, 0]), &rays), same);
}

#[test]
fn mixed_triangle_tests_match_the_loop() {
    let (placed, [soup, torus]) = (crowd(), meshes());
    let rays = all_rays(&placed, 10);
    let of = |mesh: &Mesh| brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
    let watertight = [of(&soup), of(&torus)];
    let moller_trumbore = brute::records::<MollerTrumbore>(&soup.positions, &soup.triangles);
    let baldwin_weber = brute::records::<BaldwinWeber>(&torus.positions, &torus.triangles);
    let order = [4, 5, 0, 1, 2, 3];
    let trace = |i: usize, ray: &Ray| match order[i % order.len()] {
        4 => brute::closest_hit::<MollerTrumbore>(&moller_trumbore, ray),
        5 => brute::closest_hit::<BaldwinWeber>(&baldwin_weber, ray),
        kind => brute::closest_hit::<Watertight>(&watertight[kind % 2], ray),
    };
    let mixed = tlas(&order.map(|kind| u32::try_from(kind).unwrap()));
    for ray in &rays {
        let want = brute::closest_hit_of_instances(&placed, ray, trace);
        assert_eq!(mixed.closest_hit(ray), want, "{ray:?}");
        assert_eq!(mixed.occluded(ray), want.is_some(), "{ray:?}");
    }
}
