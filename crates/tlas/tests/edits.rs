//! Changes of single instances: rays hit what they hit in a new TLAS, bit for bit, and boxes, depth and memory stay as small as they should.
//!
//! `CANTED_EDITS=1000000 cargo test --release -p canted-tlas --test edits many -- --nocapture` makes a million changes. Not covered: speed.

use canted_bvh2::Bvh2Boxes;
use canted_fixtures::{Mesh, Rotation, SplitMix64, soup, torus};
use canted_lbvh::VolumeConfig;
use canted_obb::{Aabb, Affine};
use canted_tlas::{Instance, InstanceError, Tlas, TopConfig};
use canted_trace::{Hit, InstanceId, Intersect, Ray};
use canted_wide::{Preset, TriangleBvh};

type Top = Tlas<TriangleBvh>;

fn bvh(mesh: &Mesh) -> TriangleBvh {
    TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap()
}

/// A soup, a torus, and a mesh without triangles.
fn meshes() -> Vec<TriangleBvh> {
    let none = TriangleBvh::build::<[f32; 3], u32>(&[], &[]).unwrap();
    vec![bvh(&soup(1, 12)), bvh(&torus(6, 4)), none]
}

fn affine(turn: &Rotation, scale: [f64; 3], shift: [f64; 3]) -> Affine {
    let column = |k: usize| {
        let axis = std::array::from_fn(|i| if i == k { scale[k] } else { 0.0 });
        turn.apply(axis).map(|x| x as f32)
    };
    Affine { columns: [column(0), column(1), column(2), shift.map(|x| x as f32)] }
}

/// Half the size of the world that instances are in.
const WORLD: f64 = 60.0;

fn random_map(rng: &mut SplitMix64) -> Affine {
    let turn = Rotation::euler(6.0 * rng.unit(), 6.0 * rng.unit(), 6.0 * rng.unit());
    let shift = rng.signed3().map(|x| WORLD * x);
    let mut scale: [f64; 3] = std::array::from_fn(|_| 0.2 + rng.unit());
    match rng.below(40) {
        // Hidden, and ill-conditioned: in classes of their own.
        0 => scale = [0.0; 3],
        1 => scale[0] *= 1e-2,
        2 => scale[1] *= 1e-4,
        _ => {}
    }
    affine(&turn, scale, shift)
}

fn random_instance(rng: &mut SplitMix64) -> Instance {
    let blas = [0, 0, 0, 1, 1, 1, 1, 2][rng.below(8)];
    let map = random_map(rng);
    let mut close = map;
    close.columns[3][rng.below(3)] += 0.5;
    let instance = if rng.below(8) == 0 { Instance::moving(blas, map, close) } else { Instance::new(blas, map) };
    instance.with_mask([1, 2, 3, 3, u32::MAX][rng.below(5)])
}

/// Rays through the world, from inside and outside.
fn random_rays(rng: &mut SplitMix64, n: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let far = if i.is_multiple_of(2) { 3.0 } else { 1.0 };
        let [origin, aim] = [far * WORLD, 0.7 * WORLD].map(|reach| rng.signed3().map(|x| (reach * x) as f32));
        let ray = Ray::new(origin, [0, 1, 2].map(|k| aim[k] - origin[k]));
        ray.with_mask([1, 2, u32::MAX][i % 3]).at_time(rng.unit() as f32)
    };
    (0..n).map(ray).collect()
}

fn hits(tlas: &dyn Intersect, rays: &[Ray]) -> Vec<(Option<Hit>, bool, Vec<Hit>)> {
    let ask = |ray| {
        let mut all = vec![];
        tlas.all_hits(ray, &mut all);
        (tlas.closest_hit(ray), tlas.occluded(ray), all)
    };
    rays.iter().map(ask).collect()
}

/// The greatest level of a box.
fn depth(tlas: &Top) -> u32 {
    let mut depth = 0;
    tlas.each_box(|_, level, _| depth = depth.max(level));
    depth
}

/// Least and greatest z of all instances; boxes are rounded outward.
fn ends_z(tlas: &Top) -> [f32; 2] {
    let Aabb { min, max } = tlas.aabb();
    [min[2], max[2]].map(f32::round)
}

/// Compares with a new TLAS; returns the number of hits.
fn check(tlas: &Top, placed: &[Instance], rays: &[Ray], what: &str) -> usize {
    assert_eq!(tlas.instances(), placed, "{what}");
    let fresh = Tlas::new(tlas.blas().to_vec(), placed, tlas.config().clone()).unwrap();
    assert_eq!((tlas.aabb(), tlas.bounds()), (fresh.aabb(), fresh.bounds()), "{what}");
    assert_eq!(tlas.n_instances(), fresh.n_instances(), "{what}");
    let found = hits(tlas, rays);
    assert!(found == hits(&fresh, rays), "{what}");
    found.iter().map(|(.., all)| all.len()).sum()
}

/// A list that changes as the documentation says.
struct Model {
    placed: Vec<Instance>,
    removed: Vec<usize>,
}

impl Model {
    fn new(placed: &[Instance]) -> Self {
        Self { placed: placed.to_vec(), removed: vec![] }
    }

    /// A random change of the TLAS and of the list.
    fn change(&mut self, tlas: &mut Top, rng: &mut SplitMix64) {
        let kind = rng.below(10);
        // The number of instances stays near the first.
        if kind == 0 || kind == 1 && self.removed.len() > 60 {
            let new = random_instance(rng);
            let i = self.removed.pop().unwrap_or(self.placed.len());
            assert_eq!(tlas.insert(new), Ok(InstanceId(i as u32)));
            if i == self.placed.len() {
                self.placed.push(new)
            } else {
                self.placed[i] = new
            }
            return;
        }
        let i = rng.below(self.placed.len());
        let (id, old) = (InstanceId(i as u32), self.placed[i]);
        if old.is_removed() {
            let error = InstanceError::NoSuchInstance { instance: i, n_instances: tlas.n_instances() };
            assert_eq!(tlas.set_mask(id, 1), Err(error));
            assert_eq!(tlas.remove(id), Err(error));
            return;
        }
        match kind {
            1 | 2 => {
                assert_eq!(tlas.remove(id), Ok(old));
                self.placed[i] = Instance::REMOVED;
                self.removed.push(i);
            }
            3 => {
                self.placed[i] = random_instance(rng);
                tlas.set_instance(id, self.placed[i]).unwrap();
            }
            4 => {
                self.placed[i].mask = [1, 2, u32::MAX][rng.below(3)];
                tlas.set_mask(id, self.placed[i].mask).unwrap();
            }
            // Far away, or a step.
            5 => {
                let map = random_map(rng);
                self.placed[i] = Instance { world_from_object: map, world_from_object_close: None, ..old };
                tlas.set_transform(id, map).unwrap();
            }
            _ => {
                let mut map = old.world_from_object;
                rng.signed3().into_iter().enumerate().for_each(|(k, x)| map.columns[3][k] += x as f32);
                self.placed[i] = Instance { world_from_object: map, world_from_object_close: None, ..old };
                tlas.set_transform(id, map).unwrap();
            }
        }
    }
}

#[test]
#[expect(clippy::print_stdout, reason = "a long run reports what it found")]
fn many_changes_equal_a_new_tlas() {
    const N: usize = 10_000;
    let n_edits: usize = std::env::var("CANTED_EDITS").map_or(4000, |n| n.parse().expect("a number of changes"));
    let mut rng = SplitMix64::new(46);
    let placed: Vec<Instance> = (0..N).map(|_| random_instance(&mut rng)).collect();
    let mut tlas = Tlas::new(meshes(), &placed, TopConfig::default()).unwrap();
    let (built, mut model) = (depth(&tlas), Model::new(&placed));
    let (mut n_hits, mut n_bytes) = (0, 0);
    let n_checks = (n_edits / 20_000).max(8);
    for round in 0..n_checks {
        tlas.replace_blas(0, bvh(&soup(round as u64, 12))).unwrap();
        for i in 0..n_edits / n_checks {
            model.change(&mut tlas, &mut rng);
            if i % 100 == 0 {
                // Rays between changes see all of them.
                let id = InstanceId(rng.below(model.placed.len()) as u32);
                let map = tlas.instances()[id.index()].world_from_object;
                n_hits += usize::from(tlas.occluded(&Ray::new([0.0; 3], map.columns[3])));
            }
        }
        n_hits += check(&tlas, &model.placed, &random_rays(&mut rng, 150), &format!("round {round}"));
        // Of a class; the root is level 0.
        let most = (built + 1).max(model.placed.len().ilog2() + 2);
        assert!(depth(&tlas) < most, "round {round}: {} of {most}", depth(&tlas));
        if round == 0 {
            n_bytes = tlas.n_bytes();
        }
        assert!(tlas.n_bytes() <= n_bytes + n_bytes / 2, "round {round}: {} of {n_bytes} bytes", tlas.n_bytes());
    }
    assert!(n_hits > 1000, "{n_hits}");
    let (edits, [now, first], drift) = (n_edits / n_checks * n_checks, [tlas.n_bytes(), n_bytes], tlas.drift());
    println!(
        "{edits} changes of {N} instances, compared {n_checks} times: drift {drift}, depth {} of {built}, {now} bytes, {first} after the first part",
        depth(&tlas)
    );
    // The file, a copy and a rebuilt one have the same hits.
    let rays = random_rays(&mut rng, 300);
    let want = hits(&tlas, &rays);
    let loaded = Top::from_bytes(&tlas.to_bytes(), TopConfig::default()).unwrap();
    assert_eq!(loaded.n_instances(), tlas.n_instances());
    let copy = tlas.clone();
    let mut on_threads = vec![None; rays.len()];
    copy.par_closest_hits(&rays, &mut on_threads);
    assert!(on_threads.iter().zip(&want).all(|(hit, (closest, ..))| hit == closest));
    assert!(hits(&loaded, &rays) == want && hits(&copy, &rays) == want);
    model.change(&mut tlas, &mut rng);
    tlas.rebuild();
    assert_eq!((tlas.drift(), tlas.rebuild_advised()), (1.0, false));
    check(&tlas, &model.placed, &rays, "rebuilt");
    assert!(hits(&copy, &rays) == want);
    assert_eq!(loaded.to_bytes(), copy.to_bytes());
}

/// With few instances, other top levels, and batches between.
#[test]
fn small_scenes_equal_a_new_tlas() {
    let binary = TopConfig::other(Bvh2Boxes::builder(VolumeConfig::default()));
    for (number, config) in
        [TopConfig::default(), TopConfig::Wide(Preset::Quality.into()), binary].into_iter().enumerate()
    {
        for n in [0, 1, 3, 30] {
            let mut rng = SplitMix64::new(n as u64);
            let placed: Vec<Instance> = (0..n).map(|_| random_instance(&mut rng)).collect();
            let mut tlas = Tlas::new(meshes(), &placed, config.clone()).unwrap();
            let mut model = Model::new(&placed);
            for step in 0..120 {
                let what = format!("{number}, {n}, step {step}");
                if model.placed.is_empty() || step % 7 == 0 {
                    let (mut edit, mut new) = (tlas.edit(), vec![]);
                    for _ in 0..rng.below(4) {
                        new.push((InstanceId(model.placed.len() as u32), random_instance(&mut rng)));
                        let placed = random_instance(&mut rng);
                        let i = model.removed.pop().unwrap_or(model.placed.len());
                        assert_eq!(edit.insert(placed), Ok(InstanceId(i as u32)));
                        if i == model.placed.len() { model.placed.push(placed) } else { model.placed[i] = placed }
                    }
                    let exists = |&(id, _): &(InstanceId, Instance)| {
                        model.placed.get(id.index()).is_some_and(|instance| !instance.is_removed())
                    };
                    new.retain(exists);
                    edit.set_each(&new).unwrap();
                    new.iter().for_each(|(id, instance)| model.placed[id.index()] = *instance);
                    drop(edit);
                } else if step % 11 == 3 {
                    // Instances of the empty mesh appear, or others disappear.
                    tlas.replace_blas(rng.below(3) as u32, meshes().swap_remove(rng.below(3))).unwrap();
                } else {
                    model.change(&mut tlas, &mut rng);
                }
                check(&tlas, &model.placed, &random_rays(&mut rng, 12), &what);
            }
            // All leave.
            for i in 0..model.placed.len() {
                if !model.placed[i].is_removed() {
                    tlas.remove(InstanceId(i as u32)).unwrap();
                    model.placed[i] = Instance::REMOVED;
                }
            }
            check(&tlas, &model.placed, &random_rays(&mut rng, 12), "none");
            assert_eq!((tlas.n_instances(), tlas.aabb()), (0, Aabb::EMPTY));
            let last = InstanceId(tlas.insert(Instance::new(0, Affine::IDENTITY)).unwrap().0);
            model.placed[last.index()] = Instance::new(0, Affine::IDENTITY);
            check(&tlas, &model.placed, &random_rays(&mut rng, 12), "one");
        }
    }
}

fn plate(z: f32) -> TriangleBvh {
    TriangleBvh::build(&[[-1.0, -1.0, z], [3.0, -1.0, z], [-1.0, 3.0, z]], &[[0, 1, 2]]).unwrap()
}

#[test]
fn a_scale_by_zero_hides_an_instance_until_it_moves() {
    let at = |z: f32| Affine::translation([0.0, 0.0, z]);
    let zero = Affine { columns: [[0.0; 3], [0.0; 3], [-0.0; 3], [0.0, 0.0, 2.0]] };
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    let hit = |tlas: &Top| tlas.closest_hit(&ray).map(|hit| (hit.t, hit.instance.0));
    let [near, far] = [3.0, 5.0].map(|z| Instance::new(0, at(z)));
    let mut tlas = Tlas::new(vec![plate(0.0)], &[near, far], TopConfig::default()).unwrap();
    tlas.set_transform(InstanceId(0), zero).unwrap();
    assert_eq!((hit(&tlas), ends_z(&tlas), tlas.n_instances()), (Some((5.0, 1)), [5.0; 2], 2));
    assert_eq!(tlas.instances()[0].world_from_object, zero);
    // A mask does not show it.
    tlas.set_mask(InstanceId(0), u32::MAX).unwrap();
    assert_eq!(hit(&tlas), Some((5.0, 1)));
    tlas.set_transform(InstanceId(0), at(1.0)).unwrap();
    assert_eq!((hit(&tlas), ends_z(&tlas)), (Some((1.0, 0)), [1.0, 5.0]));
    // As a new instance, and at both ends of a motion; one end is an error.
    let hidden = Instance::new(0, zero);
    let tlas =
        Tlas::new(vec![plate(0.0)], &[hidden, Instance::moving(0, zero, zero), far], TopConfig::default()).unwrap();
    assert_eq!((hit(&tlas), ends_z(&tlas)), (Some((5.0, 2)), [5.0; 2]));
    let tlas = Tlas::new(vec![plate(0.0)], &[hidden], TopConfig::default()).unwrap();
    assert_eq!((hit(&tlas), tlas.aabb(), tlas.is_empty()), (None, Aabb::EMPTY, true));
    let half = Tlas::new(vec![plate(0.0)], &[Instance::moving(0, zero, at(1.0))], TopConfig::default());
    assert!(matches!(half, Err(InstanceError::IllConditionedAt { instance: 0, .. })));
    let mut lost = zero;
    lost.columns[3][1] = f32::NAN;
    let lost = Tlas::new(vec![plate(0.0)], &[Instance::new(0, lost)], TopConfig::default());
    assert!(matches!(lost, Err(InstanceError::NotFinite { instance: 0 })));
}

/// A mesh without triangles, and one that loses and gets them.
/// Far more in one edit than there were, of which the last alone can be hit.
#[test]
fn many_hidden_instances_and_one_that_is_not_come_at_once() {
    let at = |z: f32| Instance::new(0, Affine::translation([0.0, 0.0, z]));
    let hidden = Instance::new(0, Affine::scale([0.0; 3]));
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    let mut tlas = Tlas::new(vec![plate(0.0)], &[at(5.0); 10], TopConfig::default()).unwrap();
    tlas.set_transform(InstanceId(0), Affine::translation([0.0, 0.0, 4.0])).unwrap();
    let mut edit = tlas.edit();
    for _ in 0..300 {
        edit.insert(hidden).unwrap();
    }
    let near = edit.insert(at(3.0)).unwrap();
    edit.refit();
    assert_eq!(tlas.closest_hit(&ray).map(|hit| (hit.t, hit.instance)), Some((3.0, near)));
    assert_eq!(ends_z(&tlas), [3.0, 5.0]);
    tlas.remove(near).unwrap();
    assert_eq!((tlas.closest_hit(&ray).map(|hit| hit.t), ends_z(&tlas)), (Some(4.0), [4.0, 5.0]));
}

#[test]
fn instances_of_empty_meshes_have_no_bounds() {
    let none = || TriangleBvh::build::<[f32; 3], u32>(&[], &[]).unwrap();
    let at = |z: f32| Affine::translation([0.0, 0.0, z]);
    let placed = [Instance::new(0, at(-50.0)), Instance::new(1, at(5.0))];
    let mut tlas = Tlas::new(vec![none(), plate(0.0)], &placed, TopConfig::default()).unwrap();
    assert_eq!(ends_z(&tlas), [5.0; 2]);
    tlas.update_blas(0, |bvh| *bvh = plate(0.0)).unwrap();
    assert_eq!(ends_z(&tlas), [-50.0, 5.0]);
    let ray = Ray::new([0.0; 3], [0.0, 0.0, -1.0]);
    assert_eq!(tlas.closest_hit(&ray).map(|hit| (hit.t, hit.instance.0)), Some((50.0, 0)));
    drop(tlas.replace_blas(0, none()).unwrap());
    assert_eq!((ends_z(&tlas), tlas.closest_hit(&ray)), ([5.0; 2], None));
    drop(tlas.replace_blas(1, none()).unwrap());
    assert!(tlas.is_empty() && tlas.aabb().is_empty());
    // Below another TLAS.
    let outer = Tlas::new(vec![tlas], &[Instance::new(0, at(9.0))], TopConfig::default()).unwrap();
    assert_eq!((outer.aabb(), outer.closest_hit(&ray)), (Aabb::EMPTY, None));
}

#[test]
fn removed_instances_keep_their_place_for_the_next() {
    let at = |x: f32| Instance::new(0, Affine::translation([10.0 * x, 0.0, 0.0]));
    let mut tlas = Tlas::new(vec![plate(0.0)], &[0.0, 1.0, 2.0, 3.0].map(at), TopConfig::default()).unwrap();
    let seen = |tlas: &Top| {
        let ray = |x: f32| Ray::new([10.0 * x, 0.0, 1.0], [0.0, 0.0, -1.0]);
        [0.0, 1.0, 2.0, 3.0, 4.0].map(|x| tlas.closest_hit(&ray(x)).map(|hit| hit.instance.0))
    };
    assert_eq!(tlas.remove(InstanceId(1)), Ok(at(1.0)));
    assert_eq!(tlas.remove(InstanceId(2)), Ok(at(2.0)));
    assert_eq!((seen(&tlas), tlas.n_instances()), ([Some(0), None, None, Some(3), None], 2));
    assert_eq!(tlas.instances(), [at(0.0), Instance::REMOVED, Instance::REMOVED, at(3.0)]);
    // A new TLAS of the same list, and the file, have the same numbers.
    let new = Tlas::new(vec![plate(0.0)], tlas.instances(), TopConfig::default()).unwrap();
    let loaded = Top::from_bytes(&tlas.to_bytes(), TopConfig::default()).unwrap();
    for mut other in [new, loaded] {
        assert_eq!((seen(&other), other.n_instances()), (seen(&tlas), 2));
        assert_eq!(other.insert(at(4.0)), Ok(InstanceId(1)));
    }
    let n_bytes = tlas.n_bytes();
    for _ in 0..100 {
        assert_eq!(tlas.insert(at(4.0)), Ok(InstanceId(2)));
        assert_eq!(tlas.remove(InstanceId(2)), Ok(at(4.0)));
    }
    assert!(tlas.n_bytes() <= n_bytes + 256, "{n_bytes}, then {}", tlas.n_bytes());
    assert_eq!([at(4.0), at(1.0)].map(|new| tlas.insert(new).unwrap().0), [2, 1]);
    assert_eq!(seen(&tlas), [Some(0), Some(1), None, Some(3), Some(2)]);
    assert_eq!(tlas.insert(at(2.0)), Ok(InstanceId(4)));
    let missing = InstanceError::NoSuchInstance { instance: 5, n_instances: 5 };
    assert_eq!(tlas.remove(InstanceId(5)), Err(missing));
    // What marks a removed instance is none that can be inserted.
    let no_blas = |instance| Err(InstanceError::NoSuchBlas { instance, blas: u32::MAX });
    assert_eq!(tlas.insert(Instance::REMOVED).map(|_| ()), no_blas(5));
    assert_eq!(tlas.set_instance(InstanceId(0), Instance::REMOVED), no_blas(0));
    assert_eq!(
        tlas.insert(Instance::new(7, Affine::IDENTITY)),
        Err(InstanceError::NoSuchBlas { instance: 5, blas: 7 })
    );
    assert_eq!(tlas.n_instances(), 5);
}
