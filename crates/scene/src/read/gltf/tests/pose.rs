//! Default poses: morph targets and skins.

use serde_json::{Value, json};

use super::{F32, File, TRIANGLE, U8};

/// Column-major 4 x 4 matrix of a translation by `x`.
fn translation(x: f32) -> [f32; 16] {
    [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0]
}

/// The triangle with a morph target that moves vertices by 4 along z and tilts normals.
fn morphing() -> File {
    let mut file = File::new();
    let (positions, normals) = (file.reals("VEC3", &TRIANGLE), file.reals("VEC3", &[0.0, 0.0, 1.0].repeat(3)));
    let (lift, tilt) =
        (file.reals("VEC3", &[0.0, 0.0, 4.0].repeat(3)), file.reals("VEC3", &[1.0, 0.0, -1.0].repeat(3)));
    file.with_node(json!([{
        "attributes": { "POSITION": positions, "NORMAL": normals },
        "targets": [{ "POSITION": lift, "NORMAL": tilt }],
    }]))
}

#[test]
fn morph_weights_of_the_mesh_or_the_node() {
    let mut file = morphing();
    let first = |file: &File| {
        let mesh = &file.scene().meshes[0];
        (mesh.positions[1], mesh.normals.as_ref().unwrap()[1])
    };
    assert_eq!(first(&file), ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), "weights default to zero");
    file.json["meshes"][0]["weights"] = json!([0.25]);
    assert_eq!(first(&file).0, [1.0, 0.0, 1.0]);
    file.json["nodes"][0]["weights"] = json!([0.25]);
    file.push("nodes", json!({ "mesh": 0 }));
    assert_eq!(file.scene().meshes.len(), 1, "equal weights share the mesh");
    file.json["nodes"].as_array_mut().unwrap().pop();
    file.json["nodes"][0]["weights"] = json!([1]);
    assert_eq!(first(&file), ([1.0, 0.0, 4.0], [1.0, 0.0, 0.0]));
    file.push("nodes", json!({ "mesh": 0 }));
    let scene = file.scene();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (2, 2), "different weights need a copy");
    let heights: Vec<f32> =
        scene.instances.iter().map(|instance| scene.meshes[instance.mesh.0 as usize].positions[0][2]).collect();
    assert_eq!(heights, [4.0, 1.0]);
    assert!(
        scene.instances.iter().all(|instance| instance.first_primitive == 0),
        "both have the numbers of the file's mesh"
    );
}

#[test]
fn mismatched_morph_targets_are_rejected() {
    let mut file = morphing();
    let short = file.reals("VEC3", &[0.0; 6]);
    file.json["meshes"][0]["weights"] = json!([1]);
    file.json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = json!(short);
    file.rejected("morph target has 2 elements, expected 3");
}

#[test]
fn active_unsupported_morph_targets_are_reported() {
    let mut file = morphing();
    let (shift, tint) = (file.reals("VEC2", &[0.5; 6]), file.reals("VEC4", &[0.5; 12]));
    let target = &mut file.json["meshes"][0]["primitives"][0]["targets"][0];
    (target["TEXCOORD_0"], target["COLOR_0"]) = (json!(shift), json!(tint));
    file.scene();
    file.json["nodes"][0]["weights"] = json!([0.5]);
    file.push("nodes", json!({ "mesh": 0, "weights": [1] }));
    let warning = |name| format!("ignoring {name} of morph targets (not supported): mesh 0 and 1 more");
    assert_eq!(file.read().unwrap().warnings, ["TEXCOORD_0", "COLOR_0"].map(warning));
    // Unused meshes are not reported.
    let mesh = file.json["meshes"][0].clone();
    file.push("meshes", mesh);
    file.json["meshes"][1]["weights"] = json!([1]);
    file.json["nodes"] = json!([{ "mesh": 0 }]);
    file.scene();
}

#[test]
fn excess_weights_are_reported() {
    let mut file = morphing();
    file.json["meshes"][0]["weights"] = json!([0.25, 0.5, 1]);
    let scene = file.warned("ignoring weights without a morph target: mesh 0, 3 weights for 1 targets");
    assert_eq!(scene.meshes[0].positions[1], [1.0, 0.0, 1.0]);
    file.json["nodes"][0]["weights"] = json!([1, 1]);
    file.warned("ignoring weights without a morph target: node 0, 2 weights for 1 targets");
}

/// The triangle in a skin of two joints, translated by 10 and 30 from their bind pose.
fn skinned(joints: &[u8; 12], weights: &[f32; 12]) -> File {
    let mut file = File::new();
    let (positions, normals) = (file.reals("VEC3", &TRIANGLE), file.reals("VEC3", &[0.0, 0.0, 1.0].repeat(3)));
    let (joints, weights) = (file.accessor(U8, "VEC4", 3, joints), file.reals("VEC4", weights));
    let inverse_binds = file.reals("MAT4", &[translation(-1.0), translation(-2.0)].concat());
    file.push("skins", json!({ "joints": [1, 2], "inverseBindMatrices": inverse_binds }));
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights });
    let mesh = file.mesh(json!([{ "attributes": attributes }]));
    file.json["nodes"] = json!([
        { "mesh": mesh, "skin": 0, "translation": [1000, 0, 0] },
        { "children": [2], "translation": [11, 0, 0] },
        { "translation": [21, 0, 0] },
    ]);
    file
}

const JOINTS: [u8; 12] = [0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 9, 9];
const WEIGHTS: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0];

#[test]
fn skins_follow_joints_and_ignore_the_node() {
    let scene = skinned(&JOINTS, &WEIGHTS).scene();
    assert_eq!(scene.meshes[0].positions, [[10.0, 0.0, 0.0], [31.0, 0.0, 0.0], [20.0, 1.0, 0.0]]);
    assert_eq!(scene.instances[0].world_from_object, canted_obb::Affine::IDENTITY);
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 1));
}

#[test]
fn weights_are_normalized() {
    let scene = skinned(&JOINTS, &WEIGHTS.map(|weight| 4.0 * weight)).scene();
    assert_eq!(scene.meshes[0].positions[2], [20.0, 1.0, 0.0]);
}

#[test]
fn normals_follow_joints() {
    let mut file = skinned(&JOINTS, &WEIGHTS);
    // The first joint rotates by 180 degrees about x and scales; the normal stays normalized.
    file.json["nodes"][1]["rotation"] = json!([1, 0, 0, 0]);
    file.json["nodes"][1]["scale"] = json!([3, 1, 5]);
    let scene = file.scene();
    assert_eq!(scene.meshes[0].normals.as_ref().unwrap()[0], [0.0, 0.0, -1.0]);
}

#[test]
fn invalid_skins_are_rejected() {
    let mut joints = JOINTS;
    joints[4] = 2;
    skinned(&joints, &WEIGHTS).rejected("joint 2 of vertex 1 is not in the skin");
    let with = |change: &dyn Fn(&mut Value)| {
        let mut file = skinned(&JOINTS, &WEIGHTS);
        change(&mut file.json);
        file
    };
    with(&|json| json["skins"][0]["joints"] = json!([1, 2, 0]))
        .rejected("skin 0: 2 inverse bind matrices for 3 joints");
    with(&|json| json["skins"][0]["joints"] = json!([1, 9])).rejected("skin 0: node index 9 out of range");
    with(&|json| json["nodes"][0]["skin"] = json!(1)).rejected("node 0: skin index 1 out of range");
    with(&|json| json["accessors"][3]["count"] = json!(2)).rejected("joints or weights do not match 3 vertices");
    with(&|json| json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = Value::Null).rejected("json");
    with(&|json| {
        let attributes = json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
        attributes.remove("WEIGHTS_0");
    })
    .rejected("needs joints and weights");
    with(&|json| json["accessors"][4]["componentType"] = json!(F32 + 1)).rejected("accessor 4");
}

#[test]
fn unweighted_vertices_follow_the_first_joint() {
    let mut weights = WEIGHTS;
    (weights[4], weights[8], weights[9]) = (0.0, 1.0, -1.0);
    let scene = skinned(&JOINTS, &weights)
        .warned("vertices with zero joint weights, attached to the first joint of their skin: 2");
    assert_eq!(scene.meshes[0].positions, [[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [10.0, 1.0, 0.0]]);
    assert_eq!(scene.meshes[0].normals.as_deref().unwrap(), [[0.0, 0.0, 1.0]; 3]);
    let mut jointless = skinned(&JOINTS, &[0.0; 12]);
    jointless.json["skins"][0]["joints"] = json!([]);
    jointless.rejected("joint 0 of vertex 0 is not in the skin");
}

/// A roof of two triangles that a target folds along the ridge. The target stores no normals, so they follow the triangles.
#[test]
fn normals_of_targets_without_normals_follow_the_triangles() {
    let flat = |seam: bool| {
        let mut file = File::new();
        // Two triangles on either side of the ridge x = 0; with a seam, each has its own vertices on it.
        let [left, right] =
            [[0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0]];
        let mut down: Vec<f32> = [[0.0; 9], [0.0; 9]].concat();
        (down[8], down[17]) = (-1.0, -1.0);
        let positions: Vec<f32> = [left, right].concat();
        let normals = [0.0, 0.0, 1.0].repeat(6);
        let indices: &[u8] = if seam { &[0, 1, 2, 3, 4, 5] } else { &[0, 1, 2, 1, 0, 5] };
        let (positions, normals) = (file.reals("VEC3", &positions), file.reals("VEC3", &normals));
        let (down, indices) = (file.reals("VEC3", &down), file.accessor(U8, "SCALAR", indices.len(), indices));
        file.with_node(json!([{
            "attributes": { "POSITION": positions, "NORMAL": normals },
            "indices": indices,
            "targets": [{ "POSITION": down }],
        }]))
    };
    for seam in [false, true] {
        let mut file = flat(seam);
        let normals = |file: &File| file.scene().meshes[0].normals.clone().unwrap();
        assert!(normals(&file).iter().all(|normal| *normal == [0.0, 0.0, 1.0]), "without weight");
        file.json["meshes"][0]["weights"] = json!([1]);
        let folded = normals(&file);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let is_near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(is_near(folded[0], [0.0, 0.0, 1.0]), "smooth at the ridge: {folded:?}");
        assert!(is_near(folded[2], [-half, 0.0, half]), "{folded:?}");
        assert!(is_near(folded[folded.len() - 1], [half, 0.0, half]), "{folded:?}");
        // A small weight changes normals little.
        file.json["meshes"][0]["weights"] = json!([0.001]);
        assert!(normals(&file).iter().all(|[x, _, z]| x.abs() < 2e-3 && (z - 1.0).abs() < 1e-5));
    }
}
