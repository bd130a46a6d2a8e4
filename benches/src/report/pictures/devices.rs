//! The CPU compared with a device, on the same samples.

use anyhow::Result;
use canted_film::Film;
use canted_gpu::{AdapterKind, Choice, Gpu};
use canted_renderer::{DevicePicture, Integrator, Monitor, Pattern, Settings, Surfaces};
use std::sync::atomic::AtomicBool;

use super::race::{self, Clock, Racer};
use super::stage::Stage;
use super::{methods, reference};
use crate::report::{effort::Effort, model::Chapter};

/// Adds the comparison of devices; returns its finding if an adapter opens.
pub(super) fn add(chapter: &mut Chapter, stage: &Stage, effort: Effort) -> Result<Option<String>> {
    let gpu = match Gpu::open(&Choice::Best) {
        Ok(gpu) => gpu,
        Err(error) => {
            chapter.skipped.push(format!("Devices other than the CPU: {error}."));
            return Ok(None);
        }
    };
    let (integrator, pattern) = (Integrator::Hybrid, Pattern::Stratified);
    let reference = methods::reference(stage, integrator, pattern, effort)?;
    let device = format!("{} ({})", gpu.info().name, gpu.info().kind);
    let racers = [
        Racer {
            name: format!("CPU, {} threads", rayon::current_num_threads()),
            reference: &reference,
            build: &stage.build,
            settings: stage.settings(integrator, pattern, 1, 0),
            render: Box::new(|settings| reference::film(stage, settings)),
        },
        Racer {
            name: device.clone(),
            reference: &reference,
            build: &stage.build,
            settings: stage.settings(integrator, pattern, 1, 0),
            render: Box::new(|settings| film(&gpu, stage, settings)),
        },
    ];
    // A software driver takes as long for a few samples as a full run for the rest of this chapter.
    let is_software = gpu.info().kind == AdapterKind::Software;
    let most = if is_software { effort.pick(1, 2, 2) } else { effort.pick(1, 2, 4) };
    let samples: Vec<u32> = (0..=most).map(|log2| 1 << log2).collect();
    let courses = race::race(&racers, &samples, effort.pick(2, 4, 16))?;
    race::show(chapter, &format!("{} on devices", stage.sized()), &courses, &samples, Clock::Wall);
    Ok(race::best(&courses.iter().collect::<Vec<_>>(), Clock::Wall).map(|best| format!("For devices, {best}.")))
}

/// Renders on the device. The kernel's input is packed each time, as in a program that renders one picture.
fn film(gpu: &Gpu, stage: &Stage, settings: &Settings) -> Result<Film> {
    let surfaces = Surfaces::with_lod(&stage.scene, settings.lod);
    let picture = DevicePicture::new(gpu, &surfaces, &stage.prepared.structure, &stage.camera, settings)?;
    let monitor = Monitor { progress: &|_, _| {}, finished: &|_| {}, cancel: &AtomicBool::new(false) };
    Ok(picture.render(vec![], &monitor)?)
}
