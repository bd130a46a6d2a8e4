use canted_lbvh::Strategy;
use canted_obb::Affine;
use canted_scene::{Camera, Instance, Mesh, MeshId, Projection, Scene};

use super::*;
use crate::{BvhKind, Levels, SceneBvhConfig, flatten};

/// Two instances of thin ribbons in a few directions, so that some structures have oriented boxes.
fn scene() -> Scene {
    let mut mesh = Mesh::default();
    for i in 0..120_u16 {
        let [x, y, z] = [7, 11, 13].map(|n| f32::from(i * n % 31) / 8.0);
        let (sin, cos) = (0.4 + f32::from(i % 3)).sin_cos();
        let first = u32::from(4 * i);
        let along = [2.0 * cos, 2.0 * sin, 0.5];
        let end: [f32; 3] = std::array::from_fn(|k| [x, y, z][k] + along[k]);
        let lift = |p: [f32; 3]| [p[0], p[1], p[2] + 0.02];
        mesh.positions.extend([[x, y, z], end, lift(end), lift([x, y, z])]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    let (sin, cos) = 0.6_f32.sin_cos();
    let instance = |shift: f32, first_primitive: u32| Instance {
        mesh: MeshId(0),
        world_from_object: Affine {
            columns: [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0], [shift, -0.25, 0.0]],
        },
        world_from_object_close: None,
        first_primitive,
    };
    Scene { meshes: vec![mesh], instances: vec![instance(0.5, 0), instance(9.0, 0)], ..Scene::default() }
}

fn built(scene: &Scene, config: SceneBvhConfig, levels: Levels) -> SceneBvh {
    SceneBvh::build(scene, &SceneBvhConfig { levels, ..config }).unwrap()
}

fn configs() -> [SceneBvhConfig; 6] {
    let of_kind = |kind, volumes| SceneBvhConfig { kind, volumes, ..SceneBvhConfig::default() };
    [
        of_kind(BvhKind::Wide, Strategy::Aabb),
        of_kind(BvhKind::Bvh2, Strategy::Aabb),
        of_kind(BvhKind::Bvh2, Strategy::Dop),
        of_kind(BvhKind::Bvh2, Strategy::Combined),
        of_kind(BvhKind::Bih, Strategy::Aabb),
        of_kind(BvhKind::KdTree, Strategy::Aabb),
    ]
}

/// The number of triangles of which no box contains all corners, or of a kd-tree, whose cells cut triangles, of which some corner is
/// in no cell. Boxes may be smaller by the rounding of their axes and center, less than 16 roundings of the greatest coordinate.
fn n_uncovered(scene: &Scene, boxes: &[Obb], cuts: bool) -> usize {
    let (positions, triangles, _) = flatten(scene).unwrap();
    let reach = positions.iter().flatten().fold(0.0_f32, |reach, x| reach.max(x.abs()));
    let boxes: Vec<Obb> = boxes.iter().map(|obb| obb.grown(f64::from(16.0 * f32::EPSILON * reach))).collect();
    let is_covered = |corners: &[[f32; 3]; 3]| match cuts {
        false => boxes.iter().any(|obb| corners.iter().all(|&p| obb.contains(p))),
        true => corners.iter().all(|&p| boxes.iter().any(|obb| obb.contains(p))),
    };
    triangles.iter().filter(|t| !is_covered(&t.map(|i| positions[i as usize]))).count()
}

/// The scene far from the origin: its mesh, or its instances.
fn far_scenes() -> [Scene; 2] {
    const SHIFT: [f32; 3] = [1e5, -3e4, 2e4];
    let add = |p: &mut [f32; 3]| (0..3).for_each(|k| p[k] += SHIFT[k]);
    let [mut far_mesh, mut far_instances] = [scene(), scene()];
    far_mesh.meshes[0].positions.iter_mut().for_each(add);
    far_instances.instances.iter_mut().for_each(|instance| add(&mut instance.world_from_object.columns[3]));
    [far_mesh, far_instances]
}

#[test]
fn leaves_cover_all_triangles_and_levels_are_complete() {
    let [far_mesh, far_instances] = far_scenes();
    for (scene, levels) in [scene(), far_mesh, far_instances].iter().flat_map(|s| [(s, Levels::One), (s, Levels::Two)])
    {
        for config in configs() {
            let bvh = built(scene, config, levels);
            let leaves = bvh.boxes(BoxLevel::Leaves);
            let cuts = config.kind == BvhKind::KdTree;
            assert_eq!(n_uncovered(scene, &leaves, cuts), 0, "{config:?} {levels:?}");
            // The check sees a leaf that is missing.
            let missing: Vec<Obb> = leaves.iter().skip(leaves.len() / 2).copied().collect();
            assert!(n_uncovered(scene, &missing, cuts) > 0, "{config:?} {levels:?}");
            let n = bvh.n_levels();
            let sizes: Vec<usize> = (0..n).map(|level| bvh.boxes(BoxLevel::Level(level)).len()).collect();
            assert_eq!(sizes[0], 1, "{config:?} {levels:?}: {sizes:?}");
            assert!(sizes.iter().all(|&n| n > 0), "{config:?} {levels:?}: {sizes:?}");
            assert!(bvh.boxes(BoxLevel::Level(n)).is_empty(), "{config:?} {levels:?}");
        }
    }
}

#[test]
fn oriented_boxes_are_drawn_as_such() {
    let scene = scene();
    let has_oriented = |volumes| {
        let config = SceneBvhConfig { kind: BvhKind::Bvh2, volumes, ..SceneBvhConfig::default() };
        let boxes = built(&scene, config, Levels::One).boxes(BoxLevel::Leaves);
        boxes.iter().any(|obb| !is_aligned(obb))
    };
    assert!(has_oriented(Strategy::PcaBounded));
    assert!(!has_oriented(Strategy::Aabb));
}

/// The position of a point on a ray is the image position that the ray was made for.
#[test]
fn positions_are_the_inverse_of_rays() {
    let camera = Camera::pinhole([3.0, 2.0, 5.0], [0.5, 0.0, -1.0], [0.0, 1.0, 0.0], 50.0);
    let parallel = Camera { projection: Projection::Orthographic { height: 4.0 }, ..camera };
    for camera in [camera, parallel] {
        let view = View::new(&camera, 64, 36).unwrap();
        for position in [[0.5, 0.5], [32.0, 18.0], [63.0, 2.25]] {
            let ray = view.ray(position);
            let point: Vector = std::array::from_fn(|k| f64::from(ray.origin[k]) + 3.0 * f64::from(ray.direction[k]));
            let depth = if view.is_perspective { view.depth(point) } else { 1.0 };
            let found = view.position(point, depth);
            assert!(found.iter().zip(position).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?} is not {position:?}");
        }
    }
}

/// A box in front of the camera is drawn, one behind it is not, and one around it does not fail.
#[test]
fn boxes_behind_the_eye_are_cut_off() {
    let camera = Camera::pinhole([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 90.0);
    let view = View::new(&camera, 32, 32).unwrap();
    let drawn = |center: [f32; 3], half: f32| {
        let mut picture = Picture::filled(32, 32, [0.5; 3]);
        let obb = Obb { center, frame: Obb::IDENTITY_FRAME, half_extents: [half; 3] };
        draw_boxes(&mut picture, [0, 0], &view, &[obb]);
        assert!(picture.pixels.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
        picture.pixels.iter().filter(|pixel| **pixel != [0.5; 3]).count()
    };
    assert!(drawn([0.0, 0.0, -4.0], 1.0) > 40);
    assert_eq!(drawn([0.0, 0.0, 4.0], 1.0), 0);
    // The far face is seen from inside, and the edges that lead to it.
    assert!(drawn([0.0; 3], 2.0) > 60);
}

/// A crop shows the same lines.
#[test]
fn a_part_of_the_picture_has_the_lines_of_the_whole() {
    let camera = Camera::pinhole([2.0, 1.5, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0);
    let view = View::new(&camera, 40, 30).unwrap();
    let boxes = [Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.5, 0.8, 0.3] }];
    let [mut whole, mut part] = [[40, 30], [20, 15]].map(|[w, h]| Picture::filled(w, h, [0.25; 3]));
    draw_boxes(&mut whole, [0, 0], &view, &boxes);
    draw_boxes(&mut part, [12, 9], &view, &boxes);
    assert!(part.pixels.iter().flatten().any(|x| *x != 0.25));
    assert!(part == whole.cropped([12, 9], [20, 15]));
}

#[test]
fn levels_are_named() {
    assert_eq!("3".parse(), Ok(BoxLevel::Level(3)));
    assert_eq!("leaves".parse(), Ok(BoxLevel::Leaves));
    for wrong in ["-1", "", "leaf", "1.5"] {
        assert!(wrong.parse::<BoxLevel>().is_err(), "{wrong}");
    }
    assert_eq!([BoxLevel::Level(7), BoxLevel::Leaves].map(|level| level.to_string()), ["7", "leaves"]);
}
