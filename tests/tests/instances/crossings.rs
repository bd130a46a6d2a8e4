//! Crossings of surfaces, and hits on equal surfaces, through several instances.

use canted_obb::Affine;
use canted_tests::crossings;
use canted_tests::instances::ray_object;
use canted_tlas::{Instance, RayOptions, Tlas};
use canted_trace::{Hit, Ray, Side, Watertight};
use canted_wide::{Config, TriangleBvh};

use super::queries::{bottom, tops};
use super::setup::{all_rays, crowd};

/// Crossings of closed meshes, counted for each instance by an independent rule.
#[test]
fn crossings_of_each_instance_are_counted_once() {
    let torus = canted_fixtures::torus(10, 6);
    let placed = crowd();
    let build = || TriangleBvh::<Watertight>::build(&torus.positions, &torus.triangles, &Config::default()).unwrap();
    let instances: Vec<Instance> =
        placed.iter().enumerate().map(|(i, &affine)| Instance::new(0, affine).with_mask(1 << (i % 2))).collect();
    // From outside at edges and vertices of the image, without an end.
    let mut rays = vec![];
    for (i, world_from_object) in placed.iter().enumerate() {
        let image = |v: u32| world_from_object.point(torus.positions[v as usize]);
        for (j, &[a, b, _]) in torus.triangles.iter().enumerate().filter(|(j, _)| (i + j) % 9 == 0) {
            let (a, b) = (image(a), image(b));
            let target = if j % 2 == 0 { a } else { std::array::from_fn(|k| 0.5 * (a[k] + b[k])) };
            #[expect(clippy::cast_possible_truncation, reason = "test data")]
            let size = 10.0 * world_from_object.reach(2.0) as f32;
            let origin = [target[0] + size, target[1] - 0.5 * size, target[2] + 0.25 * size];
            rays.push(Ray::new(origin, std::array::from_fn(|k| target[k] - origin[k])));
        }
    }
    for top in tops() {
        let tlas = Tlas::new(vec![build()], &instances, top).unwrap();
        let (mut found, mut even, mut hits) = (vec![], vec![], vec![]);
        let mut n_crossings = 0;
        for ray in &rays {
            tlas.crossings(ray, &mut found);
            assert!(found.is_sorted_by(|a, b| a.before(b)), "{found:?}");
            tlas.all_hits(ray, &mut hits);
            for (i, world_from_object) in placed.iter().enumerate() {
                let of_instance = |hits: &[Hit]| -> Vec<Hit> {
                    hits.iter().filter(|hit| hit.instance.0 as usize == i).copied().collect()
                };
                let want = crossings::of_hits(&torus, &ray_object(world_from_object, ray), of_instance(&hits));
                let got = of_instance(&found);
                // Which of several triangles around an edge stands for the crossing may differ.
                let places = |hits: &[Hit]| {
                    let mut places: Vec<_> = hits.iter().map(|hit| (hit.t.to_bits(), hit.side == Side::Back)).collect();
                    places.sort_unstable();
                    places
                };
                assert_eq!(places(&got), places(&want), "instance {i}, {ray:?}");
                let n_front = got.iter().filter(|hit| hit.side == Side::Front).count();
                assert_eq!(2 * n_front, got.len(), "instance {i}, {ray:?}");
            }
            n_crossings += found.len();
            tlas.crossings_with(ray, &RayOptions::mask(1), &mut even);
            found.retain(|hit| hit.instance.0 % 2 == 0);
            assert_eq!(even, found);
        }
        assert!(n_crossings > rays.len(), "{n_crossings} crossings of {} rays", rays.len());
    }
}

/// Two instances in the same position are two surfaces; their hits come in pairs, the lower instance first.
#[test]
fn duplicates_are_hit_in_order() {
    let placed = [Affine::IDENTITY, Affine::IDENTITY];
    let twice = placed.map(|affine| Instance::new(0, affine));
    let rays = all_rays(&placed[..1], 50);
    for top in tops() {
        let tlas = Tlas::new(bottom(), &twice, top).unwrap();
        let mut hits = vec![];
        let mut n_pairs = 0;
        for ray in &rays {
            tlas.all_hits(ray, &mut hits);
            assert!(hits.is_sorted_by(|a, b| a.before(b)), "{hits:?}");
            let of = |instance: u32| hits.iter().filter(move |hit| hit.instance.0 == instance);
            assert!(of(0).map(|hit| (hit.t, hit.primitive)).eq(of(1).map(|hit| (hit.t, hit.primitive))), "{hits:?}");
            assert_eq!(tlas.closest_hit(ray), hits.first().copied());
            n_pairs += of(0).count();
        }
        assert!(n_pairs > 100, "{n_pairs}");
    }
}
