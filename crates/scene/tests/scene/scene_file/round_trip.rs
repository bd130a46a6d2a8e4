//! Written scene files parse back to the same values.

use proptest::prelude::*;

use super::*;
use canted_scene::{Camera, Lens, Light, Projection, Scene};

#[track_caller]
fn round_trips(file: &SceneFile) {
    let text = file.to_toml();
    let back = parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(format!("{:?}", without_lines(back.clone())), format!("{:?}", without_lines(file.clone())), "{text}");
    assert_eq!(back.to_toml().len(), parse(&back.to_toml()).unwrap().to_toml().len());
}

#[test]
fn full_file_round_trips() {
    round_trips(&parse(FULL).unwrap());
}

#[test]
fn empty_arrays_round_trip() {
    round_trips(&parse("").unwrap());
    let file = parse("lights = []\ninstances = []").unwrap();
    assert_eq!((file.lights.as_deref(), file.instances.as_deref()), (Some(&[][..]), Some(&[][..])));
    round_trips(&file);
}

#[test]
fn any_string_round_trips() {
    for name in ["", "\"", "\\", "a\nb\t\u{0}\u{7f}", "\u{1f9ca} \u{2028}", "'''", "# no"] {
        let mut file = parse("[[assets]]\nname = 'x'\nbuiltin = true").unwrap();
        name.clone_into(&mut file.assets[0].name);
        round_trips(&file);
    }
}

/// An empty scene file with a change.
fn with(change: impl FnOnce(&mut SceneFile)) -> SceneFile {
    let mut file = parse("").unwrap();
    change(&mut file);
    file
}

/// Any finite number.
fn number() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite())
}

fn positive() -> impl Strategy<Value = f32> {
    number().prop_map(f32::abs).prop_filter("above zero", |&x| x > 0.0)
}

proptest! {
    #[test]
    fn any_camera_round_trips(eye: [i16; 3], target in prop::array::uniform3(number()), fov_degrees in 1e-3_f32..179.9,
                             radius in positive(), focus_distance in positive(), flat: bool) {
        let eye = eye.map(f32::from);
        let mut camera = Camera::pinhole(eye, target, [0.5, 1.0, -0.25], fov_degrees);
        camera.lens = Some(Lens { radius, focus_distance });
        if flat {
            camera.projection = Projection::Orthographic { height: radius };
        }
        round_trips(&with(|file| file.camera = Some(camera)));
    }

    #[test]
    fn any_spot_round_trips(direction in prop::array::uniform3(-1.0_f32..1.0), a in -1.0_f32..=1.0, b in -1.0_f32..=1.0,
                           n in 1_u8..4) {
        // Covers cosines near one, as for narrow cones.
        let [a, b] = [a, b].map(|x| 1.0 - (1.0 - x) / 1000_f32.powi(n.into()));
        prop_assume!(a != b);
        let length = direction.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
        prop_assume!(length > 0.0);
        let direction = direction.map(|x| (f64::from(x) / length) as f32);
        let light = Light::Spot {
            position: [0.0; 3], direction, intensity: [1.0; 3], cos_inner: a.max(b), cos_outer: a.min(b),
        };
        round_trips(&with(|file| file.lights = Some(vec![light])));
    }
}

#[test]
fn extreme_cones_round_trip() {
    for (cos_inner, cos_outer) in [(1.0, 0.0), (0.0, -1.0), (1.0, 1.0_f32.next_down()), ((-1_f32).next_up(), -1.0)] {
        let (position, direction, intensity) = ([0.0; 3], [0.0, -1.0, 0.0], [1.0; 3]);
        let light = Light::Spot { position, direction, intensity, cos_inner, cos_outer };
        round_trips(&with(|file| file.lights = Some(vec![light])));
    }
}

#[test]
fn load_explicit_keeps_the_scene_and_is_idempotent() {
    let folder = folder();
    let path = folder.path().join("scene.toml");
    let file = SceneFile::parse(FULL.as_bytes(), &path).unwrap();
    let (scene, full) = file.load_explicit().unwrap();
    // `green` is not in the original file.
    assert!(full.overrides.iter().any(|change| change.material == "green"));
    let text = full.to_toml();
    let back = SceneFile::parse(text.as_bytes(), &path).unwrap();
    let (again, again_full) = back.load_explicit().unwrap();
    let parts = |scene: &Scene| format!("{:?}", (&scene.instances, &scene.materials, &scene.lights, &scene.cameras));
    assert_eq!(parts(&again), parts(&scene));
    assert_eq!(format!("{:?}", without_lines(again_full)), format!("{:?}", without_lines(back)));
}

/// Materials with equal names keep only the fields that the scene file sets.
#[test]
fn overrides_of_ambiguous_names_are_kept() {
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

/// Files referenced by an asset lie next to the link, not next to its target.
#[test]
#[cfg(unix)]
fn links_are_not_followed() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("store")).unwrap();
    std::fs::rename(folder.path().join("a.obj"), folder.path().join("store/1f2e.obj")).unwrap();
    std::os::unix::fs::symlink("store/1f2e.obj", folder.path().join("a.obj")).unwrap();
    let file = SceneFile::parse(FULL.as_bytes(), &folder.path().join("scene.toml")).unwrap();
    let moved = file.moved_to(&folder.path().join("sub/scene.toml")).unwrap();
    assert!(moved.to_toml().contains("\"../a.obj\""), "{}", moved.to_toml());
}

#[test]
fn moved_files_reference_the_same_files() {
    let folder = folder();
    let file = SceneFile::parse(FULL.as_bytes(), &folder.path().join("scene.toml")).unwrap();
    let moved = file.clone().moved_to(&folder.path().join("sub/scene.toml")).unwrap();
    let text = moved.to_toml();
    assert!(text.contains("\"../a.obj\"") && text.contains("\"b.obj\""), "{text}");
    let back = moved.moved_to(&folder.path().join("scene.toml")).unwrap();
    assert_eq!(back.to_toml(), file.to_toml());
}
