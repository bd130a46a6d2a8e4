//! The film of a picture, by the CPU, a device or both.

use std::sync::{Mutex, PoisonError};

use anyhow::{Result, anyhow};
use canted_film::{Film, Partial, Record, Tile, write_film};
use canted_renderer::{
    DevicePicture, Monitor, Prepared, RenderError, Settings, SharedFilm, Structure, Surfaces, resume,
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
            (Machine::Both(gpu), Some(_)) => format!("cpu and {}", gpu.info().name),
            (Machine::Device(gpu) | Machine::Auto(gpu), Some(_)) => gpu.info().name.clone(),
            _ => "cpu".to_owned(),
        }
    }

    /// Renders what is not done, with a progress bar. Where Ctrl-C or a failure stops it, the finished tiles are written as a
    /// picture, unless a checkpoint or a part keeps their sums.
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
        let partial = is_wanted.then(|| Mutex::new(Partial::new(settings.tiling())));
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
                        let name = &gpu.info().name;
                        output::to_stderr(&format!("warning: the CPU made the rest: {name}: {why}"));
                    }
                    film
                })
                .map_err(|error| self.machine.named(error)),
            (Some(picture), _) => picture.render(done, &monitor).map_err(|error| self.machine.named(error)),
        };
        bar.finish_and_clear();
        let Err(error) = film else { return Ok((film?, facts)) };
        // What is done is not lost, whatever stopped the rest: Ctrl-C, or the loss of a device.
        if let Some(keeper) = keeper {
            keeper.save();
        }
        let partial = partial.as_ref().map(|partial| partial.lock().unwrap_or_else(PoisonError::into_inner));
        let written = partial.map_or(Ok(()), |partial| write_partial(args, &partial));
        Err(stopped(error, written))
    }
}

/// The error of a picture that was stopped, of which the rest could be written or not: a failure is told before that of its
/// rest, which is then a warning.
fn stopped(error: anyhow::Error, written: Result<()>) -> anyhow::Error {
    match written {
        Err(why) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => why,
        Err(why) => {
            output::to_stderr(&format!("warning: {why}"));
            error
        }
        Ok(()) => error,
    }
}

/// Writes what is there of a picture, if anything is.
fn write_partial(args: &Args, partial: &Partial) -> Result<()> {
    let [n_done, n_tiles] = partial.n_tiles();
    if n_done == 0 {
        return Ok(());
    }
    match partial.film() {
        Some(film) => write_film(&args.output, &film, args.samples.aovs(), &Record::new())?,
        None => write_picture(&args.output, partial.picture())?,
    }
    let name = args.output.display();
    output::to_stderr(&format!("warning: {name} has {n_done} of {n_tiles} tiles, and is black elsewhere"));
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use canted_film::read_picture;
    use canted_renderer::{StructureConfig, frame, prepare};
    use canted_trace::Watertight;

    use super::*;
    use crate::options;

    /// A device that is lost cannot be had on purpose; what follows is the same for every failure behind the first tile.
    #[test]
    fn a_failure_leaves_the_finished_tiles_and_stays_the_error() {
        let folder = tempfile::tempdir().unwrap();
        let args = Args { output: folder.path().join("out.exr"), ..options::defaults() };
        let settings = Settings { width: 16, height: 8, samples: 1, tile: 8, ..Settings::default() };
        let scene = canted_scene::builtin();
        let Prepared { structure, .. } = prepare::<Watertight>(&scene, &StructureConfig::default()).unwrap();
        let camera = frame(&scene, &structure, 2.0);
        let tiles = Mutex::new(Vec::new());
        let (finished, cancel) = (|tile: &Tile| tiles.lock().unwrap().push(tile.clone()), AtomicBool::new(false));
        let monitor = Monitor { progress: &|_, _| (), finished: &finished, cancel: &cancel };
        let whole = resume(&scene, &structure, &camera, &settings, Vec::new(), &monitor).unwrap().picture();
        let mut partial = Partial::new(settings.tiling());
        write_partial(&args, &partial).unwrap();
        assert!(!args.output.exists(), "there is nothing to write");
        tiles.lock().unwrap().iter().filter(|tile| tile.number == 1).for_each(|tile| partial.add(tile));
        let error = stopped(anyhow!("the device is lost"), write_partial(&args, &partial));
        assert_eq!(error.to_string(), "the device is lost");
        let left = read_picture(&args.output).unwrap();
        for (x, y) in (0..8).flat_map(|y| (0..16).map(move |x| (x, y))) {
            let at = left.index(x, y);
            assert_eq!(left.pixels[at], if x < 8 { [0.0; 3] } else { whole.pixels[at] }, "{x}, {y}");
        }
        let nowhere = Args { output: folder.path().join("no/out.exr"), ..args };
        let error = stopped(anyhow!("the device is lost"), write_partial(&nowhere, &partial));
        assert_eq!(error.to_string(), "the device is lost");
        let error = stopped(RenderError::Cancelled.into(), write_partial(&nowhere, &partial));
        assert!(error.to_string().starts_with("cannot write"), "{error}");
    }
}
