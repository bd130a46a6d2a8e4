//! Only required resources: buffers and bytes of a bare scene compared with those of a full one.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{Gpu, GpuError};
use canted_renderer::{DeviceError, Levels, Monitor, RenderError, Settings};
use canted_scene::Scene;
use canted_tests::device::lowered;

use crate::{bare, full, gpu, silent, small, texture, with_picture};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(a_bare_scene_binds_few_buffers_and_few_bytes),
        needs_device(a_device_lost_while_rendering_is_an_error),
        needs_device(a_picture_is_cancelled_between_dispatches),
        needs_device(large_textures_are_split_without_changing_the_picture),
        needs_device(scenes_that_do_not_fit_are_rejected_with_limit_need_and_remedy),
    ]
}

fn a_bare_scene_binds_few_buffers_and_few_bytes() {
    let gpu = gpu();
    let needs = |scene: &Scene, levels| -> Vec<(String, u64)> {
        let buffers = with_picture(&gpu, scene, levels, &small(), |picture| {
            picture.buffers().iter().map(|(name, n_bytes)| ((*name).to_owned(), *n_bytes)).collect()
        });
        let mut buffers: Vec<(String, u64)> = buffers.unwrap();
        buffers.sort();
        buffers
    };
    let bytes_of = |all: &[(String, u64)], name: &str| all.iter().find(|(other, _)| other == name).map(|(_, n)| *n);
    let sum = |all: &[(String, u64)]| all.iter().map(|(_, n)| n).sum::<u64>();
    let bare = needs(&bare(), Levels::Auto);
    let full = needs(&full(), Levels::Two);
    let names = |all: &[(String, u64)]| all.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(
        names(&bare),
        ["bvhs", "leaf_triangles", "lights", "materials", "nodes", "picture", "triangles", "vertices"]
    );
    let only_full: Vec<String> = names(&full).into_iter().filter(|name| bytes_of(&bare, name).is_none()).collect();
    assert_eq!(only_full, ["images", "instance_order", "instances", "placements", "slots", "texels_0"]);
    assert!(names(&bare).iter().all(|name| bytes_of(&full, name) >= bytes_of(&bare, name)));
    // Four vertices of three words; the full scene adds eleven for normal, tangent and color, and two for the texture.
    assert_eq!((bytes_of(&bare, "vertices"), bytes_of(&full, "vertices")), (Some(4 * 12), Some(4 * (12 + 44 + 8))));
    assert_eq!((bytes_of(&bare, "triangles"), bytes_of(&bare, "lights")), (Some(2 * 32), Some(48)));
    assert!(2 * sum(&bare) < sum(&full), "{bare:?}, {full:?}");
}

fn a_device_lost_while_rendering_is_an_error() {
    let gpu = gpu();
    let cancel = AtomicBool::new(false);
    let n_done = AtomicUsize::new(0);
    let progress = |done: usize, _: usize| {
        n_done.store(done, Ordering::Relaxed);
        gpu.lose();
    };
    let monitor = Monitor { progress: &progress, ..Monitor::quiet(&cancel) };
    // Tiles with more samples than one dispatch takes.
    let settings = Settings { samples: 256, ..small() };
    let lost = with_picture(&gpu, &full(), Levels::Auto, &settings, |picture| picture.render(vec![], &monitor).err());
    match lost {
        Ok(Some(DeviceError::Gpu(GpuError::Lost { .. }))) => {}
        other => panic!("{other:?}"),
    }
    assert!(n_done.into_inner() < 20, "the picture finished");
}

fn a_picture_is_cancelled_between_dispatches() {
    let gpu = gpu();
    let cancel = AtomicBool::new(true);
    let settings = Settings { samples: 1 << 16, ..small() };
    let ended = with_picture(&gpu, &full(), Levels::Auto, &settings, |picture| {
        picture.render(vec![], &silent(&cancel)).map(|film| film.n_rays())
    });
    assert_eq!(ended, Ok(Err(DeviceError::Render(RenderError::Cancelled))));
}

fn textured(side: u32) -> Scene {
    Scene { textures: vec![texture(side)], ..full() }
}

fn large_textures_are_split_without_changing_the_picture() {
    let (gpu, low) = (gpu(), lowered(8 << 10));
    let picture = |gpu: &Gpu| {
        let cancel = AtomicBool::new(false);
        with_picture(gpu, &textured(64), Levels::Auto, &small(), |picture| {
            let n_texels = picture.buffers().iter().filter(|(name, _)| name.starts_with("texels")).count();
            (n_texels, picture.render(vec![], &silent(&cancel)).unwrap())
        })
        .unwrap()
    };
    let ((one, unsplit), (four, split)) = (picture(&gpu), picture(&low));
    assert_eq!((one, four), (1, 4));
    assert!(unsplit.pixels() == split.pixels(), "the pictures differ");
}

fn scenes_that_do_not_fit_are_rejected_with_limit_need_and_remedy() {
    let gpu = lowered(4 << 10);
    let refused = with_picture(&gpu, &textured(64), Levels::Auto, &small(), |_| ()).unwrap_err();
    // All mip levels of 64 x 64 texels, and the curve.
    let need = 4 * ((64 * 64 * 4 - 1) / 3 + 256);
    let sentence = format!(
        "the textures: requires {need} bytes of four storage bindings, the device supports 16384; use smaller textures or \
         no mip maps"
    );
    assert_eq!(refused.to_string(), sentence);
}
