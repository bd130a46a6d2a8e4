//! Bodies that move, compared with closed forms, and with exact overlaps before and after the contact.

use canted_collide::{
    Body, Capsule, Contact, Hull, Pose, Segment, cast, cast_at_instances, cast_sphere, distance, overlaps,
};
use canted_obb::{Aabb, Affine, Obb, PrimId};
use canted_tlas::{Instance, Tlas};
use canted_trace::{InstanceId, Ray, Sphere};
use canted_wide::{Preset, TriangleBvh, WideBvh};

use crate::common::{Random, Triangle, bvh, config_of, configs, needles, posed, soup, truth};

fn at_rest<A: Body, B: Body>(a: &A, b: &B, motion: [f64; 3]) -> Option<Contact> {
    cast(a, Pose::IDENTITY, b, Pose::IDENTITY, motion, f64::INFINITY)
}

/// Right values by hand.
#[test]
fn shapes_meet() {
    let cube = Aabb { min: [-1.0; 3], max: [1.0; 3] };
    let s = 0.5_f32.sqrt();
    let turned = |x: f32| Obb {
        center: [x, 0.0, 0.0],
        frame: [[s, s, 0.0], [-s, s, 0.0], [0.0, 0.0, 1.0]],
        half_extents: [1.0; 3],
    };
    let near = |contact: Option<Contact>, t: f64, normal: [f64; 3]| {
        let found = contact.expect("they meet");
        assert!((found.t - t).abs() < 1e-6, "{found:?}, not {t}");
        assert!((0..3).all(|k| (found.normal[k] - normal[k]).abs() < 1e-5), "{found:?}, not {normal:?}");
        assert!(!found.starts_inside);
    };
    let ball = |x: f32, y: f32| Sphere { center: [x, y, 0.0], radius: 0.5 };
    let back = [-1.0, 0.0, 0.0];
    near(at_rest(&cube, &ball(4.0, 0.0), back), 2.5, [1.0, 0.0, 0.0]);
    near(at_rest(&cube, &ball(4.0, 0.0), [-4.0, 0.0, 0.0]), 0.625, [1.0, 0.0, 0.0]);
    // At the edge x = y = 1, 0.3 below the center: 0.4 aside.
    near(at_rest(&cube, &ball(4.0, 1.3), back), 2.6, [0.8, 0.6, 0.0]);
    assert_eq!(at_rest(&cube, &ball(4.0, 1.6), back), None);
    assert_eq!(at_rest(&cube, &ball(4.0, 0.0), [1.0, 0.0, 0.0]), None, "it moves away");
    assert_eq!(at_rest(&cube, &ball(4.0, 0.0), [0.0; 3]), None, "it rests");
    near(at_rest(&ball(0.0, 0.0), &ball(3.0, 0.0), back), 2.0, [1.0, 0.0, 0.0]);
    near(at_rest(&ball(0.0, 0.0), &ball(3.0, 0.6), back), 2.2, [0.8, 0.6, 0.0]);
    near(at_rest(&cube, &turned(5.0), back), 4.0 - 2.0_f64.sqrt(), [1.0, 0.0, 0.0]);
    let capsule = Capsule { ends: [[-3.0, 3.0, 0.0], [3.0, 3.0, 0.0]], radius: 0.25 };
    near(at_rest(&cube, &capsule, [0.0, -1.0, 0.0]), 1.75, [0.0, 1.0, 0.0]);
    let tip = Hull { points: vec![[0.3, 5.0, 0.2], [-1.0, 7.0, 0.0], [1.0, 7.0, 0.0], [0.0, 7.0, 2.0]] };
    near(at_rest(&cube, &tip, [0.0, -2.0, 0.0]), 2.0, [0.0, 1.0, 0.0]);
    let segment = Segment { ends: [[0.0, 2.0, -4.0], [0.0, 2.0, 4.0]] };
    let triangle: Triangle = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    near(at_rest(&triangle, &segment, [0.0, -1.0, 0.0]), 1.0, [0.0, 1.0, 0.0]);
}

#[test]
fn starts_and_ends() {
    let cube = Aabb { min: [-1.0; 3], max: [1.0; 3] };
    let ball = Sphere { center: [1.25, 0.0, 0.0], radius: 0.5 };
    let found = at_rest(&cube, &ball, [1.0, 0.0, 0.0]).expect("they overlap at the start");
    assert_eq!((found.t, found.starts_inside, found.normal), (0.0, true, [0.0; 3]));
    assert!(found.position[0] <= 1.0 && found.position[0] >= 0.75, "a point of both");
    let far = Sphere { center: [4.0, 0.0, 0.0], radius: 0.5 };
    let until = |t_max| cast(&cube, Pose::IDENTITY, &far, Pose::IDENTITY, [-1.0, 0.0, 0.0], t_max);
    assert_eq!(until(2.49), None);
    assert!(until(2.51).is_some() && until(f64::NAN).is_none() && until(-1.0).is_none());
    assert_eq!(at_rest(&cube, &far, [f64::NAN, 0.0, 0.0]), None);
    assert_eq!(at_rest(&Aabb::EMPTY, &far, [-1.0, 0.0, 0.0]), None);
    assert_eq!(cast(&cube, Pose::translation([f64::INFINITY; 3]), &far, Pose::IDENTITY, [-1.0, 0.0, 0.0], 9.0), None);
}

/// Before the contact exact overlaps say no, and just after it yes; the pair is one that touches then.
#[test]
fn meshes_meet_when_they_first_overlap() {
    let mut random = Random(23);
    let (mut n_hits, mut n_inside) = (0, 0);
    for case in 0..24 {
        let (a, b) = match case % 3 {
            0 => (soup(60, 0.2, case), soup(50, 0.2, case + 100)),
            1 => (needles(40, case), soup(40, 0.3, case + 100)),
            _ => (needles(40, case), needles(40, case + 100)),
        };
        let scale = [1.0, 1e-6, 1e6][case as usize % 3];
        let scaled = |t: &Triangle| t.map(|p| p.map(|x| x * scale as f32));
        let (a, b): (Vec<Triangle>, Vec<Triangle>) = (a.iter().map(scaled).collect(), b.iter().map(scaled).collect());
        let offset = if case % 8 == 0 { 0.2 } else { 3.0 };
        let start = [offset * scale, 0.3 * scale, -0.2 * scale];
        let pose = if case % 2 == 0 {
            Pose::translation(start)
        } else {
            Pose::from_rows([[0.8, 0.6, 0.0, start[0]], [-0.9, 1.2, 0.1, start[1]], [0.0, 0.0, -0.7, start[2]]])
        };
        let motion = [-2.0 * scale, (f64::from(random.next()) - 0.5) * scale, 0.1 * scale];
        let mut answers = vec![];
        for config in configs() {
            answers.push(cast(&bvh(&a, config), Pose::IDENTITY, &bvh(&b, config), pose, motion, 4.0));
        }
        assert!(answers.iter().all(|answer| answer == &answers[0]), "{answers:?}");
        let at = |t: f64| {
            let moved: Vec<_> = posed(&b, pose)
                .iter()
                .map(|triangle| triangle.map(|p| std::array::from_fn(|k| p[k] + t * motion[k])))
                .collect();
            truth(&posed(&a, Pose::IDENTITY), &moved)
        };
        let end = answers[0].map_or(4.0, |contact| contact.t);
        for i in 0..12 {
            let t = end * f64::from(i) / 12.0;
            assert!(at(t).is_empty() || end == 0.0, "case {case}: they overlap at {t}, before {end}");
        }
        let Some(contact) = answers[0] else { continue };
        n_hits += 1;
        n_inside += i32::from(contact.starts_inside);
        assert_eq!(contact.starts_inside, !at(0.0).is_empty());
        if !contact.starts_inside {
            assert!(at(end * (1.0 - 1e-9)).is_empty());
            assert!(at(end + 1e-7).contains(&contact.primitives), "case {case}: {contact:?}");
            let length = contact.normal.iter().map(|x| x * x).sum::<f64>();
            let approach: f64 = (0..3).map(|k| contact.normal[k] * motion[k]).sum();
            assert!((length - 1.0).abs() < 1e-9 && approach < 0.0);
        }
    }
    assert!(n_hits > 15 && n_inside >= 1 && n_hits > n_inside + 10, "{n_hits}, {n_inside}");
}

/// Capsules, boxes and hulls against meshes: at the contact they are as far apart as stated, and farther before.
#[test]
fn shapes_meet_meshes() {
    let mut random = Random(29);
    let triangles = soup(300, 0.1, 3);
    let mesh = bvh(&triangles, config_of(Preset::Balanced));
    fn check<S: Body>(mesh: &TriangleBvh, triangles: &[Triangle], shape: &S, motion: [f64; 3]) -> usize {
        let Some(found) = at_rest(mesh, shape, motion) else { return 0 };
        let loose: Vec<Option<Contact>> = triangles.iter().map(|one| at_rest(one, shape, motion)).collect();
        let best = loose.iter().enumerate().filter_map(|(i, one)| one.map(|one| (one.t, i)));
        let (t, i) = best.min_by(|x, y| x.0.total_cmp(&y.0)).expect("one of the triangles");
        assert_eq!((found.t, found.primitives[0]), (t, PrimId(i as u32)), "that of a loop");
        let apart = |t: f64| {
            let pose = Pose::translation(motion.map(|x| t * x));
            distance(mesh, Pose::IDENTITY, shape, pose, f64::INFINITY).expect("neither is empty").distance
        };
        if found.starts_inside {
            assert!(overlaps(mesh, Pose::IDENTITY, shape, Pose::IDENTITY));
            return 0;
        }
        assert!(apart(found.t) < 1e-10, "{found:?} {}", apart(found.t));
        assert!((0..10).all(|i| apart(found.t * f64::from(i) / 10.0) > 1e-10));
        1
    }
    let mut n = [0; 4];
    for _ in 0..60 {
        let p = random.near([0.5, 0.5, 4.0], 0.6).map(f64::from);
        let to = random.point();
        let motion: [f64; 3] = std::array::from_fn(|k| f64::from(to[k]) - p[k]);
        let q: [f64; 3] = std::array::from_fn(|k| p[k] + 0.4 * (f64::from(random.next()) - 0.5));
        let to_f32 = p.map(|x| x as f32);
        n[0] += check(&mesh, &triangles, &Capsule { ends: [p, q], radius: 0.05 }, motion);
        n[1] += check(&mesh, &triangles, &Aabb { min: to_f32, max: to_f32.map(|x| x + 0.1) }, motion);
        n[2] += check(&mesh, &triangles, &Sphere { center: to_f32, radius: 0.1 }, motion);
        n[3] += check(&mesh, &triangles, &Hull { points: vec![p, q, [p[0], q[1], p[2]], [q[0], p[1], p[2]]] }, motion);
    }
    assert!(n.iter().all(|&n| n > 5), "{n:?}");
}

/// The closed form of spheres, and advancement, agree.
#[test]
fn spheres_meet_as_in_closed_form() {
    let mesh = bvh(&soup(400, 0.15, 31), config_of(Preset::Quality));
    let mut random = Random(5);
    let mut n_hits = 0;
    for _ in 0..200 {
        let (from, to) = (random.near([0.5; 3], 2.5), random.point());
        let direction: [f32; 3] = std::array::from_fn(|k| to[k] - from[k]);
        let exact = cast_sphere(&mesh, &Ray::new(from, direction), 0.125);
        let sphere = Sphere { center: from, radius: 0.125 };
        let found = at_rest(&mesh, &sphere, direction.map(f64::from));
        assert_eq!(exact.is_some(), found.is_some());
        let (Some(exact), Some(found)) = (exact, found) else { continue };
        assert!((exact.t - found.t).abs() < 1e-9 && exact.starts_inside == found.starts_inside, "{exact:?} {found:?}");
        n_hits += 1;
    }
    assert!(n_hits > 100);
}

#[test]
fn scenes_are_met_at_their_first_instance() {
    let ball = WideBvh::over(vec![Sphere { center: [0.0; 3], radius: 1.0 }]).unwrap();
    let at = |x: f32, y: f32| Instance::new(0, Affine::translation([x, y, 0.0]));
    let mut tlas = Tlas::new(vec![ball], &[at(0.0, 0.0), at(10.0, 0.0), at(5.0, 1.2)], Default::default()).unwrap();
    let capsule = Capsule { ends: [[20.0, 0.0, 0.0], [24.0, 0.0, 0.0]], radius: 0.5 };
    let first = |tlas: &Tlas<WideBvh<Sphere>>| {
        cast_at_instances(tlas, &capsule, Pose::IDENTITY, [-1.0, 0.0, 0.0], f64::INFINITY)
    };
    let (instance, contact) = first(&tlas).unwrap();
    assert!(instance == InstanceId(1) && (contact.t - 8.5).abs() < 1e-9 && (contact.position[0] - 11.0).abs() < 1e-9);
    tlas.set_mask(InstanceId(1), 0).unwrap();
    let (instance, contact) = first(&tlas).unwrap();
    // 1.2 aside, 1.5 apart: 0.9 along.
    assert!(instance == InstanceId(2) && (contact.t - (15.0 - 0.9)).abs() < 1e-6, "{contact:?}");
    assert_eq!(cast_at_instances(&tlas, &capsule, Pose::IDENTITY, [-1.0, 0.0, 0.0], 14.0), None);
}
