//! Frames of a sequence on the device: only what changed is uploaded, and pictures are those of a device that starts anew.

use canted_fixtures::device_tests::{Test, needs_device};
use std::sync::atomic::AtomicBool;

use canted_film::Film;
use canted_fixtures::icosphere;
use canted_gpu::build::WideConfig;
use canted_gpu::{Gpu, Traffic, block_on};
use canted_lbvh::{Bits, Strategy};
use canted_renderer::{
    BvhKind, DeviceFrames, DevicePicture, Integrator, Levels, Monitor, SceneBvh, SceneBvhConfig, Settings, Surfaces,
    UpdateOptions, traced_frame,
};
use canted_scene::{Camera, Scene};

use super::gpu;
use super::scenes::{instance, mesh, room};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(frames_upload_what_changed),
        needs_device(frames_of_binary_bvhs_are_updated_on_the_device),
        needs_device(a_frame_of_a_small_mesh_takes_few_dispatches_and_downloads_its_picture),
        needs_device(a_frame_of_many_samples_takes_few_dispatches_and_one_download),
        needs_device(faults_are_read_back_where_they_may_be),
    ]
}

fn settings() -> Settings {
    Settings { width: 24, height: 16, samples: 1, integrator: Integrator::Path, ..Settings::default() }
}

/// The room, and spheres in rows: most of its bytes are those of one sphere.
fn crowd() -> (Scene, Camera) {
    let (mut scene, camera) = room();
    let sphere = icosphere(4);
    let number = u32::try_from(scene.meshes.len()).unwrap();
    scene.meshes.push(mesh(sphere.positions, sphere.triangles, 1));
    for i in 0..40_u8 {
        let [x, y] = [f32::from(i % 8) * 0.7 - 2.5, f32::from(i / 8) * 0.5 - 1.5];
        scene.instances.push(instance(number, [[0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.2], [x, y, -1.0]]));
    }
    (scene, camera)
}

fn rendered(picture: &DevicePicture<'_>) -> Film {
    let cancel = AtomicBool::new(false);
    let monitor = Monitor::quiet(&cancel);
    picture.render(vec![], &monitor).unwrap()
}

fn two_levels() -> SceneBvhConfig {
    SceneBvhConfig { levels: Levels::Two, ..SceneBvhConfig::default() }
}

/// What each frame uploads before its first ray, its size on the device, and that its picture is that of a new start.
fn uploads(gpu: &Gpu, config: &SceneBvhConfig, steps: &[fn(&mut Scene, &mut Camera)]) -> Vec<(Traffic, u64)> {
    let (mut scene, mut camera) = crowd();
    let settings = settings();
    let mut bvh = SceneBvh::build(&scene, config).unwrap();
    let mut frames = DeviceFrames::default();
    let mut found = vec![];
    for step in steps {
        step(&mut scene, &mut camera);
        bvh.update(&scene, &UpdateOptions::default()).unwrap();
        let surfaces = Surfaces::with_lod(&scene, settings.lod);
        let before = gpu.traffic();
        let picture = DevicePicture::in_frame(gpu, &surfaces, &bvh, &camera, &settings, &mut frames).unwrap();
        let size = picture.buffers().iter().map(|(_, bytes)| bytes).sum();
        found.push((gpu.traffic() - before, size));
        let film = rendered(&picture);
        drop(picture);
        let anew = block_on(Gpu::open(&canted_gpu::Choice::Best)).unwrap();
        let fresh = SceneBvh::build(&scene, config).unwrap();
        let picture = DevicePicture::new(&anew, &surfaces, &fresh, &camera, &settings).unwrap();
        assert!(film.pixels() == rendered(&picture).pixels(), "frame {}, {config:?}", found.len());
    }
    found
}

fn nothing(_: &mut Scene, _: &mut Camera) {}

fn turn_camera(_: &mut Scene, camera: &mut Camera) {
    *camera = Camera::pinhole([0.4, 0.1, 8.0], [0.0, -0.2, 0.0], [0.0, 1.0, 0.0], 38.0);
}

fn move_one(scene: &mut Scene, _: &mut Camera) {
    scene.instances[20].world_from_object.columns[3][1] += 0.1;
}

/// A block, which has a hundredth of all triangles.
fn deform_block(scene: &mut Scene, _: &mut Camera) {
    scene.meshes[1].positions.iter_mut().for_each(|p| p[0] *= 1.1);
}

const STEPS: [fn(&mut Scene, &mut Camera); 5] = [nothing, nothing, turn_camera, move_one, deform_block];

fn frames_upload_what_changed() {
    let gpu = gpu();
    let found = uploads(&gpu, &two_levels(), &STEPS);
    let bytes = |frame: usize| found[frame].0.uploaded_bytes;
    let whole = found[0].1;
    assert!(bytes(0) >= whole && whole > 200_000, "{found:?}");
    // Nothing, then the camera.
    assert_eq!((bytes(1), found[1].0.n_uploads), (0, 0), "{found:?}");
    let camera = bytes(2);
    assert!(camera > 0 && camera <= 256 && found[2].0.n_uploads == 1, "{found:?}");
    // Records of the instance for rays and for shading, two chunks each, and the top level: its nodes, header and order.
    let top = 44 * 64 + 4 * 256;
    assert!(bytes(3) > 0 && bytes(3) <= 4 * 256 + top, "{found:?}");
    // The block's vertices, triangles' normals, nodes and triangles, and the top level.
    assert!(bytes(4) > 0 && bytes(4) <= 8 * 1024 + top, "{found:?}");
    assert!(found[1..].iter().all(|(traffic, _)| traffic.n_dispatches == 0), "{found:?}");
}

fn frames_of_binary_bvhs_are_updated_on_the_device() {
    let gpu = gpu();
    for strategy in [Strategy::Aabb, Strategy::Combined] {
        let found = uploads(&gpu, &SceneBvhConfig { kind: BvhKind::Bvh2, volumes: strategy, ..two_levels() }, &STEPS);
        let of = |frame: usize| found[frame].0;
        // Nothing is built for the camera. What is read back is the size of the structure.
        let Traffic { downloaded_bytes, .. } = of(1);
        assert_eq!(of(1), Traffic { downloaded_bytes, ..Traffic::default() }, "{found:?}");
        assert!(downloaded_bytes < 256, "{found:?}");
        assert!(of(2).n_dispatches == 0 && of(2).n_uploads == 1, "{found:?}");
        // A record for rays and one for shading; the others are the sizes of dispatches, 16 bytes each.
        let sizes = |frame: usize| 64 * of(frame).n_dispatches;
        assert!(of(3).n_dispatches > 0 && of(3).uploaded_bytes <= 4 * 256 + sizes(3), "{found:?}");
        assert!(of(4).n_dispatches > of(3).n_dispatches, "{found:?}");
        assert!(of(4).uploaded_bytes <= 8 * 1024 + sizes(4), "{found:?}");
        assert!(of(4).n_dispatches < of(0).n_dispatches + of(3).n_dispatches, "{found:?}");
    }
}

/// A frame of a sequence like that of the Fox: some hundred triangles in one level that deform, whose wide BVH the device builds again. It reads nothing back but
/// the picture, at once.
fn a_frame_of_a_small_mesh_takes_few_dispatches_and_downloads_its_picture() {
    let gpu = gpu();
    let (mut scene, camera) = room();
    let ball = icosphere(2);
    let number = u32::try_from(scene.meshes.len()).unwrap();
    scene.meshes.push(mesh(ball.positions, ball.triangles, 1));
    scene.instances.push(instance(number, [[0.8, 0.0, 0.0], [0.0, 0.8, 0.0], [0.0, 0.0, 0.8], [0.0; 3]]));
    let config = SceneBvhConfig { levels: Levels::One, ..SceneBvhConfig::default() };
    let mut bvh = SceneBvh::build(&scene, &config).unwrap();
    let wide = WideConfig { bits: Bits::B63, ..WideConfig::default() };
    let mut frames = DeviceFrames::default().with_wide(wide);
    let settings = settings();
    let picture_bytes = u64::from(settings.width * settings.height) * 16;
    for frame in 0..3 {
        scene.meshes[number as usize].positions.iter_mut().for_each(|p| p[1] *= 1.1);
        bvh.update(&scene, &UpdateOptions::default()).unwrap();
        let surfaces = Surfaces::with_lod(&scene, settings.lod);
        let before = gpu.traffic();
        let picture = DevicePicture::in_frame(&gpu, &surfaces, &bvh, &camera, &settings, &mut frames).unwrap();
        let film = rendered(&picture);
        let traffic = gpu.traffic() - before;
        let mut anew = DeviceFrames::default().with_wide(wide);
        let fresh = DevicePicture::in_frame(&gpu, &surfaces, &bvh, &camera, &settings, &mut anew).unwrap();
        assert!(film.pixels() == rendered(&fresh).pixels(), "frame {frame}");
        if frame > 0 {
            assert!(traffic.n_dispatches <= 20, "frame {frame}: {traffic:?}");
            assert_eq!((traffic.n_downloads, traffic.downloaded_bytes), (1, picture_bytes), "frame {frame}");
        }
    }
    assert_eq!((frames.updates().whole, frames.updates().rebuilds), (1, 2));
}

/// Such a frame of more samples than one kernel takes whole, on a device that is as fast as hardware.
fn a_frame_of_many_samples_takes_few_dispatches_and_one_download() {
    let gpu = gpu();
    let (mut scene, _) = room();
    // From far away: most rays miss, so that a software driver takes the samples in seconds.
    let camera = Camera::pinhole([0.4, 0.1, 90.0], [0.0, -0.2, 0.0], [0.0, 1.0, 0.0], 38.0);
    let ball = icosphere(2);
    let number = u32::try_from(scene.meshes.len()).unwrap();
    scene.meshes.push(mesh(ball.positions, ball.triangles, 1));
    scene.instances.push(instance(number, [[0.8, 0.0, 0.0], [0.0, 0.8, 0.0], [0.0, 0.0, 0.8], [0.0; 3]]));
    let mut bvh =
        SceneBvh::build(&scene, &SceneBvhConfig { levels: Levels::One, ..SceneBvhConfig::default() }).unwrap();
    let mut frames = DeviceFrames::default().with_wide(WideConfig { bits: Bits::B63, ..WideConfig::default() });
    for (frame, (width, height, samples)) in [(24, 16, 1), (640, 360, 1), (320, 200, 4)].into_iter().enumerate() {
        scene.meshes[number as usize].positions.iter_mut().for_each(|p| p[1] *= 1.1);
        bvh.update(&scene, &UpdateOptions::default()).unwrap();
        let surfaces = Surfaces::with_lod(&scene, settings().lod);
        let settings = Settings { width, height, samples, bounces: 1, ..settings() };
        frames.expect_hardware();
        let before = gpu.traffic();
        let picture = DevicePicture::in_frame(&gpu, &surfaces, &bvh, &camera, &settings, &mut frames).unwrap();
        rendered(&picture);
        let Traffic { n_dispatches, n_downloads, downloaded_bytes, .. } = gpu.traffic() - before;
        if frame > 0 {
            assert!(n_dispatches <= 20, "{samples} samples: {n_dispatches} dispatches");
            let words = downloaded_bytes - u64::from(16 * samples * width * height);
            // How many samples each round left, and how many rays each query left to exact arithmetic.
            assert!(
                n_downloads == 1 && words <= 4 * 6,
                "{samples} samples: {n_downloads} downloads, {words} bytes beside"
            );
        }
    }
}

/// Only where rounding may decide whether the device places an instance, the next frame reads back whether it did.
fn faults_are_read_back_where_they_may_be() {
    let gpu = gpu();
    let (mut scene, _) = room();
    let mut bvh = SceneBvh::build(&scene, &two_levels()).unwrap();
    let mut frames = DeviceFrames::default().with_wide(WideConfig::default());
    drop(traced_frame(&gpu, &scene, &bvh, &mut frames).unwrap());
    for (condition, n_downloads) in [(900.0, 0), (1000.0, 2), (1100.0, 2)] {
        scene.instances[1].world_from_object.columns =
            [[condition, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];
        bvh.update(&scene, &UpdateOptions::default()).unwrap();
        let before = gpu.traffic();
        let is_placed = traced_frame(&gpu, &scene, &bvh, &mut frames).is_ok();
        assert_eq!(is_placed, condition < 1024.0);
        assert_eq!((gpu.traffic() - before).n_downloads, n_downloads, "condition number {condition}");
    }
    // A scale that the device rejects, of a mesh so small that its coordinates are none that it rejects.
    scene.instances[1].world_from_object.columns = [[1e19, 0.0, 0.0], [0.0, 1e19, 0.0], [0.0, 0.0, 1e19], [0.0; 3]];
    let mesh = scene.instances[1].mesh.0 as usize;
    scene.meshes[mesh].positions.iter_mut().for_each(|position| *position = position.map(|x| 1e-6 * x));
    bvh.update(&scene, &UpdateOptions::default()).unwrap();
    assert!(traced_frame(&gpu, &scene, &bvh, &mut frames).is_err());
}
