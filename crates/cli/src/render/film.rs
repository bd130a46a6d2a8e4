//! Renders the film of a picture, with a progress bar, and keeps the finished tiles if it is stopped.

use std::sync::{Mutex, PoisonError};

use anyhow::{Result, anyhow};
use canted_film::{Film, Partial, Tile};
use canted_renderer::{Monitor, RenderError, Settings, Structure, Surfaces, resume_with};
use canted_scene::Camera;
use canted_wide::LaneKernel;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::{Args, checkpoint::CheckpointWriter, facts::Fact, outside, passes, show, write_picture};
use crate::{interrupt, output};

/// Renders films on one kind of device.
pub(super) trait FilmRenderer {
    /// The names of the devices.
    fn device(&self) -> String;

    /// Renders the tiles that are not in `done`. Adds facts to the report.
    fn render(&self, done: Vec<Tile>, monitor: &Monitor, facts: &mut Vec<Fact>) -> Result<Film>;

    /// Renders the samples of `settings`, which may differ from those of the renderer in their range only.
    ///
    /// # Errors
    /// The device renders no passes.
    fn pass(&self, _settings: &Settings, args: &Args, _monitor: &Monitor) -> Result<Film> {
        let option = if args.samples.seconds.is_some() { "--seconds" } else { "--preview" };
        Err(anyhow!("{option} renders in passes, which only the CPU does; use --device cpu"))
    }
}

/// Renders on the CPU.
pub(super) struct CpuRenderer<'a, K: LaneKernel> {
    pub(super) surfaces: &'a Surfaces<'a>,
    pub(super) structure: &'a Structure<K>,
    pub(super) camera: &'a Camera,
    pub(super) settings: &'a Settings,
}

impl<K: LaneKernel> FilmRenderer for CpuRenderer<'_, K> {
    fn device(&self) -> String {
        "cpu".to_owned()
    }

    fn render(&self, done: Vec<Tile>, monitor: &Monitor, _: &mut Vec<Fact>) -> Result<Film> {
        Ok(resume_with(self.surfaces, self.structure, self.camera, self.settings, done, monitor)?)
    }

    fn pass(&self, settings: &Settings, args: &Args, monitor: &Monitor) -> Result<Film> {
        let done = outside(args, settings);
        Ok(resume_with(self.surfaces, self.structure, self.camera, settings, done, monitor)?)
    }
}

/// Renders the tiles that are not in `done`, with a progress bar.
///
/// After Ctrl-C or a failure, the finished tiles are written to the checkpoint if there is one; else to the output file,
/// except for parts, which must be complete to be merged, and frames, which a later run makes.
pub(super) fn render(
    renderer: &dyn FilmRenderer,
    args: &Args,
    settings: &Settings,
    checkpoint: Option<&CheckpointWriter>,
    done: Vec<Tile>,
) -> Result<(Film, Vec<Fact>)> {
    let mut facts = vec![("device", json!(renderer.device()))];
    // indicatif hides the bar if standard error is not a terminal.
    let bar = if output::is_quiet() { ProgressBar::hidden() } else { ProgressBar::new(0) };
    if let Ok(style) = ProgressStyle::with_template("{prefix}{bar:40} {percent:>3} %  {elapsed} of about {duration}") {
        bar.set_style(style);
    }
    if args.samples.has_passes() {
        let film = passes::render(renderer, args, settings, &bar);
        bar.finish_and_clear();
        let (film, n_samples) = film?;
        facts.push(("samples_per_pixel", json!(n_samples)));
        return Ok((film, facts));
    }
    bar.set_prefix(args.sequence.label.clone());
    let progress = |done: usize, all: usize| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    // A frame with black tiles would look whole to `--resume`.
    let keeps_partial = settings.part.is_none() && checkpoint.is_none() && args.sequence.frames.is_none();
    let partial = keeps_partial.then(|| Mutex::new(Partial::new(settings.tiling())));
    let add = |tile: &Tile| {
        if let Some(partial) = &partial {
            partial.lock().unwrap_or_else(PoisonError::into_inner).add(tile);
        }
    };
    done.iter().for_each(add);
    let finished = |tile: &Tile| {
        add(tile);
        if let Some(checkpoint) = checkpoint {
            checkpoint.add(tile);
        }
    };
    let monitor = Monitor { progress: &progress, finished: &finished, cancel: interrupt::cancel_flag() };
    let film = renderer.render(done, &monitor, &mut facts);
    bar.finish_and_clear();
    let Err(error) = film else { return Ok((film?, facts)) };
    if let Some(checkpoint) = checkpoint {
        checkpoint.save();
    }
    let partial = partial.as_ref().map(|partial| partial.lock().unwrap_or_else(PoisonError::into_inner));
    let written = partial.map_or(Ok(()), |partial| write_partial(args, &partial));
    Err(stopped(error, written))
}

/// The error to report for a stopped render. If it failed, a further failure to write the partial picture is only a warning.
fn stopped(error: anyhow::Error, written: Result<()>) -> anyhow::Error {
    match written {
        Err(write_error) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => write_error,
        Err(write_error) => {
            output::warn(&write_error.to_string());
            error
        }
        Ok(()) => error,
    }
}

/// Writes the finished tiles of a picture, if there are any.
fn write_partial(args: &Args, partial: &Partial) -> Result<()> {
    let [n_done, n_tiles] = partial.n_tiles();
    if n_done == 0 {
        return Ok(());
    }
    match partial.film() {
        Some(film) => show(args, film)?,
        None => {
            let picture = partial.picture();
            let shown = args.crop.map(|[x, y, width, height]| picture.cropped([x, y], [width, height]));
            write_picture(args, shown.unwrap_or_else(|| picture.clone()), None)?;
        }
    }
    output::warn(&format!("{} contains {n_done} of {n_tiles} tiles; the others are black", args.output.display()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use canted_film::read_picture;
    use canted_renderer::{Prepared, StructureConfig, frame, prepare, resume};
    use canted_trace::Watertight;

    use super::*;
    use crate::options;

    /// Stands for the loss of a device, which a test cannot provoke: every failure after the first tile takes this path.
    #[test]
    fn a_failure_writes_the_finished_tiles_and_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let args = Args { output: folder.path().join("out.exr"), ..options::defaults() };
        let settings = Settings { width: 16, height: 8, samples: 1, tile: 8, ..Settings::default() };
        let scene = canted_scene::builtin();
        let Prepared { structure, .. } = prepare::<Watertight>(&scene, &StructureConfig::default()).unwrap();
        let camera = frame(&scene, &structure, 2.0);
        let tiles = Mutex::new(Vec::new());
        let (finished, cancel) = (|tile: &Tile| tiles.lock().unwrap().push(tile.clone()), AtomicBool::new(false));
        let monitor = Monitor { progress: &|_, _| (), finished: &finished, cancel: &cancel };
        let complete = resume(&scene, &structure, &camera, &settings, Vec::new(), &monitor).unwrap().picture();
        let mut partial = Partial::new(settings.tiling());
        write_partial(&args, &partial).unwrap();
        assert!(!args.output.exists(), "no tile is finished");
        tiles.lock().unwrap().iter().filter(|tile| tile.number == 1).for_each(|tile| partial.add(tile));
        let error = stopped(anyhow!("the device is lost"), write_partial(&args, &partial));
        assert_eq!(error.to_string(), "the device is lost");
        let left = read_picture(&args.output).unwrap();
        for (x, y) in (0..8).flat_map(|y| (0..16).map(move |x| (x, y))) {
            let at = left.index(x, y);
            assert_eq!(left.pixels[at], if x < 8 { [0.0; 3] } else { complete.pixels[at] }, "{x}, {y}");
        }
        let nowhere = Args { output: folder.path().join("no/out.exr"), ..args };
        let error = stopped(anyhow!("the device is lost"), write_partial(&nowhere, &partial));
        assert_eq!(error.to_string(), "the device is lost");
        let error = stopped(RenderError::Cancelled.into(), write_partial(&nowhere, &partial));
        assert!(error.to_string().starts_with("cannot write"), "{error}");
    }
}
