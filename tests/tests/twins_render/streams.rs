//! Pictures whose rays are traced as streams have the bits of those by one kernel.

use canted_film::{Film, Filter};
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{Choice, Gpu, Limits, TracedScene, block_on};
use canted_renderer::{DevicePicture, Integrator, Levels, SampleSums, SceneBvh, Settings, Surfaces, traced_scene};
use canted_scene::{Camera, Scene};

use crate::components::{has_light, too_bright};
use crate::gpu;
use crate::paths::of_all_materials;
use crate::scenes::{self, on_cpu, scene_bvh};
use crate::sums::monitored;

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(streams_have_the_bits_of_one_kernel),
        needs_device(streams_of_textures_have_the_bits_of_one_kernel),
        needs_device(streams_of_large_scenes_have_the_bits_of_one_kernel),
        needs_device(streams_keep_the_light_in_parts),
        needs_device(rounds_that_samples_do_not_need_are_not_recorded),
        needs_device(the_cpu_takes_paths_that_streams_cut),
        needs_device(streams_leave_other_pictures_to_one_kernel),
        needs_device(devices_with_fewer_buffers_take_one_kernel),
    ]
}

fn settings(integrator: Integrator, bounces: u32) -> Settings {
    Settings { width: 61, height: 35, samples: 4, integrator, bounces, ..Settings::default() }
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
    // The first samples are expected to need three rounds of rays, and the others what those needed: some end in rounds that follow.
    let picture = picture.with_streams(are_streams).unwrap().expecting_rounds(1);
    monitored(|monitor| picture.render(vec![], monitor)).unwrap()
}

/// The same after few rounds, with so many iterations for the rays of a sample.
fn ended_after(
    few: u32,
    gpu: &Gpu,
    (scene, camera): (&Scene, &Camera),
    bvh: &SceneBvh,
    settings: &Settings,
    n: u32,
) -> Film {
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let of = |scene: &Scene| Ok(traced_scene(gpu, scene, bvh)?.with_max_iterations(n));
    let picture = DevicePicture::over(gpu, &surfaces, bvh, camera, settings, of).unwrap().with_few_rounds(few).unwrap();
    monitored(|monitor| picture.render(vec![], monitor)).unwrap()
}

fn streams_have_the_bits_of_one_kernel() {
    let (room, camera) = scenes::room();
    let (mut lit, camera_of_lit) = scenes::room();
    lit.environment = Some(scenes::sky());
    let (materials, camera_of_materials) = of_all_materials();
    compare_streams(Integrator::Path, ("room", &room, &camera));
    compare_streams(Integrator::Hybrid, ("room before a sky", &lit, &camera_of_lit));
    compare_streams(Integrator::Path, ("metal and glass", &materials, &camera_of_materials));
}

fn streams_of_textures_have_the_bits_of_one_kernel() {
    let (textured, camera) = scenes::textured();
    let (moving, camera_of_moving) = scenes::in_motion(scenes::textured());
    compare_streams(Integrator::Hybrid, ("textures and alpha", &textured, &camera));
    compare_streams(Integrator::Hybrid, ("motion", &moving, &camera_of_moving));
}

fn streams_of_large_scenes_have_the_bits_of_one_kernel() {
    let (dollhouse, camera) = scenes::dollhouse();
    let built_in = canted_scene::builtin();
    compare_streams(Integrator::Path, ("single-sided materials", &dollhouse, &camera));
    compare_streams(Integrator::Path, ("built-in", &built_in, &scenes::frame_of(&built_in)));
}

/// Compares all kinds of pictures of a scene. With one integrator, one kernel also ends the samples after two rounds, as in a frame: a driver takes seconds
/// to compile it.
fn compare_streams(ended: Integrator, (name, scene, camera): (&str, &Scene, &Camera)) {
    let gpu = gpu();
    for (integrator, levels, bounces, sums) in [
        (Integrator::Path, Levels::One, 8, SampleSums::Host),
        (Integrator::Path, Levels::Two, 0, SampleSums::Device),
        (Integrator::Hybrid, Levels::One, 0, SampleSums::Device),
        (Integrator::Hybrid, Levels::Two, 2, SampleSums::Host),
    ] {
        let settings = Settings { sums, ..settings(integrator, bounces) };
        let levels = if scene.has_motion() { Levels::Two } else { levels };
        let bvh = scene_bvh(scene, levels);
        let [streams, whole] =
            [true, false].map(|streams| rendered(&gpu, (scene, camera), &bvh, &settings, streams, |traced| traced));
        assert!(streams == whole, "{name}, {integrator:?}, {levels:?}, {bounces} bounces, {sums:?}");
        if sums == SampleSums::Host && integrator == ended {
            let ended = ended_after(2, &gpu, (scene, camera), &bvh, &settings, 1 << 18);
            assert!(ended == whole, "{name}, {integrator:?}, {levels:?}, {bounces} bounces, ended by one kernel");
        }
        // The comparison detects a picture without bounces.
        if bounces > 0 {
            let fewer = Settings { bounces: 0, ..settings };
            let fewer = rendered(&gpu, (scene, camera), &bvh, &fewer, true, |traced| traced);
            assert!(fewer != whole, "{name}, {integrator:?}");
        }
    }
}

/// All AOVs, of the device's sums and of the host's, and those of samples that one kernel ends.
fn streams_keep_the_light_in_parts() {
    let gpu = gpu();
    // The last: whether one kernel ends samples, once for each integrator, since a driver takes seconds to compile it.
    for (name, (scene, camera), integrator, sums, ends) in [
        ("room", scenes::room(), Integrator::Hybrid, SampleSums::Device, true),
        ("metal and glass", of_all_materials(), Integrator::Path, SampleSums::Host, true),
        ("too bright for f32", too_bright(), Integrator::Hybrid, SampleSums::Host, false),
    ] {
        let bvh = scene_bvh(&scene, Levels::One);
        let all = Settings { sums, aovs: integrator.aovs(), filter: Filter::MITCHELL, ..settings(integrator, 2) };
        let with =
            |settings: &Settings, streams| rendered(&gpu, (&scene, &camera), &bvh, settings, streams, |traced| traced);
        let whole = with(&all, false);
        assert!(has_light(&whole), "{name}: light in each part");
        assert!(with(&all, true) == whole, "{name}, {integrator:?}, {sums:?}");
        if ends {
            let ended = ended_after(2, &gpu, (&scene, &camera), &bvh, &all, 1 << 18);
            assert!(ended == whole, "{name}, {integrator:?}, {sums:?}, ended by one kernel");
        }
        // The comparison detects parts of fewer bounces.
        let fewer = with(&Settings { bounces: 1, ..all }, true);
        assert!(fewer.components() != whole.components(), "{name}");
    }
}

/// One dispatch of samples: all rounds are recorded once, then as many as samples needed and two more. A read brings samples and counts together; another one
/// follows only where fewer rounds were expected than samples need.
fn rounds_that_samples_do_not_need_are_not_recorded() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    let settings = Settings { width: 24, height: 16, samples: 1, ..settings(Integrator::Path, 60) };
    let surfaces = Surfaces::with_lod(&scene, settings.lod);
    let picture = || DevicePicture::new(&gpu, &surfaces, &bvh, &camera, &settings).unwrap().with_streams(true).unwrap();
    let took = |picture: &DevicePicture<'_>| {
        let before = gpu.traffic();
        let film = monitored(|monitor| picture.render(vec![], monitor)).unwrap();
        (film, gpu.traffic() - before)
    };
    let fresh = picture();
    let [all, again, few] = [took(&fresh), took(&fresh), took(&picture().expecting_rounds(1))];
    assert!(all.0 == again.0 && all.0 == few.0);
    let found = [&all, &again, &few].map(|(_, traffic)| (traffic.n_dispatches, traffic.n_downloads));
    // Start, and six dispatches a round, but for the shadow rays of the first.
    assert_eq!(found[0], (1 + 6 * 62 - 2, 1));
    assert!(found[1].0 < found[0].0 && found[1].1 == 1, "{found:?}");
    assert_eq!(found[2], (found[0].0, 2));
}

fn the_cpu_takes_paths_that_streams_cut() {
    let gpu = gpu();
    let (scene, camera) = scenes::room();
    let bvh = scene_bvh(&scene, Levels::One);
    for (integrator, sums) in [(Integrator::Path, SampleSums::Host), (Integrator::Hybrid, SampleSums::Device)] {
        let settings = Settings { sums, ..settings(integrator, 3) };
        let of_cpu = on_cpu(&scene, &bvh, &camera, &settings);
        let with = |n| rendered(&gpu, (&scene, &camera), &bvh, &settings, true, |traced| traced.with_max_iterations(n));
        // No ray is finished: each sample is the CPU's. With enough iterations none is.
        assert!(with(0) == of_cpu, "{sums:?}");
        assert!(with(1 << 18) != of_cpu, "{sums:?}");
        let ended = |n| ended_after(1, &gpu, (&scene, &camera), &bvh, &settings, n);
        assert!(ended(0) == of_cpu && ended(1 << 18) == with(1 << 18), "{sums:?}");
        // Some are cut by the last kernel alone, which counts the iterations of all rays of a sample.
        let some = ended(200);
        assert!(some != of_cpu && some != ended(1 << 18), "{sums:?}");
    }
}

fn streams_leave_other_pictures_to_one_kernel() {
    let gpu = gpu();
    let reason = |(scene, camera): &(Scene, Camera), settings: &Settings| {
        let bvh = scene_bvh(scene, Levels::Auto);
        let surfaces = Surfaces::with_lod(scene, settings.lod);
        let picture = DevicePicture::new(&gpu, &surfaces, &bvh, camera, settings).unwrap();
        let reason = picture.without_streams();
        assert_eq!(picture.with_streams(true).is_err(), reason.is_some());
        reason
    };
    let path = settings(Integrator::Path, 2);
    let hybrid = settings(Integrator::Hybrid, 2);
    assert_eq!(reason(&scenes::room(), &path), None);
    assert_eq!(reason(&scenes::room(), &Settings { aovs: Integrator::Hybrid.aovs(), ..hybrid }), None);
    assert_eq!(reason(&scenes::dollhouse(), &hybrid), None);
    let mut many = scenes::room();
    many.0.lights = many.0.lights.iter().cycle().take(17).cloned().collect();
    assert_eq!(reason(&many, &hybrid), Some("more than 64 rounds of rays"));
    assert_eq!(reason(&many, &path), None);
}

/// The kernel that shades binds 29 buffers for these paths, uniform ones included, and the one of whole samples fewer.
fn devices_with_fewer_buffers_take_one_kernel() {
    let (scene, camera) = of_all_materials();
    let bvh = scene_bvh(&scene, Levels::One);
    let settings = Settings { aovs: Integrator::Path.aovs(), ..settings(Integrator::Path, 2) };
    let surfaces = Surfaces::with_lod(&scene, settings.lod);
    let rendered = |gpu: &Gpu, reason: Option<&str>| {
        let picture = DevicePicture::new(gpu, &surfaces, &bvh, &camera, &settings).unwrap();
        assert_eq!(picture.without_streams(), reason);
        monitored(|monitor| picture.render(vec![], monitor)).unwrap()
    };
    let lower = |limits| Limits { max_buffers_and_acceleration_structures_per_shader_stage: 28, ..limits };
    let of_few = block_on(Gpu::with_limits(&Choice::Best, lower)).unwrap_or_else(|error| panic!("{error}"));
    assert!(rendered(&of_few, Some("buffers per stage")) == rendered(&gpu(), None));
}
