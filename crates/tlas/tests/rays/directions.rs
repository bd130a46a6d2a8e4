//! Directions of any length, and `t` of any size.

use canted_bvh2::Bvh2Boxes;
use canted_fixtures::{Mesh, SplitMix64, soup};
use canted_lbvh::VolumeConfig;
use canted_obb::Affine;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Accept, Crossings, Hit, InstanceId, Intersect, Ray};
use canted_wide::TriangleBvh;

use crate::oracle::{affine, all_hits};

fn bvh(mesh: &Mesh) -> TriangleBvh {
    TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap()
}

fn triangle() -> Mesh {
    Mesh { positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]] }
}

fn scaled(by: f64) -> Affine {
    affine([[by, 0.0, 0.0], [0.0, by, 0.0], [0.0, 0.0, by], [0.0; 3]])
}

fn tlas_of(meshes: &[Mesh], instances: &[Instance], top: TopConfig) -> Tlas<TriangleBvh> {
    Tlas::new(meshes.iter().map(bvh).collect(), instances, top).unwrap()
}

fn tops() -> [TopConfig; 2] {
    [TopConfig::default(), TopConfig::other(Bvh2Boxes::builder(VolumeConfig::default()))]
}

/// A ray from above the middle of a scaled triangle, straight down.
fn down_at(scale: f32, length: f32) -> Ray {
    Ray::new([0.15 * scale, 0.2 * scale, scale], [0.0, 0.0, -length])
}

#[test]
fn long_directions_hit_small_instances() {
    let tlas = tlas_of(&[triangle()], &[Instance::new(0, scaled(1e-6))], TopConfig::default());
    for length in [1.0, 1e32, 4e32, 1e38] {
        let hit = tlas.closest_hit(&down_at(1e-6, length)).unwrap();
        let expected = 1e-6 / f64::from(length);
        assert!((f64::from(hit.t) - expected).abs() <= 1e-6 * expected + 1e-45, "{length}: {hit:?}");
        assert!((hit.u - 0.15).abs() < 1e-6 && (hit.v - 0.2).abs() < 1e-6, "{length}: {hit:?}");
    }
}

#[test]
fn short_directions_hit_large_instances() {
    let tlas = tlas_of(&[triangle()], &[Instance::new(0, scaled(1e6))], TopConfig::default());
    for length in [1.0, 1e-20, 1e-32, 3e-33] {
        let hit = tlas.closest_hit(&down_at(1e6, length)).unwrap();
        assert!((hit.u - 0.15).abs() < 1e-6 && (hit.v - 0.2).abs() < 1e-6, "{length}: {hit:?}");
        assert!(hit.t.is_finite() && tlas.occluded(&down_at(1e6, length)));
    }
    // What is reached only beyond the greatest finite `t` is not hit.
    for length in [2e-33, 3e-39, 1e-40, 1e-45] {
        assert_eq!(tlas.closest_hit(&down_at(1e6, length)), None, "{length}");
        assert!(!tlas.occluded(&down_at(1e6, length)), "{length}");
    }
    assert_eq!(bvh(&triangle()).closest_hit(&down_at(1.0, 1e-40)), None);
    assert!(bvh(&triangle()).closest_hit(&down_at(1.0, 4e-39)).unwrap().t.is_finite());
}

/// The end of an interval is a number of the caller's: one that no scaled `t` reaches excludes the hit.
#[test]
fn intervals_are_those_of_the_caller() {
    let tlas = tlas_of(&[triangle()], &[Instance::new(0, scaled(1.0))], TopConfig::default());
    // At 2^-140 of the direction, and with ends of the interval around it.
    let ray = Ray::new([0.25, 0.25, 2.0_f32.powi(-20)], [0.0, 0.0, -2.0_f32.powi(120)]);
    let t = 2.0_f32.powi(-140);
    for (t_min, t_max, is_hit) in [
        (0.0, t, true),
        (t, t, true),
        (0.0, t.next_down(), false),
        (t.next_up(), f32::INFINITY, false),
        (0.0, 0.0, false),
    ] {
        let ray = Ray { t_min, t_max, ..ray };
        let hit = tlas.closest_hit(&ray);
        assert_eq!(hit.map(|hit| hit.t), is_hit.then_some(t), "{t_min} {t_max}");
        assert_eq!(tlas.occluded(&ray), is_hit);
        assert_eq!(bvh(&triangle()).closest_hit(&ray).map(|hit| hit.t), is_hit.then_some(t), "{t_min} {t_max}");
    }
    // From the triangle itself: t is 0, and an interval from the least subnormal excludes it.
    let on = Ray { origin: [0.25, 0.25, 0.0], ..ray };
    assert_eq!(tlas.closest_hit(&on).map(|hit| hit.t), Some(0.0));
    assert_eq!(tlas.closest_hit(&Ray { t_min: f32::from_bits(1), ..on }), None);
}

/// Some shear, rotation and scale around the origin, all of `scale`.
fn random_map(rng: &mut SplitMix64, scale: f64, spread: f64) -> Affine {
    loop {
        let columns = [rng.signed3(), rng.signed3(), rng.signed3()];
        let [a, b, c] = columns;
        let det = a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        if det.abs() > 0.1 {
            let [x, y, z] = columns.map(|column| column.map(|x| x * scale));
            return affine([x, y, z, rng.signed3().map(|x| x * spread)]);
        }
    }
}

/// Overlapping static and moving instances of two meshes; some lie in the same place.
fn random_scene(rng: &mut SplitMix64, scale: f64) -> (Vec<Mesh>, Vec<Instance>) {
    // Large triangles through the origin's surroundings, so that most rays hit several.
    let positions = (0..36).map(|_| rng.signed3().map(to_f32)).collect();
    let large = Mesh { positions, triangles: (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect() };
    let meshes = vec![large, soup(rng.next_u64(), 12)];
    let mut instances: Vec<Instance> = (0..6)
        .map(|i| {
            let [open, close] = [(); 2].map(|()| random_map(rng, scale, 0.2 * scale));
            let moved = affine([0, 1, 2, 3].map(|j| {
                [0, 1, 2].map(|k| {
                    f64::from(open.columns[j][k])
                        + 0.02 * (f64::from(close.columns[j][k]) - f64::from(open.columns[j][k]))
                })
            }));
            if i % 3 == 2 { Instance::moving(i % 2, open, moved) } else { Instance::new(i % 2, open) }
        })
        .collect();
    instances.push(instances[0]);
    instances.swap(1, 6);
    (meshes, instances)
}

fn to_f32(x: f64) -> f32 {
    x as f32
}

fn power(exponent: i32) -> f32 {
    2.0_f32.powi(exponent)
}

#[test]
fn a_power_of_two_changes_nothing_but_t() {
    let mut rng = SplitMix64::new(21);
    let mut n_hits = 0;
    for scale in [1e-6, 1e-3, 1.0, 1e3, 1e6] {
        let (meshes, instances) = random_scene(&mut rng, scale);
        for top in tops() {
            let tlas = tlas_of(&meshes, &instances, top);
            for _ in 0..100 {
                let [origin, direction] =
                    [rng.signed3().map(|x| (0.5 * scale * x) as f32), rng.on_sphere().map(|x| x as f32)];
                // No component becomes subnormal in the shortest direction.
                let direction = direction.map(|d| if d.abs() < 1e-3 { 0.0 } else { d });
                let ray = |exponent: i32| Ray::new(origin, direction.map(|d| d * power(exponent)));
                let hit = tlas.closest_hit(&ray(0));
                n_hits += u32::from(hit.is_some());
                for exponent in [-115, -60, -7, 3, 50, 100, 127] {
                    let other = tlas.closest_hit(&ray(exponent));
                    // Exact where `t` stays normal.
                    let t = |t: f32| {
                        f64::from(t) * f64::from(power(-exponent / 2)) * f64::from(power(exponent / 2 - exponent))
                    };
                    let expected = hit.map(|hit| Hit { t: t(hit.t) as f32, ..hit }).filter(|hit| hit.t.is_finite());
                    assert_eq!(other, expected, "{scale} {exponent} {:?}", ray(exponent));
                    assert_eq!(tlas.occluded(&ray(exponent)), expected.is_some());
                }
            }
        }
    }
    assert!(n_hits > 300, "{n_hits}");
}

/// The exponents at which `t`, rounded for the caller, no longer tells instances apart, and ordinary ones.
const LENGTHS: [f32; 10] = [1e30, 1e34, 1e36, 1e38, 3e38, 2e38, 1.0, 1e-30, 1e-38, 1e-41];

#[test]
fn one_answer_where_t_is_tiny() {
    let mut rng = SplitMix64::new(22);
    let (mut n_hits, mut n_ties, mut n_bounded, mut n_other) = (0, 0, 0, 0);
    for round in 0..200 {
        let scale = [1e-6, 1e-3, 1.0][round % 3];
        let (meshes, instances) = random_scene(&mut rng, scale);
        let tlas = tops().map(|top| tlas_of(&meshes, &instances, top));
        for i in 0..40 {
            let length = LENGTHS[i % LENGTHS.len()];
            let time = [0.0, 0.3, 1.0][i % 3];
            let [origin, direction] =
                [rng.signed3().map(|x| (scale * x) as f32), rng.on_sphere().map(|x| (x * f64::from(length)) as f32)];
            let mut ray = Ray::new(origin, direction);
            if i % 4 == 3 {
                // Ends of the interval that are `t` of hits, rounded.
                let all = all_hits(&meshes, &instances, &ray, time);
                if let Some((_, hit)) = all.get(rng.below(all.len().max(1))) {
                    (ray.t_min, ray.t_max) = if i % 8 == 3 { (hit.t, f32::INFINITY) } else { (0.0, hit.t) };
                    n_bounded += 1;
                }
            }
            let expected: Vec<Hit> =
                all_hits(&meshes, &instances, &ray, time).into_iter().map(|(_, hit)| hit).collect();
            n_hits += expected.len();
            n_ties += expected.windows(2).filter(|pair| pair[0].t == pair[1].t).count();
            // Of equal rounded `t` the lowest instance is often not the first.
            let lowest = expected.iter().min_by(|a, b| {
                (a.t, a.instance, a.primitive).partial_cmp(&(b.t, b.instance, b.primitive)).expect("no NaN")
            });
            n_other += u32::from(lowest != expected.first());
            let ray = ray.at_time(time);
            for (name, tlas) in ["wide", "binary"].into_iter().zip(&tlas) {
                let hit = tlas.closest_hit(&ray);
                assert_eq!(hit, expected.first().copied(), "{name}: {ray:?} at {time}");
                assert_eq!(tlas.occluded(&ray), hit.is_some(), "{name}: {ray:?}");
                let mut all = vec![];
                tlas.all_hits(&ray, &mut all);
                assert_eq!(all, expected, "{name}: {ray:?} at {time}");
            }
        }
    }
    // The cases that matter occur: equal `t` of different hits, after rounding.
    assert!(n_hits > 5_000 && n_ties > 500 && n_bounded > 300, "{n_hits} {n_ties} {n_bounded}");
    assert!(n_other > 20, "{n_other}: rounded t would name the same instances");
}

/// Filters see the caller's `t`, and instances that they reject hide nothing.
#[test]
fn filters_see_the_callers_t() {
    let instances = [Instance::new(0, scaled(1.0)), Instance::new(0, scaled(4.0))];
    for top in tops() {
        let tlas = tlas_of(&[triangle()], &instances, top);
        let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -8.0]);
        let mut seen = vec![];
        let hit = tlas.closest_hit_with(
            &ray,
            &mut Accept(|hit: &Hit| {
                seen.push(hit.t);
                hit.instance != InstanceId(0)
            }),
        );
        assert_eq!(hit.map(|hit| (hit.t, hit.instance)), Some((0.125, InstanceId(1))));
        assert!(seen.iter().all(|&t| t == 0.125) && !seen.is_empty(), "{seen:?}");
    }
}

/// Crossings have the same order and the same `t` as hits, at any length.
#[test]
fn crossings_have_the_callers_t() {
    let mesh = canted_fixtures::icosphere(1);
    let instances = [Instance::new(0, scaled(1e-6)), Instance::new(0, scaled(2e-6))];
    let tlas = tlas_of(&[mesh], &instances, TopConfig::default());
    for length in [1.0, 1e32, 1e38] {
        let ray = Ray::new([3e-6, 1e-7, 2e-7], [-length, 0.0, 0.0]);
        let (mut crossings, mut hits) = (vec![], vec![]);
        tlas.crossings(&ray, &mut crossings);
        tlas.all_hits(&ray, &mut hits);
        assert_eq!(crossings, hits, "{length}");
        let order: Vec<_> = crossings.iter().map(|hit| hit.instance.0).collect();
        assert_eq!(order, [1, 0, 0, 1], "{length}");
    }
}
