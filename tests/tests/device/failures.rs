//! Lost devices, and limits below what a scene needs.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use canted_gpu::{Gpu, GpuError};
use canted_renderer::{DeviceError, Levels, Monitor, RenderError, Settings};
use canted_scene::Scene;
use canted_tests::device::lowered;

use super::scenes::{full, texture};
use super::{gpu, silent, small, with_picture};

#[test]
fn a_device_lost_while_rendering_is_an_error() {
    let Some(gpu) = gpu("a_device_lost_while_rendering_is_an_error") else { return };
    let cancel = AtomicBool::new(false);
    let n_done = AtomicUsize::new(0);
    let progress = |done: usize, _: usize| {
        n_done.store(done, Ordering::Relaxed);
        gpu.lose();
    };
    let monitor = Monitor { progress: &progress, finished: &|_| (), cancel: &cancel };
    // Tiles with more samples than one dispatch takes.
    let settings = Settings { samples: 256, ..small() };
    let lost = with_picture(&gpu, &full(), Levels::Auto, &settings, |picture| picture.render(vec![], &monitor).err());
    match lost {
        Ok(Some(DeviceError::Gpu(GpuError::Lost { .. }))) => {}
        other => panic!("{other:?}"),
    }
    assert!(n_done.into_inner() < 20, "the picture finished");
}

#[test]
fn a_picture_is_cancelled_between_dispatches() {
    let Some(gpu) = gpu("a_picture_is_cancelled_between_dispatches") else { return };
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

#[test]
fn large_textures_are_split_without_changing_the_picture() {
    let test = "large_textures_are_split_without_changing_the_picture";
    let (Some(gpu), Some(low)) = (gpu(test), lowered(test, 8 << 10)) else { return };
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

#[test]
fn scenes_that_do_not_fit_are_rejected_with_limit_need_and_remedy() {
    let Some(gpu) = lowered("scenes_that_do_not_fit_are_rejected_with_limit_need_and_remedy", 4 << 10) else { return };
    let refused = with_picture(&gpu, &textured(64), Levels::Auto, &small(), |_| ()).unwrap_err();
    // All mip levels of 64 x 64 texels, and the curve.
    let need = 4 * ((64 * 64 * 4 - 1) / 3 + 256);
    let sentence = format!(
        "the textures: requires {need} bytes of four storage bindings, the device supports 16384; use smaller textures or \
         no mip maps"
    );
    assert_eq!(refused.to_string(), sentence);
}
