//! The film of a picture, by the CPU, a device or both.

use std::sync::{Mutex, PoisonError};

use anyhow::{Result, anyhow};
use canted_renderer::{
    DevicePicture, Film, Monitor, Partial, Prepared, RenderError, Settings, SharedFilm, Structure, Surfaces, Tile,
    resume,
};
use canted_scene::{Camera, Scene};
use canted_wide::LaneKernel;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::{Args, checkpoint::Keeper, facts::Fact, write_picture};
use crate::{
    device::{Machine, check_triangles},
    interrupt, output,
};

/// What makes a picture's film, ready to.
pub(super) struct Maker<'a, K: LaneKernel> {
    machine: &'a Machine,
    /// `None` where the CPU works alone.
    on_device: Option<DevicePicture<'a, K>>,
}

impl<'a, K: LaneKernel> Maker<'a, K> {
    /// Takes the scene to the device where one has a part in it: `surfaces` is there for every machine with a device.
    ///
    /// # Errors
    /// What a device that was asked for by name does not do.
    pub(super) fn new(
        machine: &'a Machine,
        args: &Args,
        surfaces: Option<&'a Surfaces<'a>>,
        structure: &'a Structure<K>,
        camera: &Camera,
        settings: &'a Settings,
    ) -> Result<Self> {
        if settings.part.is_some() && matches!(machine, Machine::Both(_)) {
            return Err(anyhow!("--samples keeps sums that merge to one machine's bits, which --device both has not"));
        }
        let Some(surfaces) = surfaces else { return Ok(Self { machine, on_device: None }) };
        let on_device = machine.ready(|gpu| {
            check_triangles(args.structure.triangles)?;
            DevicePicture::new(gpu, surfaces, structure, camera, settings)
        })?;
        Ok(Self { machine, on_device })
    }

    /// Whose roundings the samples have.
    pub(super) fn device(&self) -> String {
        match (self.machine, &self.on_device) {
            (Machine::Both(gpu), Some(_)) => format!("cpu and {}", gpu.facts().name),
            (Machine::Device(gpu) | Machine::Auto(gpu), Some(_)) => gpu.facts().name.clone(),
            _ => "cpu".to_owned(),
        }
    }

    /// Renders what is not done, with a progress bar. Where Ctrl-C stops it, the finished tiles are written as a picture, unless
    /// a checkpoint or a part keeps their sums.
    pub(super) fn film(
        &self,
        scene: &Scene,
        prepared: &Prepared<K>,
        camera: &Camera,
        (args, settings): (&Args, &Settings),
        keeper: Option<&Keeper>,
        done: Vec<Tile>,
    ) -> Result<(Film, Vec<Fact>)> {
        let mut facts = vec![("device", json!(self.device()))];
        // Hidden by the library where standard error is no terminal.
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} %  {elapsed} of about {duration}") {
            bar.set_style(style);
        }
        let progress = |done: usize, all: usize| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        };
        // A part is for merging, and a checkpoint is what one goes on from.
        let is_wanted = settings.part.is_none() && keeper.is_none();
        let partial = is_wanted.then(|| Mutex::new(Partial::new(settings)));
        let add = |tile: &Tile| {
            if let Some(partial) = &partial {
                partial.lock().unwrap_or_else(PoisonError::into_inner).add(tile);
            }
        };
        done.iter().for_each(add);
        let finished = |tile: &Tile| {
            add(tile);
            if let Some(keeper) = keeper {
                keeper.add(tile);
            }
        };
        let monitor = Monitor { progress: &progress, finished: &finished, cancel: interrupt::flag() };
        let film = match (&self.on_device, self.machine) {
            (None, _) => {
                resume(scene, &prepared.structure, camera, settings, done, &monitor).map_err(anyhow::Error::from)
            }
            (Some(picture), Machine::Both(gpu)) => picture
                .render_with_cpu(done, &monitor)
                .map(|SharedFilm { film, n_tiles_of_device, stopped }| {
                    facts.push(("tiles_of_device", json!(n_tiles_of_device)));
                    if let Some(why) = stopped {
                        let name = &gpu.facts().name;
                        output::to_stderr(&format!("warning: the CPU made the rest: {name}: {why}"));
                    }
                    film
                })
                .map_err(|error| self.machine.named(error)),
            (Some(picture), _) => picture.render(done, &monitor).map_err(|error| self.machine.named(error)),
        };
        bar.finish_and_clear();
        let Err(error) = film else { return Ok((film?, facts)) };
        if let Some(keeper) = keeper {
            // What is done is not lost, whatever stopped the rest.
            keeper.save();
        }
        if let (Some(RenderError::Cancelled), Some(partial)) = (error.downcast_ref(), &partial) {
            write_partial(args, &partial.lock().unwrap_or_else(PoisonError::into_inner))?;
        }
        Err(error)
    }
}

/// Writes what is there of a picture, if anything is.
fn write_partial(args: &Args, partial: &Partial) -> Result<()> {
    let [n_done, n_tiles] = partial.n_tiles();
    if n_done == 0 {
        return Ok(());
    }
    write_picture(&args.output, partial.picture())?;
    let name = args.output.display();
    output::to_stderr(&format!("warning: {name} has {n_done} of {n_tiles} tiles, and is black elsewhere"));
    Ok(())
}
