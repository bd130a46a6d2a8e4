//! Spheres, and primitives that break their contract.

use canted_fixtures::SplitMix64;
use canted_obb::{Aabb, PrimId};
use canted_trace::{Hit, Intersect, Query, Ray, ScaledRay, Side, Sphere};
use canted_wide::{Preset, Primitive, PrimitiveError, PrimitiveHit, WideBvh};

use crate::common::paths;

/// Both roots of every sphere, in order.
fn brute(spheres: &[Sphere], ray: &Ray) -> Vec<(f32, PrimId)> {
    let within = |t: &f32| ray.t_min <= *t && *t <= ray.t_max;
    let mut hits: Vec<_> = (0u32..)
        .zip(spheres)
        .flat_map(|(i, sphere)| sphere.roots(ray).into_iter().flatten().filter(within).map(move |t| (t, PrimId(i))))
        .collect();
    hits.sort_by(|a, b| a.partial_cmp(b).unwrap());
    hits.dedup();
    hits
}

/// Spheres of all sizes around the origin, some without a radius, some equal, some that contain others.
fn spheres(n: usize, scale: f32) -> Vec<Sphere> {
    let mut rng = SplitMix64::new(9);
    let mut spheres: Vec<Sphere> = (0..n)
        .map(|i| {
            let center = std::array::from_fn(|_| scale * (8.0 * rng.unit() as f32 - 4.0));
            let radius = match i % 8 {
                0 => 0.0,
                1 => 1e-6,
                2 => 3.0,
                _ => 0.3 * rng.unit() as f32,
            };
            Sphere { center, radius: scale * radius }
        })
        .collect();
    spheres.extend_from_within(..n / 4);
    spheres
}

/// From inside and outside, at centers, along tangents, from far away, bounded.
fn rays(spheres: &[Sphere], n: usize, scale: f32) -> Vec<Ray> {
    let mut rng = SplitMix64::new(17);
    (0..n)
        .map(|i| {
            let target = spheres[rng.below(spheres.len())];
            let random: [f32; 3] = rng.on_sphere().map(|x| x as f32);
            let distance = scale * [0.0, 0.1, 10.0, 1e3, 1e6][i % 5];
            let origin: [f32; 3] = std::array::from_fn(|k| target.center[k] + distance * random[k]);
            let mut direction: [f32; 3] = std::array::from_fn(|k| target.center[k] - origin[k]);
            if i % 7 == 0 || direction == [0.0; 3] {
                direction = [[1.0, 0.0, -0.0], [0.0, -1.0, 0.0], random][i % 3];
            }
            let mut ray = Ray::new(origin, direction);
            if i % 3 == 0 {
                // Almost a tangent.
                ray.origin[i % 2] += target.radius;
            }
            if i % 4 == 0 {
                (ray.t_min, ray.t_max) = (0.25, 1.0);
            }
            ray
        })
        .collect()
}

#[test]
fn spheres_are_hit_as_by_testing_each() {
    for scale in [1.0, 1e-6, 1e7] {
        let spheres = spheres(300, scale);
        let rays = rays(&spheres, 600, scale);
        for preset in [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality] {
            let mut bvh = WideBvh::over_with(spheres.clone(), preset).expect("valid spheres");
            for path in paths() {
                bvh = bvh.with_path(path);
                let (mut hits, mut n_hits) = (vec![], 0);
                for ray in &rays {
                    let want = brute(&spheres, ray);
                    let brief = |hit: Hit| (hit.t, hit.primitive);
                    assert_eq!(bvh.closest_hit(ray).map(brief), want.first().copied(), "{scale} {ray:?}");
                    assert_eq!(bvh.occluded(ray), !want.is_empty(), "{scale} {ray:?}");
                    bvh.all_hits(ray, &mut hits);
                    assert_eq!(hits.iter().copied().map(brief).collect::<Vec<_>>(), want, "{scale} {ray:?}");
                    n_hits += usize::from(!want.is_empty());
                }
                assert!((200..600).contains(&n_hits), "{n_hits} rays hit");
            }
        }
    }
}

#[test]
fn slices_and_borrowed_primitives_equal_single_rays() {
    let spheres = spheres(200, 1.0);
    let rays = rays(&spheres, 1500, 1.0);
    let bvh = WideBvh::<&Sphere>::over(spheres.iter().collect()).expect("valid spheres");
    let n = rays.len();
    let want: Vec<_> = rays.iter().map(|ray| bvh.closest_hit(ray)).collect();
    let (mut hits, mut par_hits) = (vec![None; n], vec![None; n]);
    bvh.closest_hits(&rays, &mut hits);
    bvh.par_closest_hits(&rays, &mut par_hits);
    assert_eq!((&hits, &par_hits), (&want, &want));
    let (mut occluded, mut par_occluded) = (vec![false; n], vec![true; n]);
    bvh.occluded_many(&rays, &mut occluded);
    bvh.par_occluded_many(&rays, &mut par_occluded);
    assert_eq!(occluded, par_occluded);
    assert!(occluded.iter().zip(&want).all(|(occluded, hit)| *occluded == hit.is_some()));
    let (mut all, mut par_all) = (vec![vec![]; n], vec![vec![]; n]);
    bvh.all_hits_many(&rays, &mut all);
    bvh.par_all_hits_many(&rays, &mut par_all);
    assert_eq!(all, par_all);
    assert!(all.iter().zip(&want).all(|(all, first)| all.first() == first.as_ref()));
}

#[test]
fn where_the_entry_is_rejected_the_exit_is_hit() {
    struct Leaving;
    impl Query for Leaving {
        fn accepts(&mut self, hit: &Hit) -> bool {
            hit.side == Side::Back
        }
    }
    let bvh = WideBvh::over(vec![Sphere { center: [0.0; 3], radius: 1.0 }]).expect("valid");
    let ray = Ray::new([0.0, 0.0, -3.0], [0.0, 0.0, 0.5]);
    assert_eq!(bvh.closest_hit(&ray).map(|hit| (hit.t, hit.side)), Some((4.0, Side::Front)));
    let left = bvh.closest_hit_with(&ray, &mut Leaving);
    assert_eq!(left.map(|hit| (hit.t, hit.side)), Some((8.0, Side::Back)));
    assert!(bvh.occluded_with(&ray, &mut Leaving));
}

#[test]
fn invalid_bounds_are_rejected_by_id() {
    let valid = Sphere { center: [0.0; 3], radius: 1.0 };
    for radius in [-1.0, f32::NAN, f32::INFINITY] {
        let primitives = vec![valid, Sphere { radius, ..valid }, valid];
        let rejected = WideBvh::over(primitives).map(|_| ());
        assert_eq!(rejected, Err(PrimitiveError::Bounds { primitive: PrimId(1) }), "{radius}");
    }
    let none = WideBvh::<Sphere>::over(vec![]).expect("no primitive is invalid");
    assert!(none.closest_hit(&Ray::new([0.0; 3], [1.0; 3])).is_none());
    assert!(none.aabb().is_empty());
}

/// Reports hits outside the interval, and NaN.
struct WrongT(f32);

impl Primitive for WrongT {
    fn bounds(&self) -> Aabb {
        Aabb { min: [0.0; 3], max: [1.0; 3] }
    }

    fn intersect(&self, _: &ScaledRay, _: f32) -> Option<PrimitiveHit> {
        Some(PrimitiveHit { t: self.0, u: 0.0, v: 0.0, side: Side::Front })
    }
}

#[test]
fn hits_outside_the_interval_are_ignored() {
    for t in [f32::NAN, f32::INFINITY, -1.0, 100.0] {
        let bvh = WideBvh::over(vec![WrongT(t)]).expect("valid bounds");
        let ray = Ray { t_max: 50.0, ..Ray::new([0.5, 0.5, -1.0], [0.0, 0.0, 1.0]) };
        assert_eq!(bvh.closest_hit(&ray), None, "{t}");
        let endless = Ray { t_max: f32::INFINITY, ..ray };
        let mut hits = vec![];
        bvh.all_hits(&endless, &mut hits);
        assert_eq!(hits.len(), usize::from(t == 100.0));
    }
}

/// A sphere whose error is larger than stated.
struct Inexact<const STATED: bool>(Sphere);

/// Its error, relative to `|o|∞ + ρ∞`.
const ACTUAL_ERROR: f32 = 1e-3;

impl<const STATED: bool> Primitive for Inexact<STATED> {
    const ERROR: f32 = if STATED { 2.0 * ACTUAL_ERROR } else { 0.0 };

    fn bounds(&self) -> Aabb {
        self.0.bounds()
    }

    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        let reach = |v: [f32; 3]| v.into_iter().fold(0.0f32, |a, x| a.max(x.abs()));
        let scale = reach(ray.origin) + self.bounds().reach();
        // Grown by the error, so that rays which miss the bounds hit it.
        let grown = Sphere { radius: self.0.radius + ACTUAL_ERROR * scale, ..self.0 };
        grown.intersect_surface(ray, t_max)
    }
}

trait IntersectSurface {
    fn intersect_surface(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit>;
}

impl IntersectSurface for Sphere {
    fn intersect_surface(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        Primitive::intersect(self, ray, t_max)
    }
}

#[test]
fn pads_follow_the_stated_error() {
    fn lost<const STATED: bool>() -> usize {
        let spheres = spheres(200, 1.0);
        let rays = rays(&spheres, 2000, 1.0);
        let bvh = WideBvh::<Inexact<STATED>>::over(spheres.iter().map(|&s| Inexact::<STATED>(s)).collect());
        let bvh = bvh.expect("valid spheres");
        rays.iter()
            .filter(|ray| {
                let Some(scaled) = ScaledRay::new(ray) else { return false };
                let tried = bvh.primitives().iter().filter_map(|p| p.intersect(&scaled, scaled.t_max));
                let want = tried.map(|hit| scaled.caller_t(hit.t)).reduce(f32::min);
                bvh.closest_hit(ray).map(|hit| hit.t) != want
            })
            .count()
    }
    assert_eq!(lost::<true>(), 0);
    let lost = lost::<false>();
    assert!(lost > 20, "an error that is not stated loses {lost} hits");
}
