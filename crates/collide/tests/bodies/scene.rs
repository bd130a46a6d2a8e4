//! Instances against instances, and bodies against scenes: loops over all pairs, by integers where triangles are tested.

use std::sync::Arc;

use canted_collide::{
    Capsule, Contacts, Hull, Pose, closest_instance_pairs, count_pairs, count_touching, distance, first_pair,
    first_touching, instance_pairs, overlaps, pairs, touches, touching,
};
use canted_obb::{Aabb, Affine, Obb, PrimId};
use canted_tlas::{Instance, Tlas};
use canted_trace::{InstanceId, Sphere};
use canted_wide::{Preset, TriangleBvh, WideBvh};

use crate::common::{Random, Triangle, bvh, config_of, posed, soup, truth};

fn maps(random: &mut Random, n: usize, spread: f32) -> Vec<Instance> {
    (0..n)
        .map(|i| {
            let [x, y, z] = random.point().map(|x| spread * x);
            let turn = Affine::rotation([1.0, 0.3 * i as f32, -0.5], i as f64);
            let scale = if i % 4 == 0 { [-1.0, 0.5, 1.0] } else { [0.7; 3] };
            Instance::new((i % 2) as u32, Affine::scale(scale).then(&turn).then(&Affine::translation([x, y, z])))
        })
        .collect()
}

struct Scene {
    meshes: [Vec<Triangle>; 2],
    tlas: Tlas<Arc<TriangleBvh>>,
}

impl Scene {
    fn new(instances: &[Instance]) -> Self {
        let meshes = [soup(14, 0.3, 1), soup(9, 0.4, 2)];
        let blas = meshes.each_ref().map(|mesh| Arc::new(bvh(mesh, config_of(Preset::Balanced)))).to_vec();
        Self { meshes, tlas: Tlas::new(blas, instances, Default::default()).unwrap() }
    }

    fn triangles(&self, id: u32) -> Vec<[[f64; 3]; 3]> {
        let given = &self.tlas.instances()[id as usize];
        if given.mask == 0 || given.is_removed() || given.world_from_object == Affine::scale([0.0; 3]) {
            return vec![];
        }
        posed(&self.meshes[given.blas as usize], Pose::from(given.world_from_object))
    }

    /// Every two instances, every two triangles.
    fn truth(&self) -> Vec<[InstanceId; 2]> {
        let all: Vec<_> = (0..self.tlas.instances().len() as u32).map(|id| self.triangles(id)).collect();
        let mut found = vec![];
        for (i, a) in all.iter().enumerate() {
            for (j, b) in all.iter().enumerate().skip(i + 1) {
                if !truth(a, b).is_empty() {
                    found.push([InstanceId(i as u32), InstanceId(j as u32)]);
                }
            }
        }
        found
    }
}

fn found(scene: &Scene) -> Vec<[InstanceId; 2]> {
    let mut found = vec![];
    instance_pairs(&scene.tlas, &mut found);
    found
}

#[test]
fn touching_instances_are_those_of_a_loop() {
    let mut random = Random(7);
    let mut instances = maps(&mut random, 40, 4.0);
    instances[3] = instances[3].with_mask(0);
    instances[5].world_from_object = Affine::scale([0.0; 3]);
    let scene = Scene::new(&instances);
    let truth = scene.truth();
    assert!(truth.len() > 5 && truth.len() < 200, "{}", truth.len());
    assert_eq!(found(&scene), truth);
    // What boxes alone would report.
    let boxes: Vec<_> = (0..40).filter_map(|id| scene.tlas.instance_bounds(InstanceId(id))).collect();
    let meet = |a: &Aabb, b: &Aabb| (0..3).all(|k| a.min[k] <= b.max[k] && b.min[k] <= a.max[k]);
    let n_near = boxes.iter().enumerate().flat_map(|(i, a)| boxes[..i].iter().filter(move |b| meet(a, b))).count();
    assert!(n_near > truth.len() + 10, "{n_near}");
}

/// Two squares that share an edge exactly, moved together far away: touching counts, a gap does not.
#[test]
fn touching_at_great_distances() {
    let square =
        [[[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]];
    for offset in [0.0, 1e5, -3e6] {
        for (gap, expected) in [(0.0, true), (0.25, false), (-0.25, true)] {
            let at = |x: f32| Instance::new(0, Affine::translation([offset + x, -offset, 2.0 * offset]));
            let blas = vec![bvh(&square, config_of(Preset::Fast))];
            let tlas = Tlas::new(blas, &[at(0.0), at(1.0 + gap)], Default::default()).unwrap();
            let mut found = vec![];
            instance_pairs(&tlas, &mut found);
            assert_eq!(found.len(), usize::from(expected), "{offset} {gap}");
        }
    }
}

/// Random edits: the pairs are those of a new scene, and the changes lead from one to the next.
#[test]
fn contacts_from_frame_to_frame() {
    let mut random = Random(11);
    let mut scene = Scene::new(&maps(&mut random, 30, 5.0));
    let mut contacts = Contacts::new(&scene.tlas);
    let (mut n_begun, mut n_ended) = (0, 0);
    for frame in 0..150 {
        let before: Vec<_> = contacts.pairs().collect();
        let mut changed = vec![];
        for _ in 0..1 + frame % 4 {
            let id = InstanceId((random.next() * scene.tlas.instances().len() as f32) as u32);
            let moved = maps(&mut random, 1, 5.0)[0];
            let is_there = !scene.tlas.instances()[id.0 as usize].is_removed();
            match frame % 7 {
                0 if is_there => drop(scene.tlas.remove(id).unwrap()),
                1 => changed.push(scene.tlas.insert(moved).unwrap()),
                2 if is_there => scene.tlas.set_mask(id, u32::from(frame % 2 == 0)).unwrap(),
                _ if is_there => scene.tlas.set_transform(id, moved.world_from_object).unwrap(),
                _ => {}
            }
            changed.push(id);
        }
        let changes = contacts.update(&scene.tlas, &changed);
        let after: Vec<_> = contacts.pairs().collect();
        assert_eq!(after, found(&scene));
        assert_eq!(changes.begun, after.iter().filter(|pair| !before.contains(pair)).copied().collect::<Vec<_>>());
        assert_eq!(changes.ended, before.iter().filter(|pair| !after.contains(pair)).copied().collect::<Vec<_>>());
        for id in (0..scene.tlas.instances().len() as u32).map(InstanceId) {
            let of: Vec<_> =
                after.iter().filter(|pair| pair.contains(&id)).map(|[a, b]| if *a == id { *b } else { *a }).collect();
            assert!(contacts.of(id).eq({
                let mut of = of;
                of.sort_unstable();
                of
            }));
        }
        (n_begun, n_ended) = (n_begun + changes.begun.len(), n_ended + changes.ended.len());
        if frame % 50 == 0 {
            assert_eq!(after, scene.truth());
        }
    }
    assert!(n_begun > 40 && n_ended > 40, "{n_begun} {n_ended}");
    // An instance that was not named is not looked at: the check above can fail.
    let pair = contacts.pairs().next().expect("some instances touch");
    scene.tlas.set_transform(pair[0], Affine::translation([1e4; 3])).unwrap();
    contacts.update(&scene.tlas, &[]);
    assert!(!contacts.pairs().eq(found(&scene)));
}

#[test]
fn nearest_instances_are_those_of_a_loop() {
    let scene = Scene::new(&maps(&mut Random(3), 25, 12.0));
    let body = |id: u32| {
        let given = &scene.tlas.instances()[id as usize];
        (&scene.tlas.blas()[given.blas as usize], Pose::from(given.world_from_object))
    };
    let mut all = vec![];
    for a in 0..25 {
        for b in a + 1..25 {
            let ((one, one_pose), (other, other_pose)) = (body(a), body(b));
            let found = distance(one, one_pose, other, other_pose, f64::INFINITY).unwrap();
            all.push((found.distance, [InstanceId(a), InstanceId(b)]));
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut nearest = vec![];
    for (k, max_distance) in
        [(1, f64::INFINITY), (7, f64::INFINITY), (1000, f64::INFINITY), (1000, 1.5), (0, 9.0), (3, -1.0)]
    {
        closest_instance_pairs(&scene.tlas, k, max_distance, &mut nearest);
        let expected: Vec<_> = all.iter().filter(|one| one.0 <= max_distance).take(k).copied().collect();
        let found: Vec<_> = nearest.iter().map(|one| (one.nearest.distance, one.instances)).collect();
        assert_eq!(found, expected, "{k} within {max_distance}");
    }
    assert!(all[3].0 > 0.0 || all[0].0 == 0.0);
}

/// Single shapes of every kind as questions about a scene, by a loop over all triangles of all instances.
#[test]
fn shapes_touch_what_a_loop_finds() {
    let mut random = Random(19);
    let scene = Scene::new(&maps(&mut random, 25, 4.0));
    let mut n_found = [0; 5];
    for i in 0..60 {
        let [p, q] = [random.near([2.0; 3], 2.5), random.near([2.0; 3], 2.5)];
        let to_f64 = |p: [f32; 3]| p.map(f64::from);
        let capsule = Capsule { ends: [to_f64(p), to_f64(q)], radius: 0.2 };
        let sphere = Sphere { center: p, radius: 0.6 };
        let aabb = Aabb { min: std::array::from_fn(|k| p[k].min(q[k])), max: std::array::from_fn(|k| p[k].max(q[k])) };
        let s = 0.5_f32.sqrt();
        let obb = Obb { center: q, frame: [[s, s, 0.0], [-s, s, 0.0], [0.0, 0.0, 1.0]], half_extents: [0.8, 0.2, 0.5] };
        let hull = Hull { points: (0..5).map(|_| to_f64(random.near(p, 1.0))).collect() };
        let pose = if i % 2 == 0 { Pose::IDENTITY } else { Pose::translation([0.5, -0.25, 0.125]) };
        macro_rules! check {
            ($kind:expr, $shape:expr) => {
                let mut expected = vec![];
                for id in 0..25 {
                    for (i, triangle) in scene.triangles(id).into_iter().enumerate() {
                        let triangle = Hull { points: triangle.to_vec() };
                        if overlaps(&triangle, Pose::IDENTITY, $shape, pose) {
                            expected.push((InstanceId(id), PrimId(i as u32)));
                        }
                    }
                }
                let mut found = vec![];
                touching(&scene.tlas, $shape, pose, &mut found);
                assert_eq!(found, expected);
                assert_eq!(first_touching(&scene.tlas, $shape, pose), found.first().copied());
                assert_eq!(touches(&scene.tlas, $shape, pose), !found.is_empty());
                assert_eq!(count_touching(&scene.tlas, $shape, pose), found.len());
                n_found[$kind] += found.len();
            };
        }
        check!(0, &capsule);
        check!(1, &sphere);
        check!(2, &aabb);
        check!(3, &obb);
        check!(4, &hull);
    }
    assert!(n_found.iter().all(|&n| n > 20), "{n_found:?}");
    assert!(
        !touches(&scene.tlas, &Aabb::EMPTY, Pose::IDENTITY)
            && !touches(&scene.tlas, &Hull { points: vec![] }, Pose::IDENTITY)
    );
}

/// Instances of other primitives, and less than a list of pairs.
#[test]
fn instances_of_spheres() {
    let ball = WideBvh::over(vec![Sphere { center: [0.0; 3], radius: 1.0 }]).unwrap();
    let at = |x: f32| Instance::new(0, Affine::translation([x, 0.0, 0.0]));
    let tlas = Tlas::new(vec![ball.clone()], &[at(0.0), at(2.0), at(4.5)], Default::default()).unwrap();
    let mut found = vec![];
    instance_pairs(&tlas, &mut found);
    assert_eq!(found, [[InstanceId(0), InstanceId(1)]]);
    let mut nearest = vec![];
    closest_instance_pairs(&tlas, 2, f64::INFINITY, &mut nearest);
    assert_eq!((nearest[1].instances, nearest[1].nearest.distance), ([InstanceId(1), InstanceId(2)], 0.5));
    let (a, b) =
        (bvh(&soup(60, 0.3, 5), config_of(Preset::Balanced)), bvh(&soup(60, 0.3, 6), config_of(Preset::Balanced)));
    let mut all = vec![];
    pairs(&a, Pose::IDENTITY, &b, Pose::IDENTITY, &mut all);
    assert!(all.len() > 5);
    assert_eq!(first_pair(&a, Pose::IDENTITY, &b, Pose::IDENTITY), all.first().copied());
    assert_eq!(count_pairs(&a, Pose::IDENTITY, &b, Pose::IDENTITY), all.len());
    assert_eq!(first_pair(&a, Pose::IDENTITY, &b, Pose::translation([9.0; 3])), None);
}
