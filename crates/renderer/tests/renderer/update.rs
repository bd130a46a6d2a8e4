//! Updates of a prepared scene, against scenes that are prepared anew.

use canted_lbvh::Strategy;
use canted_obb::Affine;
use canted_renderer::{BvhKind, Levels, SceneBvh, SceneBvhConfig, UpdateOptions, UpdatePolicy, Updates};
use canted_scene::Scene;
use canted_trace::{Hit, Intersect, Ray};

use crate::common::{
    camera, cuboid, film_of, gray, parallelogram, place, rays_from_all_around, scene, settings, sphere,
};

const POLICIES: [UpdatePolicy; 3] = [UpdatePolicy::Auto, UpdatePolicy::Refit, UpdatePolicy::Rebuild];

fn options(policy: UpdatePolicy) -> UpdateOptions {
    UpdateOptions { policy, trace_time: std::time::Duration::from_millis(20) }
}

fn config(levels: Levels) -> SceneBvhConfig {
    SceneBvhConfig { levels, ..SceneBvhConfig::default() }
}

fn prepared(scene: &Scene, config: &SceneBvhConfig) -> SceneBvh {
    SceneBvh::build(scene, config).unwrap()
}

/// A rotation about the z axis, sheared, scaled and shifted.
fn placed(angle: f32, shift: [f32; 3]) -> Affine {
    let (sin, cos) = angle.sin_cos();
    Affine { columns: [[cos, sin, 0.1], [-sin, cos, 0.0], [0.0, 0.2, 1.5], shift] }
}

/// Frame `frame`: a sphere that twists more and more, a box that stays, instances of the box that move, and flat and duplicate
/// triangles; `offset` moves everything away from the origin.
fn stage(frame: u16, offset: f32) -> Scene {
    let time = 0.2 * f32::from(frame);
    let mut ball = sphere([0.0; 3], 1.0, 3, 0);
    for [x, y, z] in &mut ball.positions {
        let (sin, cos) = (time * *z).sin_cos();
        (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
    }
    let first = ball.triangles[0];
    ball.triangles.extend([first, first, [first[0]; 3]]);
    ball.parts.truncate(1);
    let cube = cuboid([-0.5; 3], [0.5, 0.25, 0.5], 0);
    // Every other frame stays as it was.
    let wall = parallelogram([-2.0, -2.0, -1.5 - 0.1 * f32::from(frame / 2)], [4.0, 0.0, -0.0], [0.0, 4.0, 0.5], 0);
    let mut stage = scene(vec![ball, cube, wall], vec![gray(0.5)]);
    stage.instances[1].world_from_object = placed(0.3, [1.5, 0.0, 0.0]);
    stage.instances.push(place(1, placed(time, [-1.5, 0.1 * time, 0.0])));
    stage.instances.push(place(1, placed(-time, [0.0, 1.5, time])));
    for instance in &mut stage.instances {
        instance.world_from_object.columns[3].iter_mut().for_each(|x| *x += offset);
    }
    stage.environment = Some([1.0, 0.8, 0.6].into());
    stage
}

/// Closest hits of rays from all around, with directions of many lengths, as text with every bit.
fn hits(structure: &dyn Intersect, offset: f32) -> Vec<Option<Hit>> {
    let moved = |ray: Ray| Ray { origin: ray.origin.map(|x| x + offset), ..ray };
    rays_from_all_around(2000).map(|ray| structure.closest_hit(&moved(ray))).collect()
}

/// Updates through all frames, and compares hits and pictures of each with those of a new structure.
#[track_caller]
fn follows(config: &SceneBvhConfig, policy: UpdatePolicy, offset: f32) -> Updates {
    let view = camera([3.0 + offset, 2.0 + offset, 6.0 + offset], [offset; 3], 50.0);
    let settings = settings(24, 16, 1, 1);
    let mut updated = prepared(&stage(0, offset), config);
    let (mut all, mut n_changed) = (Updates::default(), 0);
    let first = hits(&updated, offset);
    for frame in 1..10 {
        let stage = stage(frame, offset);
        let updates = updated.update(&stage, &options(policy)).unwrap();
        all += updates;
        let fresh = prepared(&stage, config);
        let (ours, theirs) = (hits(&updated, offset), hits(&fresh, offset));
        assert!(ours == theirs, "{config:?}, {policy:?}, frame {frame}");
        n_changed += u32::from(theirs != first);
        let film = |structure| film_of(&stage, structure, &view, &settings);
        assert_eq!(film(&updated), film(&fresh), "{config:?}, {policy:?}, frame {frame}");
        assert_eq!(updated.unused.len(), fresh.unused.len());
    }
    // The comparison can fail: a structure that is not updated has other hits.
    assert_eq!(n_changed, 9);
    assert!(first.iter().filter(|hit| hit.is_some()).count() > 200);
    all
}

#[test]
fn updated_structures_have_the_hits_and_pictures_of_new_ones() {
    for levels in [Levels::One, Levels::Two] {
        for policy in POLICIES {
            for offset in [0.0, 1e4] {
                follows(&config(levels), policy, offset);
            }
        }
        let binary = SceneBvhConfig { kind: BvhKind::Bvh2, volumes: Strategy::Combined, ..config(levels) };
        let updates = follows(&binary, UpdatePolicy::Refit, 0.0);
        assert_eq!(updates.refits, 0, "binary BVHs cannot be refitted");
    }
}

#[test]
fn only_changed_meshes_are_updated() {
    let two = config(Levels::Two);
    // In nine updates the sphere changes nine times, the wall four times, the box never.
    let refits = follows(&two, UpdatePolicy::Refit, 0.0);
    let counts =
        |u: &Updates| [u.unchanged, u.refits, u.rebuilds, u.top_unchanged, u.top_refits, u.top_rebuilds, u.whole];
    assert_eq!(counts(&refits), [14, 13, 0, 0, 9, 0, 0]);
    assert!(refits.max_drift > 1.0);
    assert_eq!(counts(&follows(&two, UpdatePolicy::Rebuild, 0.0)), [14, 0, 13, 0, 0, 9, 0]);
    // One level is one BVH.
    let one = config(Levels::One);
    assert_eq!(counts(&follows(&one, UpdatePolicy::Refit, 0.0)), [0, 9, 0, 0, 0, 0, 0]);
    for config in [one, two] {
        let mut still = prepared(&stage(3, 0.0), &config);
        let updates = still.update(&stage(3, 0.0), &UpdateOptions::default()).unwrap();
        let n = still.bottom().len();
        assert_eq!(counts(&updates), [n, 0, 0, usize::from(n > 1), 0, 0, 0], "nothing changed");
    }
    // Only instances move: the BVHs over triangles stay.
    let mut moving = stage(3, 0.0);
    let mut updated = prepared(&moving, &two);
    moving.instances[2].world_from_object.columns[3][0] += 0.5;
    let updates = updated.update(&moving, &options(UpdatePolicy::Refit)).unwrap();
    assert_eq!(counts(&updates), [3, 0, 0, 0, 1, 0, 0]);
    assert!(hits(&updated, 0.0) == hits(&prepared(&moving, &two), 0.0));
}

/// A change of a scene, and what it is.
type Change = (&'static str, fn(&mut Scene));

#[test]
fn meshes_instances_and_triangles_may_come_and_go() {
    let changes: [Change; 6] = [
        ("an instance less", |scene| scene.instances.truncate(4)),
        ("an instance more", |scene| scene.instances.push(place(1, placed(1.0, [0.0, -1.5, 0.0])))),
        ("other triangles", |scene| scene.meshes[0].triangles.truncate(100)),
        ("triangles in another order", |scene| scene.meshes[0].triangles.reverse()),
        ("a mesh more", |scene| {
            scene.meshes.push(cuboid([-1.0; 3], [0.0; 3], 0));
            scene.instances.push(place(3, Affine::IDENTITY));
        }),
        ("nothing", |scene| {
            scene.meshes.clear();
            scene.instances.clear();
        }),
    ];
    for levels in [Levels::Auto, Levels::One, Levels::Two] {
        let config = config(levels);
        let mut updated = prepared(&stage(0, 0.0), &config);
        for (what, change) in changes {
            for changed in [true, false] {
                let mut stage = stage(u16::from(changed), 0.0);
                if changed {
                    change(&mut stage);
                }
                updated.update(&stage, &options(UpdatePolicy::Refit)).unwrap();
                let fresh = prepared(&stage, &config);
                assert!(hits(&updated, 0.0) == hits(&fresh, 0.0), "{levels:?}: {what}, {changed}");
            }
        }
    }
}

#[test]
fn a_failed_update_is_repaired_by_the_next() {
    for levels in [Levels::One, Levels::Two] {
        let config = config(levels);
        let mut updated = prepared(&stage(0, 0.0), &config);
        for bad in [f32::NAN, f32::INFINITY] {
            let mut torn = stage(1, 0.0);
            torn.meshes[0].positions[7][1] = bad;
            let error = updated.update(&torn, &UpdateOptions::default()).unwrap_err();
            assert_eq!(Some(error), SceneBvh::build(&torn, &config).err());
            let updates = updated.update(&stage(2, 0.0), &UpdateOptions::default()).unwrap();
            assert_eq!(updates.whole, 1);
            assert!(hits(&updated, 0.0) == hits(&prepared(&stage(2, 0.0), &config), 0.0));
        }
    }
}

/// Memory after a thousand updates is that after a few.
#[test]
fn memory_does_not_grow() {
    for levels in [Levels::One, Levels::Two] {
        for policy in POLICIES {
            let config = config(levels);
            let mut updated = prepared(&stage(0, 0.0), &config);
            let mut most = 0;
            // Refits take place in the old memory, builds in new one.
            let n_frames = if policy == UpdatePolicy::Refit { 1000 } else { 100 };
            for frame in 0..n_frames {
                updated.update(&stage(frame % 8, 0.0), &options(policy)).unwrap();
                let n_bytes = updated.n_bytes();
                if frame < 16 {
                    most = most.max(n_bytes);
                }
                // Under `Auto`, times decide in which frames the BVHs are rebuilt.
                let bound = if policy == UpdatePolicy::Auto { 2 * most } else { most };
                assert!(
                    n_bytes <= bound,
                    "{levels:?}, {policy:?}: {n_bytes} bytes after frame {frame}, at first {most}"
                );
            }
        }
    }
}
