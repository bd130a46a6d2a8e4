//! Every kind of query against a loop over all instances and all their triangles.

use canted_bvh2::Bvh2;
use canted_fixtures::{Mesh, Rotation, SplitMix64, thin_box, torus};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::{Affine, PrimId};
use canted_tests::{
    brute::{self, ray_object},
    crossings,
    variants::{self, first_wrong_query},
};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Counts, Crossings, Hit, InstanceId, Intersect, Ray, Side, TriangleTest, Watertight};
use canted_wide::{Config, Preset, TriangleBvh};

use super::setup::{
    Altered, affine, all_rays, binary_top, blas_of, bottom, build, crowd, first_difference, instances, meshes, tops,
};

pub(crate) fn loop_over_all(placed: &[Affine], test: TriangleTest, rays: &[Ray]) -> Vec<Option<Hit>> {
    let in_mesh = meshes().map(|mesh| brute::of_mesh(&mesh, test));
    let trace = |i: usize, ray: &Ray| in_mesh[blas_of(i)](ray);
    rays.iter().map(|ray| brute::closest_hit_of_instances(placed, ray, trace)).collect()
}

fn agrees(test: TriangleTest, n: usize) {
    let placed = crowd();
    let rays = all_rays(&placed, n);
    let wants = loop_over_all(&placed, test, &rays);
    assert!(wants.iter().flatten().count() * 3 > rays.len(), "too few rays hit");
    for strategy in Strategy::ALL {
        let binary = |fallback| binary_top(VolumeConfig { strategy, fallback });
        let wide = |preset| TopConfig::Wide(Config::preset(preset));
        for top in [binary(true), binary(false), wide(Preset::Fast), wide(Preset::Quality)] {
            let bottom = meshes().map(|mesh| variants::binary(&mesh, strategy, test));
            let tlas = Tlas::new(bottom.into(), &instances(&placed), top.clone()).unwrap();
            assert_eq!(first_difference(&tlas, &rays, &wants), None, "{strategy:?} under {top:?}");
        }
    }
}

#[test]
fn watertight_agrees_to_the_bit() {
    agrees(TriangleTest::Watertight, 30);
}

#[test]
fn moller_trumbore_agrees_to_the_bit() {
    agrees(TriangleTest::MollerTrumbore, 8);
}

#[test]
fn a_slightly_moved_instance_is_detected() {
    let (placed, [soup, torus]) = (crowd(), meshes());
    let rays = all_rays(&placed, 4);
    let wants = loop_over_all(&placed, TriangleTest::Watertight, &rays);
    let mut moved = instances(&placed);
    moved[1].world_from_object.columns[3][0] += 1e-5;
    let bottom = vec![build(&soup, Strategy::Dop), build(&torus, Strategy::Dop)];
    let tlas = Tlas::new(bottom, &moved, TopConfig::default()).unwrap();
    assert!(first_difference(&tlas, &rays, &wants).is_some());
}

#[test]
fn the_top_level_skips_most_instances() {
    let (placed, [soup, torus]) = (crowd(), meshes());
    let rays = all_rays(&placed, 10);
    for top in [TopConfig::default(), binary_top(VolumeConfig::default())] {
        let bottom = vec![build(&soup, Strategy::Dop), build(&torus, Strategy::Dop)];
        let tlas = Tlas::new(bottom, &instances(&placed), top).unwrap();
        let mut counts = Counts::default();
        for ray in &rays {
            tlas.closest_hit_with(ray, &mut counts);
        }
        let all = (rays.len() * placed.len() * 120) as u64;
        assert!(counts.triangles * 20 < all, "{counts:?} of {all}");
    }
}

#[test]
fn ties_go_to_the_lowest_instance_then_primitive() {
    // Two coincident triangles in each mesh, two coincident meshes, each instanced twice with each transform.
    let [soup, _] = meshes();
    let doubled =
        Mesh { positions: soup.positions.clone(), triangles: [&soup.triangles[..], &soup.triangles].concat() };
    let transforms = [affine(&Rotation::off_axis(), [2.0, 1.0, 0.5], [1.0, 2.0, 3.0]), Affine::IDENTITY];
    for order in [[0, 1, 1, 0], [1, 0, 0, 1], [1, 1, 0, 0]] {
        let instances: Vec<Instance> = order
            .into_iter()
            .zip([0, 1, 1, 0])
            .map(|(transform, blas)| Instance::new(blas, transforms[transform]))
            .collect();
        for strategy in [Strategy::Aabb, Strategy::Dop] {
            for top in [TopConfig::default(), binary_top(VolumeConfig { strategy, fallback: true })] {
                let bottom = vec![build(&doubled, strategy), build(&doubled, Strategy::Aabb)];
                let tlas = Tlas::new(bottom, &instances, top).unwrap();
                let mut n_hits = 0;
                for hit in all_rays(&transforms, 40).iter().filter_map(|ray| tlas.closest_hit(ray)) {
                    let transform = order[hit.instance.0 as usize];
                    assert_eq!(hit.instance.0 as usize, order.iter().position(|&p| p == transform).unwrap(), "{hit:?}");
                    assert!(hit.primitive < PrimId(120), "{hit:?}");
                    n_hits += 1;
                }
                assert!(n_hits > 100, "{n_hits} hits");
            }
        }
    }
}

#[test]
fn t_is_the_same_at_every_scale() {
    let plate = thin_box(0.0);
    let at = |scale: f64, z: f32| Instance::new(0, affine(&Rotation::IDENTITY, [scale; 3], [0.0, 0.0, z]));
    let instances = [at(1024.0, 16.0), at(1.0 / 1024.0, 5.0), at(-1.0, 7.0)];
    let tlas = Tlas::new(vec![build(&plate, Strategy::Aabb)], &instances, TopConfig::default()).unwrap();
    for length in [1.0, 8.0, 1.0 / 64.0] {
        let nearest = |x: f32| {
            let hit = tlas.closest_hit(&Ray::new([x, 0.0, 0.0], [0.0, 0.0, length])).unwrap();
            (hit.t * length, hit.instance)
        };
        assert_eq!(nearest(0.0), (5.0, InstanceId(1)));
        assert_eq!(nearest(0.125), (7.0, InstanceId(2)));
        assert_eq!(nearest(100.0), (16.0, InstanceId(0)));
    }
}

#[test]
fn an_empty_top_level_is_never_hit() {
    for top in [TopConfig::default(), binary_top(VolumeConfig::default())] {
        let mut tlas = Tlas::<Bvh2>::new(vec![], &[], top.clone()).unwrap();
        let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
        assert_eq!((tlas.closest_hit(&ray), tlas.occluded(&ray)), (None, false));
        assert!(tlas.set_instances(&[]).is_ok());
        assert!(tlas.aabb().is_empty());
        let nothing = build(&Mesh::default(), Strategy::Dop);
        let tlas = Tlas::new(vec![nothing], &[Instance::new(0, Affine::IDENTITY)], top).unwrap();
        assert_eq!((tlas.closest_hit(&ray), tlas.occluded(&ray)), (None, false));
    }
}

/// Every hit of a ray on every triangle of every instance: least `t` first, then lowest (instance, primitive).
fn all_hits_of_loop(placed: &[Affine], ray: &Ray) -> Vec<Hit> {
    let records = meshes().map(|mesh| brute::records::<Watertight>(&mesh.positions, &mesh.triangles));
    let of = |(i, world_from_object): (usize, &Affine)| {
        let hits = brute::all_hits::<Watertight>(&records[blas_of(i)], &ray_object(world_from_object, ray));
        let instance = InstanceId(u32::try_from(i).unwrap());
        hits.into_iter().map(move |hit| Hit { instance, ..hit })
    };
    brute::in_order(placed.iter().enumerate().flat_map(of).collect())
}

/// The hits of every ray.
fn all_wanted(placed: &[Affine], rays: &[Ray]) -> Vec<Vec<Hit>> {
    rays.iter().map(|ray| all_hits_of_loop(placed, ray)).collect()
}

/// Rays with another mask or time.
fn changed(rays: &[Ray], change: impl Fn(usize, &Ray) -> Ray) -> Vec<Ray> {
    rays.iter().enumerate().map(|(i, ray)| change(i, ray)).collect()
}

/// Rays at all instances, some with directions of other lengths, some with negative zeros.
fn rays(placed: &[Affine], n: usize) -> Vec<Ray> {
    let mut rng = SplitMix64::new(3);
    let mut rays = all_rays(placed, n);
    for ray in &mut rays {
        let length = 10f64.powf(12.0 * rng.unit() - 6.0) as f32;
        match rng.below(4) {
            0 => {
                ray.direction = ray.direction.map(|d| d * length);
                ray.t_min /= length;
                ray.t_max /= length;
            }
            1 => ray.direction = ray.direction.map(|d| if d == 0.0 { -0.0 } else { d }),
            2 => ray.direction[2] = -0.0,
            _ => {}
        }
    }
    rays
}

#[test]
fn every_query_equals_the_loop() {
    let placed = crowd();
    let rays = rays(&placed, 9);
    // More than one chunk of a slice, and not a multiple of one.
    assert!(rays.len() > 2048 && !rays.len().is_multiple_of(1024), "{}", rays.len());
    let wants = all_wanted(&placed, &rays);
    assert!(wants.iter().map(Vec::len).sum::<usize>() > 2 * rays.len(), "few of {} rays hit", rays.len());
    for top in tops() {
        let tlas = Tlas::new(bottom(), &instances(&placed), top.clone()).unwrap();
        assert_eq!(first_wrong_query(&tlas, &rays, &wants), None);
        let wide = meshes().map(|m| TriangleBvh::build(&m.positions, &m.triangles).unwrap());
        let tlas: Tlas<TriangleBvh> = Tlas::new(wide.into(), &instances(&placed), top).unwrap();
        assert_eq!(first_wrong_query(&tlas, &rays, &wants), None);
    }
}

#[test]
fn the_check_detects_lost_hits_and_wrong_masks() {
    let placed = crowd();
    let rays = rays(&placed, 4);
    let wants = all_wanted(&placed, &rays);
    for top in tops() {
        let shrunk = bottom().into_iter().map(Altered::shrunk).collect();
        let lost = Tlas::new(shrunk, &instances(&placed), top.clone()).unwrap();
        assert!(first_wrong_query(&lost, &rays, &wants).is_some());
        let mut hidden = instances(&placed);
        hidden[12].mask = 1;
        let hidden = Tlas::new(bottom(), &hidden, top).unwrap();
        let seen = |mask| first_wrong_query(&hidden, &changed(&rays, |_, ray| ray.with_mask(mask)), &wants);
        assert!(seen(1).is_none() && seen(2).is_some());
    }
}

#[test]
fn squashed_instances_of_flat_meshes_are_hit() {
    let plate = thin_box(0.0);
    let squashed = affine(&Rotation::off_axis(), [1.0, 1.0, 1e-5], [0.5, 0.0, 0.0]);
    let placed = [Affine::IDENTITY, squashed, squashed];
    let bvh = build(&plate, Strategy::Aabb);
    for top in tops() {
        let tlas = Tlas::new(vec![&bvh], &placed.map(|affine| Instance::new(0, affine)), top).unwrap();
        for (i, affine) in placed.iter().enumerate() {
            let corners = plate.triangles.iter().map(|triangle| triangle.map(|v| plate.positions[v as usize]));
            // Without the sides of the box, which have no area.
            for corners in corners.filter(|[a, b, c]| (0..2).all(|k| a[k] != b[k] || a[k] != c[k])) {
                let [a, b, c] = corners.map(|p| affine.point(p));
                let center: [f32; 3] = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
                let ray = Ray::new([center[0] + 0.1, center[1] - 0.2, 9.0], [-0.1, 0.2, center[2] - 9.0]);
                let mut hits = vec![];
                tlas.all_hits(&ray, &mut hits);
                assert!(hits.iter().any(|hit| hit.instance.0 as usize == i), "{ray:?}: {hits:?}");
            }
        }
    }
}

#[test]
fn masks_hide_instances() {
    let placed = crowd();
    let rays = rays(&placed, 4);
    let masks: Vec<u32> = (0..placed.len()).map(|i| [1, 2, 6, 0x8000_0000, u32::MAX, 0][i % 6]).collect();
    let masked: Vec<Instance> =
        instances(&placed).into_iter().zip(&masks).map(|(instance, &mask)| instance.with_mask(mask)).collect();
    let of_ray = |i: usize| [u32::MAX, 1, 2, 4, 0x8000_0000, 0, 8][i % 7];
    let mut wants = all_wanted(&placed, &rays);
    for (i, hits) in wants.iter_mut().enumerate() {
        hits.retain(|hit| masks[hit.instance.0 as usize] & of_ray(i) != 0);
    }
    let asked = changed(&rays, |i, ray| ray.with_mask(of_ray(i)));
    for top in tops() {
        let tlas = Tlas::new(bottom(), &masked, top).unwrap();
        assert_eq!(tlas.instances(), masked);
        assert_eq!(first_wrong_query(&tlas, &asked, &wants), None);
    }
}

#[test]
#[should_panic = "one answer for each ray"]
fn slices_of_other_lengths_panic() {
    let tlas = Tlas::new(bottom(), &[], TopConfig::default()).unwrap();
    tlas.par_closest_hits(&[Ray::new([0.0; 3], [1.0, 0.0, 0.0])], &mut []);
}

#[test]
fn rays_see_moving_instances_at_their_time() {
    // Shifts by whole numbers, so that every position is exact.
    let at = |x: f32| affine(&Rotation::IDENTITY, [1.0; 3], [x, 0.0, 0.0]);
    let moving = [Instance::moving(0, at(0.0), at(8.0)), Instance::moving(1, at(2.0), at(-6.0)).with_mask(2)];
    for time in [0.0, 0.25, 1.0] {
        let placed = [at(8.0 * time), at(2.0 - 8.0 * time)];
        let rays = all_rays(&placed, 20);
        for top in tops() {
            let tlas = Tlas::new(bottom(), &moving, top).unwrap();
            for (mask, placed) in [(u32::MAX, &placed[..]), (1, &placed[..1])] {
                let asked = changed(&rays, |_, ray| ray.with_mask(mask).at_time(time));
                assert_eq!(first_wrong_query(&tlas, &asked, &all_wanted(placed, &rays)), None);
            }
        }
    }
}

#[test]
fn rays_that_cannot_hit_find_nothing() {
    let tlas = Tlas::new(bottom(), &instances(&crowd()), TopConfig::default()).unwrap();
    let good = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
    let bad = [
        Ray { direction: [0.0, -0.0, 0.0], ..good },
        Ray { direction: [f32::NAN, 0.0, 0.0], ..good },
        Ray { origin: [f32::INFINITY, 0.0, 0.0], ..good },
        Ray { t_min: 2.0, t_max: 1.0, ..good },
        Ray { t_min: -1.0, ..good },
    ];
    let mut hits =
        vec![Hit { t: 0.0, u: 0.0, v: 0.0, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front }];
    for ray in bad {
        tlas.all_hits(&ray, &mut hits);
        assert_eq!((tlas.closest_hit(&ray), tlas.occluded(&ray), hits.len()), (None, false, 0), "{ray:?}");
    }
    let mut counts = Counts::default();
    tlas.all_hits_with(&good, &mut counts, &mut hits);
    assert!(counts.boxes > 0);
}

/// Crossings of closed meshes, counted for each instance by an independent rule.
#[test]
fn crossings_of_each_instance_are_counted_once() {
    let torus = torus(10, 6);
    let placed = crowd();
    let build = || TriangleBvh::build(&torus.positions, &torus.triangles).unwrap();
    let instances: Vec<Instance> =
        placed.iter().enumerate().map(|(i, &affine)| Instance::new(0, affine).with_mask(1 << (i % 2))).collect();
    // From outside at edges and vertices of the image, without an end.
    let mut rays = vec![];
    for (i, world_from_object) in placed.iter().enumerate() {
        let image = |v: u32| world_from_object.point(torus.positions[v as usize]);
        for (j, &[a, b, _]) in torus.triangles.iter().enumerate().filter(|(j, _)| (i + j) % 9 == 0) {
            let (a, b) = (image(a), image(b));
            let target = if j % 2 == 0 { a } else { std::array::from_fn(|k| 0.5 * (a[k] + b[k])) };
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
            assert!(found.is_sorted_by(|a, b| a.t <= b.t), "{found:?}");
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
            tlas.crossings(&ray.with_mask(1), &mut even);
            found.retain(|hit| hit.instance.0 % 2 == 0);
            // Which of equal `t` comes first depends on all.
            let order = |a: &Hit, b: &Hit| {
                a.t.total_cmp(&b.t).then_with(|| (a.instance, a.primitive).cmp(&(b.instance, b.primitive)))
            };
            even.sort_by(order);
            found.sort_by(order);
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
