//! Real glTF files: counts, bounds, lights, cameras, animations and error locations.

use std::fs;
use std::path::Path;

use canted_fixtures::models;
use canted_obb::Aabb;
use canted_scene::{Light, Projection, ReadOptions, Scene, UvSet, read, read_with};

use crate::flaw::flaw;

/// Known counts of a file, and the world bounds of its default pose, computed by another program in double precision and
/// rounded to seven digits.
struct Expected {
    file: &'static str,
    n_meshes: usize,
    n_instances: usize,
    n_unique: usize,
    n_placed: usize,
    bounds: [[f64; 3]; 2],
}

/// Error of a bound relative to the largest coordinate: half a unit in the seventh digit, plus one rounding of the transform
/// and one of the point, each of terms of at most eight times that coordinate.
const BOUND_ERROR: f64 = 5e-7 + 16.0 * (f32::EPSILON as f64 / 2.0);

/// `dragon_nodes.glb` has three meshes with equal geometry and different materials.
#[rustfmt::skip]
const FILES: [Expected; 29] = [
    Expected { file: "gltf/AlphaBlendModeTest.glb", n_meshes: 9, n_instances: 9, n_unique: 61, n_placed: 61, bounds: [[-4.3, -0.1, -0.75], [4.3, 2.299533, 0.55]] },
    Expected { file: "gltf/BoxInterleaved.glb", n_meshes: 1, n_instances: 1, n_unique: 12, n_placed: 12, bounds: [[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]] },
    Expected { file: "gltf/BoxVertexColors.glb", n_meshes: 1, n_instances: 1, n_unique: 12, n_placed: 12, bounds: [[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]] },
    Expected { file: "gltf/Cameras.gltf", n_meshes: 1, n_instances: 1, n_unique: 2, n_placed: 2, bounds: [[0.0, 0.0, -0.7075903], [1.0, 0.7066229, 0.0]] },
    Expected { file: "gltf/CesiumMan.glb", n_meshes: 1, n_instances: 1, n_unique: 4_672, n_placed: 4_672, bounds: [[-0.1309999, 4.854345e-08, -0.5691368], [0.180954, 1.50655, 0.5691369]] },
    Expected { file: "gltf/CornellBox_bevy.glb", n_meshes: 4, n_instances: 4, n_unique: 36, n_placed: 36, bounds: [[-556.0001, 0.0, -559.2], [0.0, 548.8, 0.0001220703]] },
    Expected { file: "gltf/Fox.glb", n_meshes: 1, n_instances: 1, n_unique: 576, n_placed: 576, bounds: [[-12.59272, -0.1217442, -88.09501], [12.59272, 78.9072, 66.62486]] },
    Expected { file: "gltf/SimpleMorph.gltf", n_meshes: 1, n_instances: 1, n_unique: 1, n_placed: 1, bounds: [[0.0, 0.0, 0.0], [1.0, 1.5, 0.0]] },
    Expected { file: "gltf/SimpleSkin.gltf", n_meshes: 1, n_instances: 1, n_unique: 8, n_placed: 8, bounds: [[-0.5, 0.0, 0.0], [0.5, 2.0, 0.0]] },
    Expected { file: "gltf/SimpleSparseAccessor.gltf", n_meshes: 1, n_instances: 1, n_unique: 12, n_placed: 12, bounds: [[0.0, 0.0, 0.0], [6.0, 4.0, 0.0]] },
    Expected { file: "gltf/camera_light.glb", n_meshes: 2, n_instances: 2, n_unique: 14, n_placed: 14, bounds: [[-7.101788, -7.102191, -1.040371], [7.101788, 7.102191, 1.0]] },
    Expected { file: "gltf/dragon_res3_quantized.glb", n_meshes: 1, n_instances: 1, n_unique: 47_794, n_placed: 47_794, bounds: [[-0.107673, 0.0527743, -0.050051], [0.0959825, 0.196643, 0.04082718]] },
    Expected { file: "gltf/lights_punctual.glb", n_meshes: 1, n_instances: 1, n_unique: 12, n_placed: 12, bounds: [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]] },
    Expected { file: "gltf/pine_tree.glb", n_meshes: 2, n_instances: 2, n_unique: 1_650, n_placed: 1_650, bounds: [[-29.21664, 0.0168803, -29.10383], [29.13073, 75.01419, 28.16341]] },
    Expected { file: "gltf/texture_transform.glb", n_meshes: 6, n_instances: 6, n_unique: 12, n_placed: 12, bounds: [[0.0, -1.2, 0.0], [3.4, 1.0, 0.0]] },
    Expected { file: "instanced/dragon_nodes.glb", n_meshes: 3, n_instances: 64, n_unique: 33_306, n_placed: 710_528, bounds: [[-1.751641, -2.961728, -1.629013], [18.38636, 2.612018, 19.18472]] },
    Expected { file: "instanced/pine_forest.glb", n_meshes: 3, n_instances: 1025, n_unique: 1_652, n_placed: 844_802, bounds: [[-4.0, -0.03054126, -4.0], [132.0, 4.475538, 68.0]] },
    Expected { file: "instanced/simple_instancing.glb", n_meshes: 1, n_instances: 125, n_unique: 12, n_placed: 1_500, bounds: [[-1.666667, -1.666667, -1.666667], [12.73171, 12.73171, 12.73171]] },
    Expected { file: "instanced/tower_field.glb", n_meshes: 3, n_instances: 401, n_unique: 13_629, n_placed: 2_264_242, bounds: [[-50.0, -1.819697, -50.0], [650.0, 41.90592, 450.0]] },
    Expected { file: "kitchen/country_kitchen.glb", n_meshes: 209, n_instances: 286, n_unique: 842_167, n_placed: 1_021_815, bounds: [[-3.138698, -0.020776, -3.183705], [3.777411, 3.363901, 5.470591]] },
    Expected { file: "sponza/sponza.gltf", n_meshes: 25, n_instances: 25, n_unique: 262_267, n_placed: 262_267, bounds: [[-19.20946, -1.264425, -11.82807], [17.99908, 14.29433, 11.05426]] },
    Expected { file: "stanford/dragon_871k.glb", n_meshes: 1, n_instances: 1, n_unique: 871_414, n_placed: 871_414, bounds: [[-0.108324, 0.0527295, -0.0504143], [0.0965662, 0.197173, 0.0412075]] },
    Expected { file: "truss/eiffel.glb", n_meshes: 1, n_instances: 1, n_unique: 228_892, n_placed: 228_892, bounds: [[-0.7788358, -1.201698, -7.612324], [12.39521, 23.3173, 3.497029]] },
    Expected { file: "truss/ferris_wheel.glb", n_meshes: 4, n_instances: 4, n_unique: 2_800, n_placed: 2_800, bounds: [[-5.396988, -0.011452, -1.492694], [5.51695, 12.80141, 1.492694]] },
    Expected { file: "truss/pirate_ship.glb", n_meshes: 26, n_instances: 26, n_unique: 1_763, n_placed: 1_763, bounds: [[-0.4501452, -0.03273198, -0.669361], [0.4568793, 1.198477, 0.6170363]] },
    Expected { file: "truss/radio_tower.glb", n_meshes: 1, n_instances: 1, n_unique: 4_892, n_placed: 4_892, bounds: [[-230.9895, -1.612519e-12, -264.6021], [230.8113, 1738.898, 262.7857]] },
    Expected { file: "truss/tower_crane.glb", n_meshes: 1, n_instances: 1, n_unique: 8_735, n_placed: 8_735, bounds: [[-128.8626, -5.30688e-06, -461.4536], [128.8626, 1379.063, 1077.31]] },
    Expected { file: "truss/truss_bridge.glb", n_meshes: 1, n_instances: 1, n_unique: 3_404, n_placed: 3_404, bounds: [[-166.7668, -36.65508, -307.3536], [166.7668, 155.5309, 307.3535]] },
    Expected { file: "truss/truss_stage.glb", n_meshes: 1, n_instances: 1, n_unique: 4_393, n_placed: 4_393, bounds: [[-0.1425819, -0.1433055, -0.7667899], [0.1479941, 0.1472705, 0.7572101]] },
];

/// The first difference between a scene and the expected values.
fn compare(scene: &Scene, expected: &Expected) -> Result<(), String> {
    let counts = [scene.meshes.len(), scene.instances.len(), scene.n_unique_triangles(), scene.n_placed_triangles()];
    let expected_counts = [expected.n_meshes, expected.n_instances, expected.n_unique, expected.n_placed];
    if counts != expected_counts {
        return Err(format!("counts {counts:?} for {expected_counts:?}"));
    }
    let bounds = scene.bounds_world();
    let found = [bounds.min, bounds.max].map(|corner| corner.map(f64::from));
    let reach = expected.bounds.as_flattened().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let differs = |(a, b): (&f64, &f64)| (a - b).abs() > BOUND_ERROR * reach;
    if found.as_flattened().iter().zip(expected.bounds.as_flattened()).any(differs) {
        return Err(format!("bounds {found:?} for {:?}", expected.bounds));
    }
    Ok(())
}

/// Asserts the guarantees of [`Scene`], and that coordinates are kept only if a texture uses them.
fn assert_consistent(scene: &Scene, file: &str) {
    assert_eq!(flaw(scene), None, "{file}");
    for mesh in &scene.meshes {
        let n_vertices = mesh.positions.len();
        for set in [UvSet::First, UvSet::Second] {
            let mut materials = mesh.parts.iter().map(|part| &scene.materials[part.material.0 as usize]);
            let is_used = materials.any(|material| material.textures().any(|texture| texture.uv_set == set));
            assert_eq!(mesh.uv_set(set).map(<[_]>::len), is_used.then_some(n_vertices), "{file}");
        }
    }
}

#[test]
fn real_files_have_the_expected_counts_and_bounds() {
    let Some(folder) = models("real_files_have_the_expected_counts_and_bounds") else { return };
    for expected in &FILES {
        let scene = read(&folder.join(expected.file)).unwrap_or_else(|error| panic!("{error}"));
        compare(&scene, expected).unwrap_or_else(|difference| panic!("{}: {difference}", expected.file));
        assert_consistent(&scene, expected.file);
    }
}

#[test]
fn every_real_file_is_listed() {
    let Some(folder) = models("every_real_file_is_listed") else { return };
    for subfolder in ["gltf", "instanced", "kitchen", "sponza", "stanford", "truss"] {
        for entry in fs::read_dir(folder.join(subfolder)).expect("folder exists") {
            let name = entry.expect("readable folder").file_name().into_string().expect("UTF-8 names");
            let is_gltf = name.ends_with(".gltf") || name.ends_with(".glb");
            assert!(!is_gltf || FILES.iter().any(|expected| expected.file == format!("{subfolder}/{name}")), "{name}");
        }
    }
}

#[test]
fn compare_detects_a_moved_instance() {
    let Some(folder) = models("compare_detects_a_moved_instance") else { return };
    let expected = FILES.iter().find(|expected| expected.file == "gltf/BoxInterleaved.glb").expect("listed");
    let mut scene = read(&folder.join(expected.file)).unwrap_or_else(|error| panic!("{error}"));
    scene.instances[0].world_from_object.columns[3][1] += 1e-5;
    assert!(compare(&scene, expected).is_err());
}

#[test]
fn errors_name_the_cause() {
    let Some(folder) = models("errors_name_the_cause") else { return };
    for (file, thing) in [
        ("required_extension_unknown.gltf", "EXT_not_known"),
        ("buffer_missing.gltf", "not_there.bin"),
        ("buffer_http.gltf", "http"),
        ("accessor_past_end.gltf", "accessor 0"),
        ("offset_overflow.gltf", "buffer view 0"),
        ("index_out_of_range.gltf", "is 7, out of range (3 vertices)"),
        ("node_cycle.gltf", "own ancestor"),
        ("node_two_parents.gltf", "node 2"),
        ("instancing_counts_differ.gltf", "3 and 2"),
    ] {
        let error = read(&folder.join("nasty/gltf").join(file)).expect_err(file).to_string();
        assert!(error.contains(thing), "{error}");
    }
}

/// The scene of a real file at a time.
fn at(folder: &Path, file: &str, time: f32) -> Scene {
    read_with(&folder.join(file), &ReadOptions { time: Some(time), ..ReadOptions::default() })
        .unwrap_or_else(|error| panic!("{error}"))
}

/// A 2 x 1 sheet whose upper half is rotated by a joint at half height.
#[test]
fn simple_skin_at_known_times() {
    let Some(folder) = models("simple_skin_at_known_times") else { return };
    // Computed in double precision from numbers below 2 and rounded once.
    let bound = 2.0 * f32::EPSILON;
    let edge_rotated = [[-1.0, 0.5, 0.0], [-1.0, 1.5, 0.0]];
    let edge_rotated_back = [[1.0, 1.5, 0.0], [1.0, 0.5, 0.0]];
    let edge_at_rest = [[-0.5, 2.0, 0.0], [0.5, 2.0, 0.0]];
    for (time, edge) in [
        (-1.0, edge_at_rest),
        (1.0, edge_rotated),
        (1.25, edge_rotated),
        (4.0, edge_rotated_back),
        (5.5, edge_at_rest),
        (99.0, edge_at_rest),
    ] {
        let scene = at(&folder, "gltf/SimpleSkin.gltf", time);
        let positions = &scene.meshes[0].positions;
        for (found, want) in positions[8..].iter().zip(edge) {
            assert!((0..3).all(|k| (found[k] - want[k]).abs() <= bound), "{found:?} for {want:?} at {time}");
        }
        assert_eq!(positions[..2], [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], "the lower edge does not move");
    }
    // Halfway between rotations of 45 and 90 degrees. The file stores the first quaternion with three digits. The error of the
    // rotation is at most the sum of these errors (doubled for the angle, halved by interpolation) times the corner's distance.
    let bound = 0.5e-3 * (0.924 + 0.383) * 1.25_f32.sqrt();
    let scene = at(&folder, "gltf/SimpleSkin.gltf", 0.75);
    let (sin, cos) = 67.5_f32.to_radians().sin_cos();
    let [x, y, _] = scene.meshes[0].positions[9];
    let want = [0.5 * cos - sin, 1.0 + 0.5 * sin + cos];
    assert!((x - want[0]).abs() < bound && (y - want[1]).abs() < bound, "{x} {y} for {want:?}");
}

#[test]
fn every_real_animation_changes_the_pose() {
    let Some(folder) = models("every_real_animation_changes_the_pose") else { return };
    for (file, warning) in [("Fox.glb", "animation 0 \"Survey\""), ("CesiumMan.glb", ""), ("SimpleMorph.gltf", "")] {
        let file = format!("gltf/{file}");
        let rest = read(&folder.join(&file)).unwrap_or_else(|error| panic!("{error}")).bounds_world();
        let posed: Vec<Scene> = [0.5, 1.0].map(|time| at(&folder, &file, time)).into();
        for scene in &posed {
            assert_consistent(scene, &file);
            assert!(scene.warnings.join("|").ends_with(warning), "{:?}", scene.warnings);
            // An animated figure keeps about the same size.
            let largest = |bounds: Aabb| bounds.extent().into_iter().fold(0.0, f64::max);
            let ratio = largest(scene.bounds_world()) / largest(rest);
            assert!((0.5..2.0).contains(&ratio), "{file}: {ratio}");
        }
        assert_ne!(posed[0].bounds_world(), posed[1].bounds_world(), "{file} moves");
    }
}

#[test]
fn lights_and_cameras_of_real_files() {
    let Some(folder) = models("lights_and_cameras_of_real_files") else { return };
    let scene = read(&folder.join("gltf/camera_light.glb")).unwrap_or_else(|error| panic!("{error}"));
    assert!(scene.lights.iter().any(|light| matches!(light, Light::Sun { .. } | Light::Point { .. })));
    let scene = read(&folder.join("gltf/Cameras.gltf")).unwrap_or_else(|error| panic!("{error}"));
    let projections: Vec<_> = scene.cameras.iter().map(|camera| camera.projection).collect();
    let [Projection::Perspective { fov_degrees }, Projection::Orthographic { height }] = projections[..] else {
        panic!("{projections:?}")
    };
    assert_eq!((fov_degrees, height, scene.warnings.len()), (0.7_f32.to_degrees(), 2.0, 0));
}
