//! Pictures of bicubic patches on a device, compared with those of the CPU.

use canted_film::Aov;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_renderer::{Integrator, Levels, Settings};
use canted_scene::{
    AlphaMode, Camera, CurveSegments, CurveShape, Curves, Encoding, Magnification, Material, MaterialId, Mesh,
    MeshClose, Part, Scene, Texture, TextureId, TextureRef, Wrap,
};

use crate::curves::{check_motion, small, wood};
use crate::gpu;
use crate::scenes::{self, compared, difference, instance, on_cpu, on_device, scene_bvh};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(patches_between_triangles),
        needs_device(textures_and_holes_on_patches),
        needs_device(patches_that_move),
        needs_device(patches_with_one_side),
        needs_device(the_comparison_detects_flat_patches),
    ]
}

/// Six patches around a cube whose control points are moved to a sphere, and a bent sheet; neighbors share their control points. Outward is the front.
fn ball(bulge: f32, material: u32) -> Mesh {
    let (mut positions, mut list): (Vec<[f32; 3]>, Vec<[u32; 16]>) = (vec![], vec![]);
    let mut number = |point: [f32; 3]| {
        let known = positions.iter().position(|p| *p == point);
        known.unwrap_or_else(|| {
            positions.push(point);
            positions.len() - 1
        }) as u32
    };
    for side in 0..6 {
        let (axis, at) = (side / 2, [-1.0_f32, 1.0][side % 2]);
        list.push(std::array::from_fn(|k| {
            let (a, b) = if at > 0.0 { (k / 4, k % 4) } else { (k % 4, k / 4) };
            let mut point = [at; 3];
            point[(axis + 1) % 3] = (2.0 * a as f32 - 3.0) / 3.0;
            point[(axis + 2) % 3] = (2.0 * b as f32 - 3.0) / 3.0;
            let length = point.iter().map(|x| x * x).sum::<f32>().sqrt();
            number(point.map(|x| x * (bulge / length + 0.5 * (1.0 - bulge))))
        }));
    }
    list.push(std::array::from_fn(|k| {
        let (i, j) = (k / 4, k % 4);
        let height = if (1..3).contains(&i) && (1..3).contains(&j) { 1.8 * bulge } else { 0.0 };
        number([i as f32 - 1.5, 1.3 + height, 1.5 - j as f32])
    }));
    let colors = positions.iter().map(|[x, y, z]| [0.6 + 0.3 * x, 0.6 - 0.2 * y, 0.6 + 0.3 * z, 0.5]);
    let colors = Some(colors.map(|color| color.map(|c| c.clamp(0.05, 0.95))).collect());
    let curves =
        Curves { radii: vec![0.0; positions.len()], segments: CurveSegments::Patches(list), shape: CurveShape::Tube };
    let parts = vec![Part { first_triangle: 0, material: MaterialId(material) }];
    Mesh { positions, colors, curves: Some(curves), parts, ..Mesh::default() }
}

/// The room with patches: as they are, and sheared and mirrored.
fn room_with(bulge: f32, material: Material) -> (Scene, Camera) {
    let (mut scene, camera) = scenes::room();
    let mesh = scene.meshes.len() as u32;
    scene.meshes.push(ball(bulge, scene.materials.len() as u32));
    scene.materials.push(material);
    scene.instances.push(instance(mesh, [[0.5, 0.0, 0.1], [0.0, 0.5, 0.0], [-0.1, 0.0, 0.5], [-0.6, 0.3, 0.9]]));
    scene.instances.push(instance(mesh, [[-0.4, 0.1, 0.0], [0.2, 0.5, 0.1], [0.0, -0.1, 0.4], [1.0, 0.7, 0.6]]));
    (scene, camera)
}

/// Tubes are beside patches.
fn patches_between_triangles() {
    let gpu = gpu();
    let (mut scene, camera) = room_with(1.0, wood());
    let last = scene.materials.len() - 1;
    let mut tubes = ball(0.7, last as u32);
    let Some(curves) = &mut tubes.curves else { panic!("no curves") };
    curves.radii.fill(0.06);
    curves.segments = CurveSegments::Cubic((0..5).map(|k| [4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3]).collect());
    let columns = [[0.7, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.0, 0.7], [0.2, 0.0, 0.4]];
    scene.instances.push(instance(scene.meshes.len() as u32, columns));
    scene.meshes.push(tubes);
    compared(&gpu, &scene, &camera, Levels::Auto, &small(Integrator::Hybrid)).check("patches", [0.4, 0.01]);
    let aovs = [Aov::Normal, Aov::Depth].into_iter().collect();
    let with_aovs = Settings { aovs, ..small(Integrator::Path) };
    scene.materials[last] = Material { transmission: 0.7, ior: 1.4, roughness: 0.3, specular: 1.0, ..wood() };
    compared(&gpu, &scene, &camera, Levels::Auto, &with_aovs).check("glass", [0.5, 0.02]);
}

fn textures_and_holes_on_patches() {
    let gpu = gpu();
    let (mut scene, camera) = room_with(1.0, wood());
    let texture = |texel: &dyn Fn(u8, u8) -> [u8; 4]| Texture {
        name: "squares".to_owned(),
        width: 16,
        height: 16,
        texels: (0..=255_u8).map(|i| texel(i % 16 / 4, i / 16 / 4)).collect(),
        encoding: Encoding::Srgb,
        wrap: [Wrap::Repeat; 2],
        magnification: Magnification::Linear,
    };
    scene.textures =
        vec![texture(&|x, y| [80 * x, 80 * y, 200, 255]), texture(&|x, y| [255, 255, 255, 255 * ((x + y) % 2)])];
    let last = scene.materials.len() - 1;
    scene.materials[last].base_color_texture = Some(TextureRef::new(TextureId(0)));
    scene.materials[last].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    scene.materials[last].alpha_texture = Some(TextureRef::new(TextureId(1)));
    let settings = small(Integrator::Path);
    compared(&gpu, &scene, &camera, Levels::Auto, &settings).check("holes", [0.5, 0.02]);
    // The comparison detects other holes.
    let theirs = on_cpu(&scene, &scene_bvh(&scene, Levels::Auto), &camera, &settings);
    scene.textures[1] = texture(&|x, y| [255, 255, 255, 255 * ((x + y + 1) % 2)]);
    let ours = on_device(&gpu, &scene, &scene_bvh(&scene, Levels::Auto), &camera, &settings);
    difference(&ours, &theirs).check_detects("other holes");
}

fn patches_that_move() {
    // Patches that glow and grow: the mean of the picture tells whether they move.
    let (mut scene, camera) = room_with(1.0, Material { emission: [0.6, 0.4, 0.2], ..wood() });
    for mesh in scene.meshes.iter_mut().filter(|mesh| mesh.has_patches()) {
        let close = |[x, y, z]: [f32; 3]| [1.8 * x + 0.3 * y + 0.4, 1.8 * y - 0.2 * x, 1.4 * z + 0.4];
        let positions = mesh.positions.iter().copied().map(close).collect();
        mesh.close = Some(MeshClose { positions, normals: None, tangents: None, radii: None });
    }
    check_motion(&scene, &camera);
}

/// Backs are not seen; light falls through them where the eye is behind.
fn patches_with_one_side() {
    let gpu = gpu();
    let (mut scene, camera) = room_with(1.0, wood());
    let last = scene.materials.len() - 1;
    scene.materials[last].double_sided = false;
    // Without its front, the inside of the ball is seen.
    let list = scene.meshes.iter_mut().filter_map(|mesh| mesh.curves.as_mut());
    for curves in list {
        if let CurveSegments::Patches(list) = &mut curves.segments {
            list.remove(5);
            list[0].reverse();
        }
    }
    compared(&gpu, &scene, &camera, Levels::Auto, &small(Integrator::Hybrid)).check("one side", [0.4, 0.02]);
}

fn the_comparison_detects_flat_patches() {
    let gpu = gpu();
    let (scene, camera) = room_with(1.0, wood());
    let (flatter, _) = room_with(0.6, wood());
    let settings = small(Integrator::Path);
    let ours = on_device(&gpu, &flatter, &scene_bvh(&flatter, Levels::Auto), &camera, &settings);
    let theirs = on_cpu(&scene, &scene_bvh(&scene, Levels::Auto), &camera, &settings);
    difference(&ours, &theirs).check_detects("flat patches");
}
