//! Every kind of query against a loop over all instances and all their triangles.

use canted_fixtures::{SplitMix64, thin_box};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::{Affine, PrimId};
use canted_tests::brute;
use canted_tests::instances::{At, ray_object};
use canted_tlas::{Blas, Instance, RayOptions, Tlas, TopConfig};
use canted_trace::{Counts, Hit, InstanceId, Kernel, Query, Ray, ScaledRay, Side, Watertight};
use canted_wide::{Config, TriangleBvh};

use super::altered::Altered;
use super::setup::{affine, all_rays, blas_of, build, crowd, instances, meshes};

type Bvh = canted_bvh2::Bvh2<Watertight>;

pub(crate) fn tops() -> [TopConfig; 2] {
    [TopConfig::default(), TopConfig::Binary(VolumeConfig { strategy: Strategy::Combined, fallback: true })]
}

pub(crate) fn bottom() -> Vec<Bvh> {
    meshes().iter().map(|mesh| build(mesh, Strategy::Dop)).collect()
}

/// Every hit of a ray on every triangle of every instance: least `t` first, then lowest (instance, primitive).
fn loop_over_all(placed: &[Affine], ray: &Ray) -> Vec<Hit> {
    let records = meshes().map(|mesh| brute::records::<Watertight>(&mesh.positions, &mesh.triangles));
    let mut hits = vec![];
    for (i, world_from_object) in placed.iter().enumerate() {
        let Some(ray) = ScaledRay::new(&ray_object(world_from_object, ray)) else { continue };
        let prepared = Watertight::prepare(&ray);
        for (primitive, record) in (0..).map(PrimId).zip(&records[blas_of(i)]) {
            if let Some(hit) = Watertight::intersect(&prepared, &ray, record, ray.t_max) {
                let instance = InstanceId(u32::try_from(i).unwrap());
                hits.push(Hit { t: ray.caller_t(hit.t), u: hit.u, v: hit.v, primitive, instance, side: hit.side });
            }
        }
    }
    hits.sort_by(|a, b| if a.before(b) { std::cmp::Ordering::Less } else { std::cmp::Ordering::Greater });
    hits
}

/// Rays at all instances, some with directions of other lengths, some with negative zeros.
fn rays(placed: &[Affine], n: usize) -> Vec<Ray> {
    let mut rng = SplitMix64::new(3);
    let mut rays = all_rays(placed, n);
    for ray in &mut rays {
        #[expect(clippy::cast_possible_truncation, reason = "test data")]
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

/// The first ray whose queries disagree with `want`, which lists the hits of each ray.
fn first_difference<B: Blas, Q: Query>(
    tlas: &Tlas<B>,
    rays: &[Ray],
    query: impl Fn(usize, &Ray) -> Q,
    want: impl Fn(usize, &Ray) -> Vec<Hit>,
) -> Option<String> {
    let mut hits = vec![];
    rays.iter().enumerate().find_map(|(i, ray)| {
        let want = want(i, ray);
        tlas.all_hits_with(ray, &mut query(i, ray), &mut hits);
        let closest = tlas.closest_hit_with(ray, &mut query(i, ray));
        let occluded = tlas.occluded_with(ray, &mut query(i, ray));
        let agrees = hits == want && closest == want.first().copied() && occluded != want.is_empty();
        (!agrees).then(|| format!("{ray:?}: {closest:?}, {occluded}, {hits:?}, not {want:?}"))
    })
}

#[test]
fn all_hits_equal_the_loop() {
    let placed = crowd();
    let rays = rays(&placed, 6);
    let n_hits: usize = rays.iter().map(|ray| loop_over_all(&placed, ray).len()).sum();
    assert!(n_hits > 2 * rays.len(), "{n_hits} hits of {} rays", rays.len());
    for top in tops() {
        let tlas = Tlas::new(bottom(), &instances(&placed), top).unwrap();
        assert_eq!(first_difference(&tlas, &rays, |_, _| (), |_, ray| loop_over_all(&placed, ray)), None);
        let wide = meshes().map(|m| TriangleBvh::build(&m.positions, &m.triangles, &Config::default()).unwrap());
        let tlas: Tlas<TriangleBvh> = Tlas::new(wide.into(), &instances(&placed), top).unwrap();
        assert_eq!(first_difference(&tlas, &rays, |_, _| (), |_, ray| loop_over_all(&placed, ray)), None);
    }
}

#[test]
fn the_check_detects_lost_hits_and_wrong_masks() {
    let placed = crowd();
    let rays = rays(&placed, 4);
    for top in tops() {
        let lost = Tlas::new(bottom().into_iter().map(Altered::shrunk).collect(), &instances(&placed), top).unwrap();
        assert!(first_difference(&lost, &rays, |_, _| (), |_, ray| loop_over_all(&placed, ray)).is_some());
        let mut hidden = instances(&placed);
        hidden[12].mask = 1;
        let hidden = Tlas::new(bottom(), &hidden, top).unwrap();
        let seen = first_difference(&hidden, &rays, |_, _| RayOptions::mask(1), |_, ray| loop_over_all(&placed, ray));
        assert_eq!(seen, None);
        let seen = first_difference(&hidden, &rays, |_, _| RayOptions::mask(2), |_, ray| loop_over_all(&placed, ray));
        assert!(seen.is_some());
    }
}

#[test]
fn squashed_instances_of_flat_meshes_are_hit() {
    let plate = thin_box(0.0);
    let squashed = affine(&canted_fixtures::Rotation::off_axis(), [1.0, 1.0, 1e-5], [0.5, 0.0, 0.0]);
    let placed = [Affine::IDENTITY, squashed, squashed];
    let bvh: Bvh = build(&plate, Strategy::Aabb);
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
    let want = |i: usize, ray: &Ray| {
        let mut hits = loop_over_all(&placed, ray);
        hits.retain(|hit| masks[hit.instance.0 as usize] & of_ray(i) != 0);
        hits
    };
    for top in tops() {
        let tlas = Tlas::new(bottom(), &masked, top).unwrap();
        assert_eq!(tlas.instances(), masked);
        assert_eq!(first_difference(&tlas, &rays, |i, _| RayOptions::mask(of_ray(i)), want), None);
    }
}

#[test]
fn filters_see_every_ray_and_hit() {
    let placed = crowd();
    let rays = rays(&placed, 3);
    let accepts = |i: usize, hit: &Hit| ((hit.primitive.0 + hit.instance.0) as usize + i).is_multiple_of(3);
    let tlas = Tlas::new(bottom(), &instances(&placed), TopConfig::default()).unwrap();
    let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    tlas.par_closest_hits_where(&rays, &mut hits, |i, _, hit| accepts(i, hit));
    tlas.par_occluded_many_where(&rays, &mut occluded, |i, _, hit| accepts(i, hit));
    let (mut serial_hits, mut serial_occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    tlas.closest_hits_where(&rays, &mut serial_hits, |i, _, hit| accepts(i, hit));
    tlas.occluded_many_where(&rays, &mut serial_occluded, |i, _, hit| accepts(i, hit));
    assert_eq!((&serial_hits, &serial_occluded), (&hits, &occluded));
    let (mut many, mut par_many) = (vec![vec![]; rays.len()], vec![vec![]; rays.len()]);
    tlas.all_hits_many_where(&rays, &mut many, |i, _, hit| accepts(i, hit));
    tlas.par_all_hits_many_where(&rays, &mut par_many, |i, _, hit| accepts(i, hit));
    assert_eq!(many, par_many);
    let mut all = vec![];
    for (i, ray) in rays.iter().enumerate() {
        let mut want = loop_over_all(&placed, ray);
        want.retain(|hit| accepts(i, hit));
        tlas.all_hits_where(ray, &mut all, |_, hit| accepts(i, hit));
        assert_eq!((&all, &many[i]), (&want, &want), "{ray:?}");
        assert_eq!((hits[i], occluded[i]), (want.first().copied(), !want.is_empty()), "{ray:?}");
        assert_eq!(tlas.closest_hit_where(ray, |_, hit| accepts(i, hit)), hits[i]);
        assert_eq!(tlas.occluded_where(ray, |_, hit| accepts(i, hit)), occluded[i]);
    }
}

#[test]
fn slices_equal_single_rays() {
    let placed = crowd();
    let rays = rays(&placed, 9);
    // More than one chunk, and not a multiple of one.
    assert!(rays.len() > 2048 && !rays.len().is_multiple_of(1024), "{}", rays.len());
    let tlas = Tlas::new(bottom(), &instances(&placed), TopConfig::default()).unwrap();
    let n = rays.len();
    let (mut closest, mut occluded, mut all) = (vec![None; n], vec![false; n], vec![vec![]; n]);
    for is_parallel in [false, true] {
        if is_parallel {
            tlas.par_closest_hits(&rays, &mut closest);
            tlas.par_occluded_many(&rays, &mut occluded);
            tlas.par_all_hits_many(&rays, &mut all);
        } else {
            tlas.closest_hits(&rays, &mut closest);
            tlas.occluded_many(&rays, &mut occluded);
            tlas.all_hits_many(&rays, &mut all);
        }
        let mut hits = vec![];
        for (i, ray) in rays.iter().enumerate() {
            tlas.all_hits(ray, &mut hits);
            assert_eq!((closest[i], occluded[i], &all[i]), (tlas.closest_hit(ray), tlas.occluded(ray), &hits));
        }
    }
    let masks: Vec<u32> = (0..n).map(|i| u32::try_from(i % 2).unwrap()).collect();
    tlas.par_all_hits_many_with(&rays, &mut all, |i, _| RayOptions::mask(masks[i]));
    assert!(all.iter().step_by(2).all(Vec::is_empty) && all.iter().any(|hits| !hits.is_empty()));
}

#[test]
#[should_panic = "one result for each ray"]
fn slices_of_other_lengths_panic() {
    let tlas = Tlas::new(bottom(), &[], TopConfig::default()).unwrap();
    tlas.par_closest_hits(&[Ray::new([0.0; 3], [1.0, 0.0, 0.0])], &mut []);
}

#[test]
fn rays_see_moving_instances_at_their_time() {
    // Shifts by whole numbers, so that every position is exact.
    let at = |x: f32| affine(&canted_fixtures::Rotation::IDENTITY, [1.0; 3], [x, 0.0, 0.0]);
    let moving = [Instance::moving(0, at(0.0), at(8.0)), Instance::moving(1, at(2.0), at(-6.0)).with_mask(2)];
    for time in [0.0, 0.25, 1.0] {
        let placed = [at(8.0 * time), at(2.0 - 8.0 * time)];
        let rays = all_rays(&placed, 20);
        for top in tops() {
            let tlas = Tlas::new(bottom(), &moving, top).unwrap();
            assert_eq!(first_difference(&tlas, &rays, |_, _| At(time), |_, ray| loop_over_all(&placed, ray)), None);
            let first_alone = |_, ray: &Ray| loop_over_all(&placed[..1], ray);
            assert_eq!(first_difference(&tlas, &rays, |_, _| RayOptions { mask: 1, time }, first_alone), None);
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
