//! Real models load without warnings and with known counts. Skipped if the folder is absent.

use canted_scene::{Scene, SceneStats, read};

/// Reads a model that must load without a warning.
fn load(test: &str, file: &str) -> Option<Scene> {
    let scene = read(&crate::folder::models(test)?.join(file)).unwrap();
    assert_eq!(scene.warnings, [""; 0], "{file}");
    Some(scene)
}

/// Asserts that triangles are numbered consecutively in file order.
fn assert_numbered(scene: &Scene) {
    let mut next = 0;
    for instance in &scene.instances {
        assert_eq!(instance.first_primitive, next);
        next += u32::try_from(scene.meshes[instance.mesh.0 as usize].triangles.len()).unwrap();
    }
}

#[test]
fn ply_models() {
    for (file, n_triangles, n_vertices) in [
        ("stanford/bunny.ply", 69_451, 35_947),
        ("stanford/dragon_res2.ply", 202_520, 100_250),
        ("stanford/dragon_res4_be.ply", 11_102, 5_205),
        ("ply/cube_ascii.ply", 12, 8),
        ("ply/cube_le.ply", 12, 8),
        ("ply/cube_be.ply", 12, 8),
        ("ply/teapot.ply", 2_256, 1_177),
        ("ply/rectangle_normals_uv.ply", 2, 4),
        ("ply/triangle_face_colors.ply", 1, 3),
    ] {
        let Some(scene) = load("ply_models", file) else { return };
        let counts = SceneStats::of(&scene);
        assert_eq!((counts.n_placed_triangles, counts.n_vertices), (n_triangles, n_vertices), "{file}");
        assert_numbered(&scene);
    }
}

#[test]
fn sponza() {
    let Some(scene) = load("sponza", "sponza/sponza.obj") else { return };
    let counts = SceneStats::of(&scene);
    assert_eq!(counts.n_placed_triangles, 262_267);
    assert_eq!((counts.n_materials, counts.n_textures), (25, 27), "24 color images and 3 masks");
    assert_eq!(scene.materials.iter().filter(|material| material.alpha_texture.is_some()).count(), 3);
    assert_eq!(counts.n_instances, 393, "381 groups, some with several materials");
    for mesh in &scene.meshes {
        let is_textured = scene.materials[mesh.material_of(0).0 as usize].base_color_texture.is_some();
        assert_eq!((mesh.uvs.is_some(), mesh.normals.is_some()), (is_textured, false), "{}", mesh.name);
    }
    assert_numbered(&scene);
}

#[test]
fn cornell_boxes() {
    let Some(scene) = load("cornell_boxes", "cornell/cornellBox.obj") else { return };
    assert_eq!((scene.n_placed_triangles(), scene.instances.len()), (32, 8));
    assert_eq!(scene.materials[0].emission, [1.0; 3]);
    assert_numbered(&scene);

    let Some(scene) = load("cornell_boxes", "cornell/cornell_box_suzanne.obj") else { return };
    assert_eq!((scene.n_placed_triangles(), scene.materials.len()), (3_968, 4));
    assert_numbered(&scene);
}
