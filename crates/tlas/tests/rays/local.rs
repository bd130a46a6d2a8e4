//! Box tests of the top level depend on the instance in the box, not on the worst of all.

use canted_bvh2::Bvh2Boxes;
use canted_fixtures::{Mesh, SplitMix64, soup};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Counts, InstanceId, Intersect, Ray};
use canted_wide::TriangleBvh;

use crate::oracle::{affine, all_hits};

/// By how much one more instance may raise the number of box tests.
const MOST: f64 = 1.5;

fn tops() -> [TopConfig; 3] {
    let binary = |strategy| TopConfig::other(Bvh2Boxes::builder(VolumeConfig { strategy, ..VolumeConfig::default() }));
    [TopConfig::default(), binary(Strategy::Aabb), binary(Strategy::PcaBounded)]
}

/// A rotation about z with scale, at a place.
fn placed(angle: f64, scale: f64, at: [f64; 3]) -> Affine {
    let (sine, cosine) = angle.sin_cos();
    affine([[scale * cosine, scale * sine, 0.0], [-scale * sine, scale * cosine, 0.0], [0.0, 0.0, scale], at])
}

/// 2,000 instances in a field of 100 by 100.
fn field(rng: &mut SplitMix64) -> Vec<Instance> {
    (0..2_000)
        .map(|_| {
            let [x, y, z] = rng.signed3();
            Instance::new(0, placed(3.0 * rng.unit(), 0.5 + 0.5 * rng.unit(), [50.0 * x, 50.0 * y, z]))
        })
        .collect()
}

fn mesh() -> Mesh {
    soup(3, 40).placed(|p| p.map(|x| x - 0.5))
}

fn rays(rng: &mut SplitMix64, n: usize) -> Vec<Ray> {
    let mut ray = || {
        let ([x, y, z], d) = (rng.signed3(), rng.on_sphere());
        Ray::new([(40.0 * x) as f32, (40.0 * y) as f32, z as f32], [d[0] as f32, d[1] as f32, (0.05 * d[2]) as f32])
    };
    (0..n).map(|_| ray()).collect()
}

fn tlas(instances: &[Instance], top: &TopConfig) -> Tlas<TriangleBvh> {
    let mesh = mesh();
    let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap();
    Tlas::new(vec![bvh], instances, top.clone()).unwrap()
}

/// Box tests a ray; the first rays' hits are compared with the loop.
fn n_boxes(tlas: &Tlas<TriangleBvh>, rays: &[Ray], n_checked: usize) -> f64 {
    let mut counts = Counts::default();
    for (i, ray) in rays.iter().enumerate() {
        let hit = tlas.closest_hit_with(ray, &mut counts);
        if i < n_checked {
            let all = all_hits(&[mesh()], tlas.instances(), ray, 0.0);
            assert_eq!(hit, all.first().map(|&(_, hit)| hit), "{ray:?}");
        }
    }
    counts.boxes as f64 / rays.len() as f64
}

/// A shear of condition 2^19, thin and small, in a corner of the field.
fn ill_conditioned(at: [f64; 3]) -> Affine {
    let long = 700.0;
    affine([[1.0, 0.0, 0.0], [long, 1.0, 0.0], [0.0, 0.0, 1.0], at])
}

#[test]
fn one_unusual_instance_does_not_slow_the_others() {
    let mut rng = SplitMix64::new(31);
    let (field, rays) = (field(&mut rng), rays(&mut rng, 1_000));
    let flat = affine([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0 / 524_288.0], [0.0, 0.0, -9.0]]);
    let unusual = [
        ("at 1e8", Instance::new(0, placed(0.3, 1.0, [1e8, -1e8, 3e7]))),
        ("of size 1e6, far below", Instance::new(0, placed(0.3, 1e6, [0.0, 0.0, -9e6]))),
        ("flat, of condition 2^19", Instance::new(0, flat)),
        ("sheared, of condition 2^19", Instance::new(0, ill_conditioned([45.0, 45.0, -9.0]))),
        ("moving, of condition 2^19", Instance::moving(0, flat, placed(0.0, 1.0, [0.0, 0.0, -12.0]))),
    ];
    for top in tops() {
        let alone = n_boxes(&tlas(&field, &top), &rays, 0);
        for (what, instance) in unusual {
            let all = [&field[..], &[instance]].concat();
            let n_checked = if matches!(top, TopConfig::Wide(_)) { 25 } else { 5 };
            let together = n_boxes(&tlas(&all, &top), &rays, n_checked);
            assert!(together <= MOST * alone, "{what}, {top:?}: {together} box tests a ray instead of {alone}");
        }
    }
}

/// A field far from the origin of the world is traced as one at the origin, as far as `f32` holds the places of its instances; so is one
/// whose mesh is far from the origin of object space, and where instances move there.
#[test]
fn a_distant_field_is_as_fast_as_one_at_the_origin() {
    let mut rng = SplitMix64::new(33);
    let (field, rays) = (field(&mut rng), rays(&mut rng, 500));
    for top in tops() {
        let alone = n_boxes(&tlas(&field, &top), &rays, 0);
        for at in [[1e4, 2e4, -3e4], [0.0, -2e5, 1e5]] {
            let (field, rays) = (shifted(&field, at), shifted_rays(&rays, at));
            let away = n_boxes(&tlas(&field, &top), &rays, 5);
            assert!(away <= MOST * alone, "at {at:?}, {top:?}: {away} box tests a ray instead of {alone}");
        }
        // Moved there, without a build.
        let mut moved = tlas(&field, &top);
        let at = [-5e4, 3e4, 2e4];
        let mut edit = moved.edit();
        for (i, instance) in (0..).zip(shifted(&field, at)) {
            edit.set_transform(InstanceId(i), instance.world_from_object).unwrap();
        }
        edit.refit();
        let after = n_boxes(&moved, &shifted_rays(&rays, at), 5);
        assert!(after <= MOST * alone, "moved, {top:?}: {after} box tests a ray instead of {alone}");
    }
}

fn shifted(instances: &[Instance], at: [f64; 3]) -> Vec<Instance> {
    let shift = |instance: &Instance| {
        let mut instance = *instance;
        let origin = &mut instance.world_from_object.columns[3];
        origin.iter_mut().zip(at).for_each(|(x, shift)| *x += shift as f32);
        instance
    };
    instances.iter().map(shift).collect()
}

fn shifted_rays(rays: &[Ray], at: [f64; 3]) -> Vec<Ray> {
    rays.iter().map(|ray| Ray { origin: [0, 1, 2].map(|k| ray.origin[k] + at[k] as f32), ..*ray }).collect()
}

/// An edit that makes an instance unusual, and one that makes it usual again, leave the top level as fast as a new one.
#[test]
fn an_edited_instance_does_not_slow_the_others() {
    let mut rng = SplitMix64::new(32);
    let (field, rays) = (field(&mut rng), rays(&mut rng, 500));
    for top in tops() {
        let mut tlas = tlas(&field, &top);
        let before = n_boxes(&tlas, &rays, 3);
        for map in [ill_conditioned([45.0, 45.0, -9.0]), placed(0.3, 1.0, [1e8, 0.0, 0.0]), placed(0.1, 1.0, [0.0; 3])]
        {
            tlas.set_transform(InstanceId(7), map).unwrap();
            let after = n_boxes(&tlas, &rays, 3);
            assert!(after <= MOST * before, "{map:?}: {after} box tests a ray instead of {before}");
        }
    }
}
