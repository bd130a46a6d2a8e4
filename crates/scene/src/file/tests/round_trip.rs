//! What is written reads back as it was.

use proptest::prelude::*;

use super::*;
use crate::{Camera, Lens, Light, Projection};

#[track_caller]
fn comes_back(file: &SceneFile) {
    let text = file.to_toml();
    let back = parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(format!("{:?}", bare(back.clone())), format!("{:?}", bare(file.clone())), "{text}");
    assert_eq!(back.to_toml().len(), parse(&back.to_toml()).unwrap().to_toml().len());
}

#[test]
fn the_full_file_comes_back() {
    comes_back(&parse(FULL).unwrap());
}

#[test]
fn empty_lists_come_back_as_lists() {
    comes_back(&parse("").unwrap());
    let file = parse("lights = []\ninstances = []").unwrap();
    assert_eq!((file.lights.as_deref(), file.instances.as_deref()), (Some(&[][..]), Some(&[][..])));
    comes_back(&file);
}

#[test]
fn any_text_comes_back() {
    for name in ["", "\"", "\\", "a\nb\t\u{0}\u{7f}", "\u{1f9ca} \u{2028}", "'''", "# no"] {
        let mut file = parse("[[assets]]\nname = 'x'\nbuiltin = true").unwrap();
        name.clone_into(&mut file.assets[0].name);
        comes_back(&file);
    }
}

/// A finite number with all its bits.
fn number() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite())
}

fn positive() -> impl Strategy<Value = f32> {
    number().prop_map(f32::abs).prop_filter("above zero", |&x| x > 0.0)
}

proptest! {
    #[test]
    fn any_camera_comes_back(eye: [i16; 3], target in prop::array::uniform3(number()), fov_degrees in 1e-3_f32..179.9,
                             radius in positive(), focus_distance in positive(), flat: bool) {
        let eye = eye.map(f32::from);
        let mut camera = Camera::pinhole(eye, target, [0.5, 1.0, -0.25], fov_degrees);
        camera.lens = Some(Lens { radius, focus_distance });
        if flat {
            camera.projection = Projection::Orthographic { height: radius };
        }
        comes_back(&SceneFile { path: "scene.toml".into(), camera: Some(camera), ..SceneFile::default() });
    }

    #[test]
    fn any_spot_comes_back(direction in prop::array::uniform3(-1.0_f32..1.0), a in -1.0_f32..=1.0, b in -1.0_f32..=1.0,
                           n in 1_u8..4) {
        // Cosines at their full resolution near one, as those of narrow cones are.
        let [a, b] = [a, b].map(|x| 1.0 - (1.0 - x) / 1000_f32.powi(n.into()));
        prop_assume!(a != b);
        let direction = super::super::direction::unit(direction).unwrap();
        let light = Light::Spot {
            position: [0.0; 3], direction, intensity: [1.0; 3], cos_inner: a.max(b), cos_outer: a.min(b),
        };
        comes_back(&SceneFile { path: "scene.toml".into(), lights: Some(vec![light]), ..SceneFile::default() });
    }
}

#[test]
fn the_ends_of_cones_come_back() {
    for (cos_inner, cos_outer) in [(1.0, 0.0), (0.0, -1.0), (1.0, 1.0_f32.next_down()), ((-1_f32).next_up(), -1.0)] {
        let (position, direction, intensity) = ([0.0; 3], [0.0, -1.0, 0.0], [1.0; 3]);
        let light = Light::Spot { position, direction, intensity, cos_inner, cos_outer };
        comes_back(&SceneFile { path: "scene.toml".into(), lights: Some(vec![light]), ..SceneFile::default() });
    }
}

#[test]
fn everything_spelled_out_is_the_same_scene_and_stays_as_it_is() {
    let folder = folder();
    let path = folder.path().join("scene.toml");
    let file = SceneFile::parse(FULL.as_bytes(), &path).unwrap();
    let (scene, full) = file.load_explicit().unwrap();
    // All that a scene has but geometry; `green` was not mentioned before.
    assert!(full.overrides.iter().any(|change| change.material == "green"));
    let text = full.to_toml();
    let back = SceneFile::parse(text.as_bytes(), &path).unwrap();
    let (again, again_full) = back.load_explicit().unwrap();
    let parts =
        |scene: &crate::Scene| format!("{:?}", (&scene.instances, &scene.materials, &scene.lights, &scene.cameras));
    assert_eq!(parts(&again), parts(&scene));
    assert_eq!(format!("{:?}", bare(again_full)), format!("{:?}", bare(back)));
}

/// Materials of one name cannot be told apart in a scene file: what was said of the name is said again, and no more.
#[test]
fn what_was_said_of_a_name_that_two_have_is_kept() {
    let folder = folder();
    std::fs::write(folder.path().join("a.mtl"), TWO_MTL.replace("green", "red")).unwrap();
    let text = "[[assets]]\nname = \"a\"\nfile = \"a.gltf\"\n\
                [[overrides]]\nmaterial = \"red\"\nbase_color = [0, 0, 1]\n\
                [[overrides]]\nmaterial = \"red\"\nroughness = 0.25\n";
    let gltf = r#"{ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "materials": [{ "name": "red" }, { "name": "red", "pbrMetallicRoughness": { "metallicFactor": 0.5 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 },
                                    { "attributes": { "POSITION": 0 }, "material": 1 }] }],
        "accessors": [{ "componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 0 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }], "buffers": [{ "byteLength": 36, "uri": "a.bin" }] }"#;
    std::fs::write(folder.path().join("a.gltf"), gltf).unwrap();
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    std::fs::write(folder.path().join("a.bin"), corners.concat()).unwrap();
    let path = folder.path().join("scene.toml");
    let (scene, full) = SceneFile::parse(text.as_bytes(), &path).unwrap().load_explicit().unwrap();
    assert_eq!(full.overrides.len(), 1);
    let again = SceneFile::parse(full.to_toml().as_bytes(), &path).unwrap().load().unwrap();
    assert!(again.materials.iter().filter(|material| material.base_color == [0.0, 0.0, 1.0]).count() == 2);
    assert_eq!(format!("{:?}", again.materials), format!("{:?}", scene.materials));
}

/// What a file asks for lies beside the name by which it was reached.
#[test]
#[cfg(unix)]
fn a_link_stays_the_file_that_is_named() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("store")).unwrap();
    std::fs::rename(folder.path().join("a.obj"), folder.path().join("store/1f2e.obj")).unwrap();
    std::os::unix::fs::symlink("store/1f2e.obj", folder.path().join("a.obj")).unwrap();
    let file = SceneFile::parse(FULL.as_bytes(), &folder.path().join("scene.toml")).unwrap();
    let moved = file.moved_to(&folder.path().join("sub/scene.toml")).unwrap();
    assert!(moved.to_toml().contains("\"../a.obj\""), "{}", moved.to_toml());
}

#[test]
fn a_file_that_moves_means_the_same_files() {
    let folder = folder();
    let file = SceneFile::parse(FULL.as_bytes(), &folder.path().join("scene.toml")).unwrap();
    let moved = file.clone().moved_to(&folder.path().join("sub/scene.toml")).unwrap();
    let text = moved.to_toml();
    assert!(text.contains("\"../a.obj\"") && text.contains("\"b.obj\""), "{text}");
    let back = moved.moved_to(&folder.path().join("scene.toml")).unwrap();
    assert_eq!(back.to_toml(), file.to_toml());
}
