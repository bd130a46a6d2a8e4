//! Pictures of curves on a device, compared with those of the CPU, and what devices refuse.

use canted_film::Aov;
use canted_fixtures::SplitMix64;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_renderer::{DevicePicture, FirstHit, Integrator, Levels, Lod, Settings, Surfaces};
use canted_scene::{
    AlphaMode, Camera, CurveSegments, CurveShape, Curves, Encoding, Instance, Magnification, Material, MaterialId,
    Mesh, MeshClose, Part, Scene, Texture, TextureId, TextureRef, Wrap,
};

use crate::gpu;
use crate::scenes::{self, compared, difference, instance, on_cpu, on_device, scene_bvh};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(curves_between_triangles),
        needs_device(hair_on_curves),
        needs_device(curves_that_move_and_curves_with_alpha),
        needs_device(cubic_curves_and_ribbons),
        needs_device(curves_whose_points_move),
        needs_device(textures_on_curves),
        needs_device(rays_through_tips_enter_there),
        needs_device(the_comparison_detects_thinner_curves),
        needs_device(what_devices_do_not_draw_is_refused_by_name),
    ]
}

/// Strands of segments from a ball outward, thinner towards their tips.
fn strands(n: u32, radius: f32, material: u32) -> Mesh {
    let mut rng = SplitMix64::new(7);
    let (mut positions, mut radii, mut colors, mut list) = (vec![], vec![], vec![], vec![]);
    for _ in 0..n {
        let out = rng.on_sphere().map(|x| x as f32);
        let bend = rng.on_sphere().map(|x| 0.1 * x as f32);
        for k in 0_u8..=5 {
            let along = 0.5 + 0.1 * f32::from(k);
            let square = f32::from(k) * f32::from(k) / 10.0;
            if k > 0 {
                list.push([positions.len() as u32 - 1, positions.len() as u32]);
            }
            positions.push([0, 1, 2].map(|axis| along * out[axis] + square * bend[axis]));
            radii.push(radius * (1.0 - 0.15 * f32::from(k)));
            colors.push([0.2 + 0.1 * f32::from(k), 0.6, 0.9 - 0.1 * f32::from(k), 0.3]);
        }
    }
    Mesh {
        positions,
        colors: Some(colors),
        curves: Some(Curves { radii, segments: CurveSegments::Linear(list), shape: CurveShape::Tube }),
        parts: vec![Part { first_triangle: 0, material: MaterialId(material) }],
        ..Mesh::default()
    }
}

/// The room of all lights, with strands in it: as they are, and sheared and mirrored.
fn hairy_room(radius: f32, material: Material) -> (Scene, Camera) {
    let (mut scene, camera) = scenes::room();
    let mesh = scene.meshes.len() as u32;
    scene.meshes.push(strands(60, radius, scene.materials.len() as u32));
    scene.materials.push(material);
    scene.instances.push(instance(mesh, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-0.2, 0.4, 0.8]]));
    scene.instances.push(instance(mesh, [[-0.7, 0.1, 0.0], [0.2, 0.7, 0.1], [0.0, -0.1, 0.7], [1.2, 0.9, 0.2]]));
    (scene, camera)
}

pub(super) fn small(integrator: Integrator) -> Settings {
    Settings { width: 64, height: 36, samples: 4, integrator, bounces: 4, ..Settings::default() }
}

pub(super) fn wood() -> Material {
    Material { base_color: [0.8, 0.7, 0.6], ..Material::default() }
}

fn curves_between_triangles() {
    let gpu = gpu();
    let (mut scene, camera) = hairy_room(0.05, wood());
    for integrator in Integrator::ALL {
        compared(&gpu, &scene, &camera, Levels::Auto, &small(integrator)).check("curves", [0.4, 0.01]);
    }
    // Glossy curves before a sky, and others that emit.
    let last = scene.materials.len() - 1;
    scene.materials[last].specular = 1.0;
    scene.materials[last].roughness = 0.3;
    scene.environment = Some(scenes::sky());
    compared(&gpu, &scene, &camera, Levels::Auto, &small(Integrator::Path)).check("gloss", [0.4, 0.02]);
    scene.materials[last].emission = [0.5, 0.4, 0.1];
    compared(&gpu, &scene, &camera, Levels::Auto, &small(Integrator::Path)).check("emission", [0.4, 0.02]);
    let with_aovs = Settings { aovs: [Aov::Normal, Aov::Depth].into_iter().collect(), ..small(Integrator::Hybrid) };
    compared(&gpu, &scene, &camera, Levels::Auto, &with_aovs).check("AOVs", [0.4, 0.02]);
}

fn hair_on_curves() {
    let gpu = gpu();
    let mut brown = wood();
    brown.hair_mut().melanin = 1.3;
    let mut blond = wood();
    blond.hair_mut();
    for (name, material) in [("melanin", brown), ("color", blond)] {
        let (mut scene, camera) = hairy_room(0.03, material.clone());
        // Triangles of the same material are not hair.
        scene.meshes[1].parts[0].material = MaterialId(scene.materials.len() as u32 - 1);
        for integrator in Integrator::ALL {
            compared(&gpu, &scene, &camera, Levels::Auto, &small(integrator)).check(name, [0.5, 0.02]);
        }
    }
}

/// Curves that are not round segments: cubic tubes, ribbons, cubic ribbons.
const KINDS: [(CurveShape, bool); 3] =
    [(CurveShape::Tube, true), (CurveShape::Ribbon, false), (CurveShape::Ribbon, true)];

/// The room with strands of each of these kinds, mirrored and sheared by turns.
fn room_of_kinds(radius: f32, material: Material, kinds: &[(CurveShape, bool)]) -> (Scene, Camera) {
    let (mut scene, camera) = scenes::room();
    for (i, &(shape, is_cubic)) in (0_u8..).zip(kinds) {
        let mut mesh = strands(40, radius, scene.materials.len() as u32);
        let Some(curves) = &mut mesh.curves else { panic!("no curves") };
        curves.shape = shape;
        if is_cubic {
            // Two curves of each strand.
            let strands = (0..mesh.positions.len() as u32 / 6).map(|strand| 6 * strand);
            let list = strands.flat_map(|a| [[a, a + 1, a + 2, a + 3], [a + 3, a + 4, a + 5, a + 5]]);
            curves.segments = CurveSegments::Cubic(list.collect());
        }
        let (side, at) = (if i % 2 == 0 { 0.8 } else { -0.8 }, 0.8 * f32::from(i) - 0.8);
        let columns = [[side, 0.1, 0.0], [0.2, 0.8, 0.1], [0.0, -0.1, 0.8], [at, 0.5, 0.6]];
        scene.instances.push(instance(scene.meshes.len() as u32, columns));
        scene.meshes.push(mesh);
    }
    scene.materials.push(material);
    (scene, camera)
}

fn cubic_curves_and_ribbons() {
    let gpu = gpu();
    let (mut scene, camera) = room_of_kinds(0.04, wood(), &KINDS);
    for integrator in Integrator::ALL {
        compared(&gpu, &scene, &camera, Levels::Auto, &small(integrator)).check("kinds", [0.4, 0.01]);
    }
    let last = scene.materials.len() - 1;
    scene.materials[last].alpha_mode = AlphaMode::Blend;
    scene.materials[last].alpha = 0.6;
    scene.materials[last].hair_mut().melanin = 1.3;
    let aovs = [Aov::Normal, Aov::Depth].into_iter().collect();
    let with_aovs = Settings { aovs, ..small(Integrator::Path) };
    compared(&gpu, &scene, &camera, Levels::Auto, &with_aovs).check("hair of all kinds", [0.5, 0.02]);
}

fn curves_whose_points_move() {
    let kinds = [[(CurveShape::Tube, false)].as_slice(), &KINDS].concat();
    // Curves that glow, so that those which move elsewhere or less change the means.
    let (mut scene, camera) = room_of_kinds(0.08, Material { emission: [0.6, 0.4, 0.2], ..wood() }, &kinds);
    for mesh in scene.meshes.iter_mut().filter(|mesh| mesh.curves.is_some()) {
        let positions = mesh.positions.iter().map(|&[x, y, z]| [x + 0.3 * y, y - 0.2 * x, z + 0.2]).collect();
        let radii = mesh.curves.as_ref().map(|curves| curves.radii.iter().map(|r| 1.5 * r).collect());
        mesh.close = Some(MeshClose { positions, normals: None, tangents: None, radii });
    }
    check_motion(&scene, &camera);
}

/// Compares pictures of a scene whose meshes with `close` move, and of the same scene with instances that move, too.
pub(super) fn check_motion(scene: &Scene, camera: &Camera) {
    let gpu = gpu();
    let settings = small(Integrator::Path);
    let on_cpu = |scene: &Scene| on_cpu(scene, &scene_bvh(scene, Levels::Auto), camera, &settings);
    let on_device = |scene: &Scene| on_device(&gpu, scene, &scene_bvh(scene, Levels::Auto), camera, &settings);
    let theirs = on_cpu(scene);
    difference(&on_device(scene), &theirs).check("points in motion", [0.5, 0.02]);
    // The comparison detects points that stand still, with the same random numbers: the scene still has times.
    let mut still = scene.clone();
    for mesh in &mut still.meshes {
        if let Some(close) = &mut mesh.close {
            close.positions.clone_from(&mesh.positions);
            close.radii = mesh.curves.as_ref().map(|curves| curves.radii.clone());
        }
    }
    difference(&on_device(&still), &theirs).check_detects("points that stand still");
    let (mut all, _) = scenes::in_motion((scene.clone(), *camera));
    let moves = |instance: &Instance| scene.meshes[instance.mesh.0 as usize].close.is_some();
    for instance in all.instances.iter_mut().filter(|instance| moves(instance)) {
        let mut close = instance.world_from_object;
        close.columns = close.columns.map(|[x, y, z]| [1.6 * x - 0.3 * y, 1.6 * y + 0.2 * x, 1.4 * z]);
        instance.world_from_object_close = Some(close);
    }
    let theirs = on_cpu(&all);
    difference(&on_device(&all), &theirs).check("all in motion", [0.5, 0.02]);
    // Nor may the instances of what moves stand still.
    for instance in all.instances.iter_mut().filter(|instance| moves(instance)) {
        instance.world_from_object_close = Some(instance.world_from_object);
    }
    difference(&on_device(&all), &theirs).check_detects("instances that stand still");
}

fn curves_that_move_and_curves_with_alpha() {
    let gpu = gpu();
    let (mut scene, camera) = hairy_room(0.05, wood());
    let last = scene.materials.len() - 1;
    scene.materials[last].alpha_mode = AlphaMode::Blend;
    scene.materials[last].alpha = 0.6;
    compared(&gpu, &scene, &camera, Levels::Auto, &small(Integrator::Path)).check("alpha", [0.4, 0.02]);
    let (scene, camera) = scenes::in_motion((scene, camera));
    for integrator in Integrator::ALL {
        compared(&gpu, &scene, &camera, Levels::Auto, &small(integrator)).check("motion", [0.5, 0.02]);
    }
}

/// Stripes along strands and across, and holes, with each filter.
fn textures_on_curves() {
    let gpu = gpu();
    let (mut scene, camera) = hairy_room(0.08, wood());
    let texture = |texel: &dyn Fn(u8, u8) -> [u8; 4]| Texture {
        name: "stripes".to_owned(),
        width: 16,
        height: 16,
        texels: (0..=255_u8).map(|i| texel(i % 16 / 4, i / 16 / 4)).collect(),
        encoding: Encoding::Srgb,
        wrap: [Wrap::Repeat; 2],
        magnification: Magnification::Linear,
    };
    scene.textures = vec![texture(&|x, y| [80 * x, 80 * y, 200, 255]), texture(&|x, _| [255, 255, 255, 255 * (x % 2)])];
    let last = scene.materials.len() - 1;
    scene.materials[last].base_color_texture = Some(TextureRef::new(TextureId(0)));
    for (lod, integrator) in
        [(Lod::None, Integrator::Hybrid), (Lod::Cone, Integrator::Path), (Lod::Aniso, Integrator::Path)]
    {
        let settings = Settings { lod, ..small(integrator) };
        compared(&gpu, &scene, &camera, Levels::Auto, &settings).check(&format!("{lod:?}"), [0.4, 0.01]);
    }
    scene.materials[last].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    scene.materials[last].alpha_texture = Some(TextureRef::new(TextureId(1)));
    compared(&gpu, &scene, &camera, Levels::Auto, &small(Integrator::Path)).check("holes", [0.5, 0.02]);
    // The comparison detects another texture.
    let theirs = on_cpu(&scene, &scene_bvh(&scene, Levels::Auto), &camera, &small(Integrator::Path));
    scene.textures[0] = texture(&|x, y| [250 - 80 * x, 250 - 80 * y, 40, 255]);
    let ours = on_device(&gpu, &scene, &scene_bvh(&scene, Levels::Auto), &camera, &small(Integrator::Path));
    difference(&ours, &theirs).check_detects("another texture");
}

/// Rays from beyond the tip of a cone, through it or nearly so, along its axis and aslant: the device enters at the tip, as the CPU does.
fn rays_through_tips_enter_there() {
    let gpu = gpu();
    let (wide, tip) = ([0.3, -0.2, 0.5], [1.1, 0.35, 0.2]);
    let aovs = [Aov::Depth].into_iter().collect();
    let settings = Settings { samples: 1, bounces: 0, aovs, ..small(Integrator::Hybrid) };
    for (positions, radii) in [(vec![wide, tip], vec![0.2, 0.0]), (vec![tip, wide], vec![0.0, 0.2])] {
        let curves = Curves { radii, segments: CurveSegments::Linear(vec![[0, 1]]), shape: CurveShape::Tube };
        let parts = vec![Part { first_triangle: 0, material: MaterialId(0) }];
        let cone = Mesh { positions, curves: Some(curves), parts, ..Mesh::default() };
        let (mut scene, _) = scenes::room();
        scene.meshes = vec![cone];
        scene.instances = vec![instance(0, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]])];
        let bvh = scene_bvh(&scene, Levels::Auto);
        for aslant in [0.0, 0.2] {
            let eye = [0, 1, 2].map(|k| tip[k] + 2.0 * (tip[k] - wide[k]) + aslant * [0.0, 1.0, 0.5][k]);
            let camera = Camera::pinhole(eye, tip, [0.0, 1.0, 0.0], 0.05);
            let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
            let theirs = on_cpu(&scene, &bvh, &camera, &settings);
            for (ours, theirs) in ours.guides().iter().zip(theirs.guides()) {
                assert_eq!([ours.n_hits, theirs.n_hits], [1; 2]);
                assert!((ours.depth - theirs.depth).abs() < 2e-5, "{} instead of {}", ours.depth, theirs.depth);
                assert!(theirs.depth < 2.5, "{} is behind the tip", theirs.depth);
            }
        }
    }
}

fn the_comparison_detects_thinner_curves() {
    let gpu = gpu();
    let (scene, camera) = hairy_room(0.05, wood());
    let (thinner, _) = hairy_room(0.025, wood());
    let settings = small(Integrator::Path);
    let ours = on_device(&gpu, &thinner, &scene_bvh(&thinner, Levels::Auto), &camera, &settings);
    let theirs = on_cpu(&scene, &scene_bvh(&scene, Levels::Auto), &camera, &settings);
    difference(&ours, &theirs).check_detects("thinner curves");
}

fn what_devices_do_not_draw_is_refused_by_name() {
    let gpu = gpu();
    let settings = small(Integrator::Hybrid);
    let refusal = || {
        let (scene, camera) = hairy_room(0.05, wood());
        let bvh = scene_bvh(&scene, Levels::Auto);
        let surfaces = Surfaces::with_lod(&scene, settings.lod);
        match DevicePicture::new(&gpu, &surfaces, &bvh, &camera, &settings) {
            Ok(picture) if picture.without_streams() != Some("curves or patches") => panic!("curves have no streams"),
            Ok(picture) => match picture.with_first_hit(FirstHit::Raster) {
                Ok(_) => panic!("it is drawn"),
                Err(error) => error.to_string(),
            },
            Err(error) => error.to_string(),
        }
    };
    assert_eq!(refusal(), "the first hits of curves are not rasterized");
}
