//! Pictures whose rays are traced as streams have the bits of those by one kernel.

use canted_film::{Aov, Film};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{Gpu, TracedScene};
use canted_renderer::{DevicePicture, Integrator, Levels, SampleSums, SceneBvh, Settings, Surfaces, traced_scene};
use canted_scene::{AlphaMode, Camera, Scene};

use crate::gpu;
use crate::paths::of_all_materials;
use crate::scenes::{self, on_cpu, scene_bvh};
use crate::sums::monitored;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(streams_have_the_bits_of_one_kernel),
        needs_device(the_cpu_takes_paths_that_streams_cut),
        needs_device(streams_leave_other_pictures_to_one_kernel),
    ]
}

fn settings(bounces: u32) -> Settings {
    Settings { width: 61, height: 35, samples: 4, integrator: Integrator::Path, bounces, ..Settings::default() }
}

fn rendered(
    gpu: &Gpu,
    (scene, camera): (&Scene, &Camera),
    bvh: &SceneBvh,
    settings: &Settings,
    are_streams: bool,
    make: impl FnOnce(TracedScene) -> TracedScene,
) -> Film {
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let of = |scene: &Scene| Ok(make(traced_scene(gpu, scene, bvh)?));
    let picture = DevicePicture::over(gpu, &surfaces, bvh, camera, settings, of).unwrap();
    let picture = picture.with_streams(are_streams).unwrap();
    monitored(|monitor| picture.render(vec![], monitor)).unwrap()
}

fn streams_have_the_bits_of_one_kernel() {
    let gpu = gpu();
    let (mut lit, camera_of_lit) = scenes::room();
    lit.environment = Some(scenes::sky());
    let built_in = canted_scene::builtin();
    let camera_of_built_in = scenes::frame_of(&built_in);
    let (room, camera) = scenes::room();
    let (materials, camera_of_materials) = of_all_materials();
    let (textured, camera_of_textured) = opaque(scenes::textured());
    for (name, scene, camera) in [
        ("room", &room, &camera),
        ("room before a sky", &lit, &camera_of_lit),
        ("metal and glass", &materials, &camera_of_materials),
        ("textures", &textured, &camera_of_textured),
        ("built-in", &built_in, &camera_of_built_in),
    ] {
        for (levels, bounces, sums) in [
            (Levels::One, 8, SampleSums::Host),
            (Levels::Two, 3, SampleSums::Device),
            (Levels::Two, 0, SampleSums::Host),
        ] {
            let settings = Settings { sums, aovs: [Aov::Depth].into_iter().collect(), ..settings(bounces) };
            let bvh = scene_bvh(scene, levels);
            let [streams, whole] =
                [true, false].map(|streams| rendered(&gpu, (scene, camera), &bvh, &settings, streams, |traced| traced));
            assert!(streams == whole, "{name}, {levels:?}, {bounces} bounces, {sums:?}");
            // The comparison detects one bounce less.
            if bounces == 8 {
                let fewer = Settings { bounces: 1, ..settings };
                assert!(rendered(&gpu, (scene, camera), &bvh, &fewer, true, |traced| traced) != whole, "{name}");
            }
        }
    }
}

/// A scene that no alpha makes transparent.
fn opaque((mut scene, camera): (Scene, Camera)) -> (Scene, Camera) {
    for material in &mut scene.materials {
        material.alpha_mode = AlphaMode::Opaque;
        material.alpha = 1.0;
        material.double_sided = true;
    }
    (scene, camera)
}

fn the_cpu_takes_paths_that_streams_cut() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    for sums in [SampleSums::Host, SampleSums::Device] {
        let settings = Settings { sums, ..settings(6) };
        let of_cpu = on_cpu(&scene, &bvh, &camera, &settings);
        let with = |n| rendered(&gpu, (&scene, &camera), &bvh, &settings, true, |traced| traced.with_max_iterations(n));
        // No ray is finished: each sample is the CPU's. With enough iterations none is.
        assert!(with(0) == of_cpu, "{sums:?}");
        assert!(with(1 << 18) != of_cpu, "{sums:?}");
    }
}

fn streams_leave_other_pictures_to_one_kernel() {
    let gpu = gpu();
    let refused = |(scene, camera): &(Scene, Camera), settings: &Settings| {
        let bvh = scene_bvh(scene, Levels::Auto);
        let surfaces = Surfaces::with_lod(scene, settings.lod);
        let picture = DevicePicture::new(&gpu, &surfaces, &bvh, camera, settings).unwrap();
        picture.with_streams(true).is_err()
    };
    assert!(!refused(&scenes::room(), &settings(2)));
    assert!(refused(&scenes::room(), &Settings { integrator: Integrator::Hybrid, ..settings(2) }));
    assert!(refused(&scenes::in_motion(scenes::room()), &settings(2)));
    assert!(refused(&scenes::dollhouse(), &settings(2)));
    let components = Settings { aovs: [Aov::Direct].into_iter().collect(), ..settings(2) };
    assert!(refused(&scenes::room(), &components));
}
