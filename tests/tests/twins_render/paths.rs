//! Pictures of both integrators, and guides, compared with those of the CPU: generated scenes and models of others.

use std::path::Path;

use canted_film::{Aov, Film, Guide};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_renderer::{Cull, DevicePicture, Hemisphere, Integrator, Levels, Pattern, Settings, Surfaces};
use canted_scene::{AlphaMode, Camera, Environment, Light, Material, Scene, SceneFile};
use canted_tests::scenes as model_files;

use crate::{
    gpu,
    scenes::{self, compared, difference, frame_of, on_cpu, on_device, scene_bvh},
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(a_room_with_all_kinds_of_light),
        needs_device(back_faces_and_limits),
        needs_device(uniform_directions),
        needs_device(colors_of_any_size),
        needs_device(metal_and_glass_before_a_sky),
        needs_device(motion_while_the_shutter_is_open),
        needs_device(the_motion_example),
        needs_device(textures_of_every_slot),
        needs_device(the_comparison_detects_another_light),
        needs_device(a_bare_scene_binds_few_buffers),
        needs_device(the_built_in_scene),
        needs_device(a_hybrid_room_with_all_kinds_of_light),
        needs_device(the_comparison_detects_another_hybrid_light),
        needs_device(guides_match_the_cpu_for_both_integrators),
        needs_device(an_added_ground_is_no_first_hit),
        needs_device(models_render_the_same_pictures).unless(model_files::missing()),
    ]
}

fn small(samples: u32) -> Settings {
    let integrator = Integrator::Path;
    Settings { width: 64, height: 36, samples, integrator, bounces: 8, ..Settings::default() }
}

fn a_room_with_all_kinds_of_light() {
    let gpu = gpu();
    let (mut scene, camera) = scenes::room();
    for levels in [Levels::One, Levels::Two] {
        compared(&gpu, &scene, &camera, levels, &small(4)).check("room", [0.3, 0.01]);
    }
    scene.environment = Some(scenes::sky());
    compared(&gpu, &scene, &camera, Levels::One, &small(4)).check("sky", [0.3, 0.01]);
    scene.background = Some([0.9, 0.1, 0.4]);
    for integrator in Integrator::ALL {
        let settings = Settings { integrator, ..small(4) };
        compared(&gpu, &scene, &camera, Levels::One, &settings).check("background", [0.3, 0.01]);
    }
}

/// Colors that are no fractions: nothing bounds them, and a device drops the samples that the CPU drops. Not with `path` for those that are not finite:
/// what Russian roulette makes of NaN depends on the processor.
fn colors_of_any_size() {
    let gpu = gpu();
    let (mut scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::Auto);
    for integrator in Integrator::ALL {
        for color in [f32::NAN, f32::INFINITY, 1e30, -1.0] {
            if integrator == Integrator::Path && !color.is_finite() {
                continue;
            }
            scene.materials[0].base_color = [color, 0.5, 0.5];
            let settings = Settings { integrator, ..small(2) };
            let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
            let theirs = on_cpu(&scene, &bvh, &camera, &settings);
            assert!((theirs.n_dropped() > 0) == (color != -1.0), "{integrator:?} {color}: {}", theirs.n_dropped());
            let pairs = ours.pixels().iter().zip(theirs.pixels());
            let n_other = pairs.filter(|(a, b)| a.n_dropped != b.n_dropped).count();
            assert!(n_other <= ours.pixels().len() / 100, "{integrator:?} {color}: {n_other} pixels differ");
        }
    }
}

/// Single-sided materials, seen and lit from both sides; and light up to a limit.
fn back_faces_and_limits() {
    let gpu = gpu();
    let (mut scene, camera) = scenes::dollhouse();
    for (cull, clamp) in [(Cull::Auto, None), (Cull::Back, Some(0.2)), (Cull::Off, Some(0.2))] {
        for levels in [Levels::One, Levels::Two] {
            let with = |settings: Settings| Settings { cull, clamp, ..settings };
            let found = compared(&gpu, &scene, &camera, levels, &with(small(4)));
            found.check(&format!("path {cull:?} {levels:?}"), [0.3, 0.01]);
            let found = compared(&gpu, &scene, &camera, levels, &with(hybrid(4)));
            found.check(&format!("hybrid {cull:?} {levels:?}"), [0.1, 0.005]);
        }
    }
    // With alpha, in motion, and before a sky.
    scene.environment = Some(scenes::sky());
    scene.materials[1].alpha_mode = AlphaMode::Blend;
    scene.materials[1].alpha = 0.5;
    compared(&gpu, &scene, &camera, Levels::One, &small(4)).check("alpha", [0.4, 0.02]);
    let (scene, _) = scenes::in_motion((scene, camera));
    compared(&gpu, &scene, &camera, Levels::Two, &small(4)).check("in motion", [0.4, 0.02]);
    // The comparison detects a device that culls nothing.
    let bvh = scene_bvh(&scene, Levels::Auto);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &Settings { cull: Cull::Off, ..small(4) });
    assert!(difference(&ours, &on_cpu(&scene, &bvh, &camera, &small(4))).astray > 0.5);
}

/// The room with a different material for each block.
pub(super) fn of_all_materials() -> (Scene, Camera) {
    let (mut scene, camera) = scenes::room();
    scene.environment = Some(scenes::sky());
    scene.materials.extend([
        Material { roughness: 0.0, specular: 1.0, transmission: 1.0, ..Material::default() },
        Material { base_color: [0.9, 0.7, 0.4], metallic: 1.0, roughness: 0.2, ..Material::default() },
    ]);
    scene.meshes[1].parts[0].material.0 = 3;
    scene.meshes[2].parts[0].material.0 = 4;
    (scene, camera)
}

fn uniform_directions() {
    let gpu = gpu();
    let (scene, camera) = of_all_materials();
    for integrator in Integrator::ALL {
        let settings = Settings { integrator, hemisphere: Hemisphere::Uniform, ..small(4) };
        compared(&gpu, &scene, &camera, Levels::One, &settings).check("uniform", [0.4, 0.02]);
    }
}

fn metal_and_glass_before_a_sky() {
    let gpu = gpu();
    let (mut scene, camera) = of_all_materials();
    for levels in [Levels::One, Levels::Two] {
        compared(&gpu, &scene, &camera, levels, &small(4)).check("metal and glass", [0.4, 0.02]);
    }
    let clear = scene.materials[3].clone();
    let kinds = [
        ("rough glass", Material { roughness: 0.4, ..clear.clone() }),
        ("sheets", Material { roughness: 0.4, thin_walled: true, ..clear.clone() }),
        ("a glossy layer and no glass", Material { roughness: 0.3, transmission: 0.0, ..clear }),
    ];
    for (name, material) in kinds {
        scene.materials[3] = material;
        compared(&gpu, &scene, &camera, Levels::One, &small(4)).check(name, [0.4, 0.02]);
    }
}

fn motion_while_the_shutter_is_open() {
    let gpu = gpu();
    let (mut scene, camera) = scenes::in_motion(scenes::textured());
    for pattern in [Pattern::Random, Pattern::Stratified, Pattern::Sobol] {
        let settings = Settings { pattern, ..small(4) };
        compared(&gpu, &scene, &camera, Levels::Auto, &settings).check("textures", [0.4, 0.02]);
    }
    (scene, _) = scenes::in_motion(scenes::room());
    let (_, camera) = scenes::room();
    let settings = Settings { integrator: Integrator::Hybrid, ..small(4) };
    compared(&gpu, &scene, &camera, Levels::Auto, &settings).check("room", [0.3, 0.01]);
    // The comparison detects a scene without motion.
    let bvh = scene_bvh(&scene, Levels::Auto);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
    let (still, _) = scenes::room();
    let found = difference(&ours, &on_cpu(&still, &scene_bvh(&still, Levels::Two), &camera, &settings));
    assert!(found.astray > 0.5, "{found:?}");
}

fn the_motion_example() {
    let gpu = gpu();
    // On a machine without the repository, `cargo xtask pack-device` puts it there.
    let paths = [Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/motion.toml"), "examples/motion.toml".into()];
    let path = paths.into_iter().find(|path| path.exists()).expect("the example is here or in the repository");
    let scene = SceneFile::read(&path).unwrap().load().unwrap();
    let camera = scene.cameras[0];
    compared(&gpu, &scene, &camera, Levels::Auto, &small(8)).check("motion.toml", [0.3, 0.01]);
}

fn textures_of_every_slot() {
    let gpu = gpu();
    let (scene, camera) = scenes::textured();
    for levels in [Levels::One, Levels::Two] {
        compared(&gpu, &scene, &camera, levels, &small(4)).check("textures", [0.4, 0.02]);
    }
}

fn the_comparison_detects_another_light() {
    let gpu = gpu();
    let (scene, camera) = of_all_materials();
    let bvh = scene_bvh(&scene, Levels::One);
    let settings = small(8);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
    let mut brighter = scene.clone();
    brighter.materials[0].base_color = [0.71; 3];
    let found = difference(&ours, &on_cpu(&brighter, &bvh, &camera, &settings));
    assert!(found.astray > 0.8 && found.drift.iter().all(|&drift| drift > 6.0), "{found:?}");
}

/// Features that a scene does not use have no binding.
fn a_bare_scene_binds_few_buffers() {
    let gpu = gpu();
    let settings = small(1);
    let bindings = |scene: &Scene, camera: &Camera, levels: Levels| {
        let bvh = scene_bvh(scene, levels);
        let surfaces = Surfaces::with_lod(scene, settings.lod);
        let picture = DevicePicture::new(&gpu, &surfaces, &bvh, camera, &settings).unwrap();
        let mut names: Vec<String> = picture.buffers().into_iter().map(|(name, _)| name.to_owned()).collect();
        names.sort();
        names
    };
    let (full, camera) = scenes::room();
    let mut bare = full.clone();
    bare.lights.clear();
    bare.meshes.truncate(1);
    bare.instances.truncate(1);
    let expected =
        ["bvhs", "leaf_triangles", "light_probabilities", "materials", "nodes", "picture", "triangles", "vertices"];
    assert_eq!(bindings(&bare, &camera, Levels::One), expected);

    let all = bindings(&full, &camera, Levels::Two);
    let more = [
        "emitters",
        "instance_order",
        "light_leaves",
        "light_nodes",
        "lights",
        "placements",
        "instances",
        "sampled_suns",
    ];
    assert_eq!(all.len(), expected.len() + more.len());
    assert!(more.iter().all(|name| all.iter().any(|known| known == name)), "{all:?}");

    bare.environment = Some(Environment::Constant([0.0; 3]));
    assert_eq!(bindings(&bare, &camera, Levels::One).len(), expected.len());
}

fn hybrid(samples: u32) -> Settings {
    Settings { width: 64, height: 36, samples, ..Settings::default() }
}

fn the_built_in_scene() {
    let gpu = gpu();
    let scene = canted_scene::builtin();
    let camera = frame_of(&scene);
    compared(&gpu, &scene, &camera, Levels::Auto, &hybrid(4)).check("built-in", [0.2, 0.005]);
}

fn a_hybrid_room_with_all_kinds_of_light() {
    let gpu = gpu();
    let (mut scene, camera) = scenes::room();
    for levels in [Levels::One, Levels::Two] {
        compared(&gpu, &scene, &camera, levels, &hybrid(4)).check("room", [0.1, 0.005]);
    }
    for environment in [scenes::sky(), Environment::Constant([0.0; 3])] {
        scene.environment = Some(environment);
        compared(&gpu, &scene, &camera, Levels::One, &hybrid(4)).check("another sky", [0.1, 0.005]);
    }
}

fn the_comparison_detects_another_hybrid_light() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    let ours = on_device(&gpu, &scene, &bvh, &camera, &hybrid(2));
    let mut brighter = scene.clone();
    brighter.materials[0].base_color[1] += 0.01;
    let found = difference(&ours, &on_cpu(&brighter, &bvh, &camera, &hybrid(2)));
    assert!(found.astray > 0.5 && found.of_means > 0.001 && found.drift[1] > 6.0, "{found:?}");
}

/// Rounding error of positions, normals and textures in a pixel's mean, relative to the scene's size or to 1.
const ROUNDING: f64 = 1.0 / 4096.0;

fn is_near(a: &Guide, b: &Guide) -> bool {
    let pairs = [[a.depth / 8.0, b.depth / 8.0]]
        .into_iter()
        .chain((0..3).map(|k| [a.normal[k], b.normal[k]]))
        .chain((0..3).map(|k| [a.shading_normal[k], b.shading_normal[k]]))
        .chain((0..3).map(|k| [a.albedo[k], b.albedo[k]]));
    let n = f64::from(a.n_hits.max(1));
    a.n_hits == b.n_hits && a.first == b.first && pairs.into_iter().all(|[a, b]| (a - b).abs() <= n * ROUNDING)
}

/// The share of pixels with different guides.
fn apart(ours: &Film, theirs: &Film) -> f64 {
    assert_eq!((ours.guides().len(), theirs.guides().len()), (ours.pixels().len(), theirs.pixels().len()));
    let n_apart = ours.guides().iter().zip(theirs.guides()).filter(|(a, b)| !is_near(a, b)).count();

    n_apart as f64 / ours.guides().len() as f64
}

fn guides_match_the_cpu_for_both_integrators() {
    let gpu = gpu();
    for (scene, camera) in [scenes::textured(), scenes::in_motion(scenes::room())] {
        let bvh = scene_bvh(&scene, Levels::Auto);
        for integrator in [Integrator::Hybrid, Integrator::Path] {
            let settings = Settings {
                width: 60,
                height: 35,
                samples: 4,
                bounces: 1,
                aovs: integrator.aovs(),
                integrator,
                ..Settings::default()
            };
            let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
            let theirs = on_cpu(&scene, &bvh, &camera, &settings);
            // Rays that graze an edge may hit either side of it.
            assert!(apart(&ours, &theirs) < 0.02, "{}", apart(&ours, &theirs));
            let sum = |film: &Film, k: usize| film.guides().iter().map(|guide| guide.tests[k]).sum::<f64>();
            // Both traverse the same nodes, but the device's boxes have slightly more padding.
            for k in 0..2 {
                let (ours, theirs) = (sum(&ours, k), sum(&theirs, k));
                assert!(ours >= 0.9 * theirs && ours <= 1.3 * theirs, "{ours} and {theirs} of kind {k}");
            }
            let other = on_cpu(&scene, &bvh, &camera, &Settings { seed: 1, ..settings });
            assert!(apart(&ours, &other) > 0.1);
            // Only requested guides are recorded, and the light is the same.
            let depth = Settings { aovs: [Aov::Depth].into_iter().collect(), ..settings };
            let fewer = on_device(&gpu, &scene, &bvh, &camera, &depth);
            assert!(fewer.guides().iter().all(|guide| guide.tests == [0.0; 2]));
            assert!(fewer.pixels() == ours.pixels());
        }
    }
}

/// AOVs show the ground that was added to a scene as they show a miss.
fn an_added_ground_is_no_first_hit() {
    let gpu = gpu();
    let (scene, camera) = scenes::textured();
    let bvh = scene_bvh(&scene, Levels::Auto);
    let settings = Settings {
        width: 30,
        height: 20,
        samples: 4,
        bounces: 1,
        aovs: Integrator::Hybrid.aovs(),
        ..Settings::default()
    };
    let shown = on_device(&gpu, &scene, &bvh, &camera, &settings);
    let [ground, _] = shown.guides().iter().find_map(|guide| guide.first).expect("the camera sees the scene");
    let scene = Scene { ground: Some(ground), ..scene };
    let ours = on_device(&gpu, &scene, &bvh, &camera, &settings);
    let theirs = on_cpu(&scene, &bvh, &camera, &settings);
    let is_ground = |guide: &Guide| guide.first.is_some_and(|[instance, _]| instance == ground);
    assert!(!ours.guides().iter().any(is_ground) && apart(&ours, &theirs) < 0.02, "{}", apart(&ours, &theirs));
    assert!(apart(&shown, &theirs) > 0.1);
}

/// Files in the folder of model_files, and the greatest share of diverging pixels: leaves and thin textured cloth split many paths.
const FILES: [(&str, f64); 4] = [
    ("sponza/sponza.gltf", 0.3),
    ("kitchen/country_kitchen.glb", 0.3),
    ("truss/eiffel.glb", 0.3),
    ("instanced/pine_forest.glb", 0.4),
];

fn models_render_the_same_pictures() {
    let gpu = gpu();
    let folder = model_files::folder();
    for (file, astray) in FILES {
        let scene = canted_scene::read(&folder.join(file)).unwrap();
        let sun = Light::Sun { direction: [-0.2, -0.95, -0.25], irradiance: [3.0, 2.9, 2.6] };
        let scene = Scene { environment: Some([0.6, 0.8, 1.0].into()), lights: vec![sun], ..scene };
        let camera = frame_of(&scene);
        for integrator in [Integrator::Hybrid, Integrator::Path] {
            let settings =
                Settings { width: 48, height: 27, samples: 2, integrator, bounces: 3, ..Settings::default() };
            let found = compared(&gpu, &scene, &camera, Levels::Auto, &settings);
            found.check(&format!("{file}, {integrator:?}"), [astray, 0.02]);
        }
    }
}
