//! Renders the film of a picture: in one go with a progress bar, or in passes of 1, 1, 2, 4, ... samples, whose sums have the bits of a
//! render in one go. A render that is stopped leaves a whole picture with fewer samples.

use std::{
    fs,
    path::PathBuf,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_film::{
    Aovs, Checkpoint, Film, Part, Partial, Record, Tile,
    denoise::{Denoise, Noisy, denoise},
};
use canted_renderer::{Monitor, RenderError, SceneBvh, Settings, StageTimes, Surfaces, resume_with};
use canted_scene::Camera;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::{
    facts::{self, Fact},
    output::{Denoising, GUIDES, OutputFile},
};
use crate::{output, process};

/// Renders films on one kind of device.
pub(super) trait FilmRenderer {
    /// The names of the devices.
    fn device(&self) -> String;

    /// Renders the tiles that are not in `done`. Adds facts to the report.
    fn render(&self, done: Vec<Tile>, monitor: &Monitor, facts: &mut Vec<Fact>) -> Result<Film>;

    /// Renders the tiles of a pass that are not in `done`; `None` where the device renders no passes. `settings` may differ from those
    /// of the renderer in their range only.
    fn pass(&self, _settings: &Settings, _done: Vec<Tile>, _monitor: &Monitor) -> Option<Result<Film>> {
        None
    }
}

/// Renders on the CPU.
pub(super) struct CpuRenderer<'a> {
    pub(super) surfaces: &'a Surfaces<'a>,
    pub(super) bvh: &'a SceneBvh,
    pub(super) camera: &'a Camera,
    pub(super) settings: &'a Settings,
}

impl FilmRenderer for CpuRenderer<'_> {
    fn device(&self) -> String {
        "cpu".to_owned()
    }

    fn render(&self, done: Vec<Tile>, monitor: &Monitor, _: &mut Vec<Fact>) -> Result<Film> {
        Ok(resume_with(self.surfaces, self.bvh, self.camera, self.settings, done, monitor)?)
    }

    fn pass(&self, settings: &Settings, done: Vec<Tile>, monitor: &Monitor) -> Option<Result<Film>> {
        let film = resume_with(self.surfaces, self.bvh, self.camera, settings, done, monitor);
        Some(film.map_err(anyhow::Error::from))
    }
}

/// How a film is rendered.
pub(super) struct FilmJob<'a> {
    pub(super) settings: &'a Settings,
    pub(super) output: &'a OutputFile,
    pub(super) passes: Option<Passes>,
    pub(super) checkpoint: Option<&'a CheckpointWriter>,
    /// Stands before the progress bar.
    pub(super) label: &'a str,
    /// Whether a later run makes the picture if this one does not.
    pub(super) is_frame: bool,
    /// Completes a picture that is stopped.
    pub(super) cpu: &'a CpuRenderer<'a>,
}

/// Renders the tiles that are not in `done`, with a progress bar.
///
/// After Ctrl-C or a failure, the finished tiles are written to the checkpoint if there is one; else to the output file with one sample per
/// pixel in the others, except for parts, which must be complete to be merged, and frames, which a later run makes.
pub(super) fn render(renderer: &dyn FilmRenderer, job: &FilmJob, done: Vec<Tile>) -> Result<(Film, Vec<Fact>)> {
    let &FilmJob { settings, output: file, checkpoint, .. } = job;
    let mut facts = vec![("device", json!(renderer.device()))];
    let times = StageTimes::default();
    // indicatif hides the bar if standard error is not a terminal.
    let bar = if output::is_quiet() { ProgressBar::hidden() } else { ProgressBar::new(0) };
    if let Ok(style) = ProgressStyle::with_template("{prefix}{bar:40} {percent:>3} %  {elapsed} of about {duration}") {
        bar.set_style(style);
    }
    if let Some(passes) = &job.passes {
        let film = passes.render(renderer, settings, file, &bar, &times);
        bar.finish_and_clear();
        let (film, n_samples) = film?;
        facts.extend(facts::of_threads(&times));
        facts.push(("samples_per_pixel", json!(n_samples)));
        return Ok((film, facts));
    }
    bar.set_prefix(job.label.to_owned());
    let progress = |done: usize, all: usize| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    // A noisy frame would look whole to `--resume`.
    let keeps_partial = settings.part.is_none() && checkpoint.is_none() && !job.is_frame;
    let tiles = keeps_partial.then(|| Tiles::new(Partial::new(settings.tiling())));
    let add = |tile: &Tile| {
        if let Some(tiles) = &tiles {
            tiles.lock().add(tile);
        }
    };
    done.iter().for_each(add);
    let finished = |tile: &Tile| {
        add(tile);
        if let Some(checkpoint) = checkpoint {
            checkpoint.add(tile);
        }
    };
    let monitor =
        Monitor { progress: &progress, finished: &finished, cancel: process::cancel_flag(), times: Some(&times) };
    let film = renderer.render(done, &monitor, &mut facts);
    facts.extend(facts::of_threads(&times));
    bar.finish_and_clear();
    let Err(error) = film else { return Ok((film?, facts)) };
    let is_stopped = matches!(error.downcast_ref(), Some(RenderError::Cancelled));
    if !is_stopped && !tiles.as_ref().is_some_and(|tiles| tiles.lock().has_samples()) {
        // A camera without a direction, for example: there is nothing to rescue.
        return Err(error);
    }
    if let Some(checkpoint) = checkpoint {
        checkpoint.save();
        output::note("the checkpoint has the finished tiles; the same command continues");
    }
    let written = tiles.map_or(Ok(()), |tiles| {
        write_stopped(&tiles, job.cpu, file)?;
        if !file.is_stream {
            let [width, height] = file.shown_size();
            output::note(&format!("{} is the unfinished picture, {width} x {height}", file.path.display()));
        }
        Ok(())
    });
    Err(stopped(error, written))
}

/// The finished tiles of a picture, which any thread adds.
struct Tiles(Mutex<Partial>);

impl Tiles {
    fn new(partial: Partial) -> Self {
        Self(Mutex::new(partial))
    }

    fn lock(&self) -> MutexGuard<'_, Partial> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Writes a picture that was stopped, with one sample per pixel where no tile is finished, or the color of the nearest tile where samples
/// take longer than [`COMPLETION`].
fn write_stopped(tiles: &Tiles, cpu: &CpuRenderer, file: &OutputFile) -> Result<()> {
    let [n_done, n_tiles] = tiles.lock().n_tiles();
    output::note(&format!(
        "finished {n_done} of {n_tiles} tiles; the others get 1 sample per pixel; interrupt again to end without a picture"
    ));
    let filters = file.denoising == Denoising::IfStopped;
    let aovs = if filters { GUIDES.into_iter().fold(cpu.settings.aovs, Aovs::with) } else { cpu.settings.aovs };
    let settings = Settings { samples: 1, noise: None, aovs, ..*cpu.settings };
    let (tiling, was_finished) = (settings.tiling(), tiles.lock().finished());
    let done = was_finished.iter().map(|&number| tiling.tile(number)).collect();
    let noisy = Mutex::new(Noisy::new(if filters { file.size } else { [0; 2] }));
    let finished = |tile: &Tile| {
        if filters {
            noisy.lock().unwrap_or_else(PoisonError::into_inner).add(&tiling, tile);
        }
        let mut tiles = tiles.lock();
        match tiles.keeps_guides() {
            true => tiles.add(tile),
            false => tiles.add(&Tile { guides: Vec::new(), ..tile.clone() }),
        }
    };
    // A second signal ends the process.
    let sampled = stopping_after(COMPLETION, &AtomicBool::new(true), tiles, |cancel| {
        let monitor = Monitor { finished: &finished, ..Monitor::quiet(cancel) };
        resume_with(cpu.surfaces, cpu.bvh, cpu.camera, &settings, done, &monitor)
    });
    match sampled {
        Ok(_) if filters => {
            let noisy = noisy.into_inner().unwrap_or_else(PoisonError::into_inner);
            let picture = tiles.lock().with_others(&was_finished, denoise(noisy, &Denoise::default()));
            file.write_partial(&tiles.lock(), Some(picture))
        }
        Ok(_) => file.write_partial(&tiles.lock(), None),
        Err(RenderError::Cancelled) => write_filled(tiles, file),
        Err(error) => Err(error.into()),
    }
}

/// Fills the tiles that have no samples, says so, and writes the picture without denoising it, which may take long, too.
fn write_filled(tiles: &Tiles, file: &OutputFile) -> Result<()> {
    let n_tiles = tiles.lock().n_tiles()[1];
    let n_filled = tiles.lock().fill();
    output::warn(&if tiles.lock().has_samples() {
        format!("{n_filled} of {n_tiles} tiles have no sample; they have the color of the nearest tile")
    } else {
        "the picture is black, as no tile has a sample".to_owned()
    });
    OutputFile { denoising: Denoising::Off, ..file.clone() }.write_partial(&tiles.lock(), None)
}

/// How long a picture that is stopped may take to become whole.
const COMPLETION: Duration = Duration::from_secs(2);

/// How long it may take where no tile has a sample yet.
const FIRST_TILE: Duration = Duration::from_secs(8);

/// Calls `run` with a flag that is set this time after `stop` is, or up to [`FIRST_TILE`] after it if no tile has a sample then.
fn stopping_after<R>(time: Duration, stop: &AtomicBool, tiles: &Tiles, run: impl FnOnce(&AtomicBool) -> R) -> R {
    let cancel = AtomicBool::new(false);
    let (running, ended) = mpsc::channel::<()>();
    thread::scope(|scope| {
        let cancel = &cancel;
        scope.spawn(move || {
            let mut since = None;
            while ended.recv_timeout(Duration::from_millis(20)) == Err(RecvTimeoutError::Timeout) {
                if stop.load(Ordering::Relaxed) {
                    let elapsed = since.get_or_insert_with(Instant::now).elapsed();
                    if elapsed >= FIRST_TILE || elapsed >= time && tiles.lock().has_samples() {
                        cancel.store(true, Ordering::Relaxed);
                        return;
                    }
                }
            }
        });
        // Dropped after the work, even if it panics.
        let _running = running;
        run(cancel)
    })
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

/// `--preview` and `--seconds`: passes over the whole picture.
#[derive(Clone, Debug)]
pub(super) struct Passes {
    /// The time that passes may take.
    pub(super) budget: Option<Duration>,
    /// Whether the output is written after each pass.
    pub(super) is_shown: bool,
}

impl Passes {
    /// The film of all passes, and the number of samples per pixel.
    ///
    /// Ctrl-C writes the passes that are complete, at least the first.
    ///
    /// # Errors
    /// A device that renders no passes, or what rendering a pass returns.
    fn render(
        &self,
        renderer: &dyn FilmRenderer,
        settings: &Settings,
        file: &OutputFile,
        bar: &ProgressBar,
        times: &StageTimes,
    ) -> Result<(Film, u32)> {
        let start = Instant::now();
        let (mut joined, mut n_rays, mut n_done, mut n_next) = (None, 0, 0, 1);
        while n_next > 0 {
            let range = [n_done, n_done + n_next];
            let progress = |done: usize, all: usize| {
                bar.set_length(all as u64);
                bar.set_position(done as u64);
            };
            bar.set_prefix(format!("samples {}..{} ", range[0], range[1]));
            let of_pass = Settings { part: Some(range), ..*settings };
            let done = file.outside(&of_pass);
            // Of the first pass alone, which gives each pixel a sample.
            let tiles = (n_done == 0).then(|| Tiles::new(Partial::new(of_pass.tiling())));
            let finished = |tile: &Tile| tiles.iter().for_each(|tiles| tiles.lock().add(tile));
            done.iter().for_each(finished);
            let pass = |cancel: &AtomicBool| {
                let monitor = Monitor { progress: &progress, finished: &finished, cancel, times: Some(times) };
                renderer.pass(&of_pass, done, &monitor).unwrap_or_else(|| {
                    let option = if self.budget.is_some() { "--seconds" } else { "--preview" };
                    Err(anyhow!("{option} renders in passes, which only the CPU does; use --device cpu"))
                })
            };
            let stop = process::cancel_flag();
            let film = match &tiles {
                Some(tiles) => stopping_after(COMPLETION, stop, tiles, pass),
                None => pass(stop),
            };
            let film = match film {
                Err(error) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => {
                    if let Some(part) = joined {
                        file.write_unfinished(whole(settings, part, n_rays)?)?;
                        let n = settings.samples;
                        output::warn(&format!("the picture has {n_done} of {n} samples per pixel"));
                    } else if let Some(tiles) = tiles {
                        write_filled(&tiles, file)?;
                    }
                    return Err(error);
                }
                film => film?,
            };
            n_rays += film.n_rays();
            let parts = joined.take().into_iter().chain(film.part().cloned()).collect();
            let part = Part::join(parts).map_err(|error| anyhow!("{error}"))?;
            n_done = range[1];
            n_next = next(n_done, settings.samples, start.elapsed(), self.budget);
            if self.is_shown && n_next > 0 {
                file.write_unfinished(whole(settings, part.clone(), n_rays)?)?;
            }
            joined = Some(part);
        }
        let part = joined.ok_or_else(|| anyhow!("no sample was rendered"))?;
        Ok((whole(settings, part, n_rays)?, n_done))
    }
}

/// The number of samples of the next pass: as many as are done, fewer where they exceed the total or the time that is left.
pub(crate) fn next(n_done: u32, n_all: u32, elapsed: Duration, budget: Option<Duration>) -> u32 {
    let n = n_done.min(n_all.saturating_sub(n_done));
    let Some(budget) = budget else { return n };
    let left = budget.saturating_sub(elapsed).as_secs_f64();
    let fitting = left / elapsed.as_secs_f64().max(1e-9) * f64::from(n_done);
    n.min(fitting.min(f64::from(n)) as u32)
}

/// The film of a part that starts at sample 0, as a picture in its own right.
pub(crate) fn whole(settings: &Settings, part: Part, n_rays: u64) -> Result<Film> {
    if part.range().start != 0 {
        return Err(anyhow!("the first pass is missing"));
    }
    Ok(Film::of_part(settings.width, settings.height, part, n_rays).without_part())
}

/// `--checkpoint`: collects finished tiles and writes them at intervals, so that an interrupted render continues from them.
pub(super) struct CheckpointWriter {
    path: PathBuf,
    interval: Duration,
    state: Mutex<State>,
}

struct State {
    tiles: Checkpoint,
    written: Instant,
    has_failed: bool,
}

impl CheckpointWriter {
    /// Opens the checkpoint of the render that `record` describes, and returns its finished tiles.
    ///
    /// # Errors
    /// The file cannot be written, is damaged, or belongs to another render.
    pub(super) fn open(path: PathBuf, interval: Duration, record: &Record) -> Result<(Self, Vec<Tile>)> {
        output::probe(&path)?;
        let mut done = Vec::new();
        if path.exists() {
            let (found, tiles) = Checkpoint::read(&path)?;
            if let Some((name, theirs, ours)) = difference(&found, record) {
                let path = path.display();
                return Err(anyhow!(
                    "{path}: checkpoint of another picture: {name} is {theirs}, not {ours}; use another file"
                ));
            }
            done = tiles;
        }
        let mut tiles = Checkpoint::new(record);
        done.iter().for_each(|tile| tiles.add(tile));
        let state = State { tiles, written: Instant::now(), has_failed: false };
        Ok((Self { path, interval, state: Mutex::new(state) }, done))
    }

    /// Adds a tile. Writes the file if the interval has passed.
    pub(super) fn add(&self, tile: &Tile) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.tiles.add(tile);
        if state.written.elapsed() >= self.interval {
            self.write(&mut state);
        }
    }

    /// Writes the file now.
    pub(super) fn save(&self) {
        self.write(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// A failure, such as a full disk, does not stop the render. It is reported once.
    fn write(&self, state: &mut State) {
        if let Err(error) = state.tiles.write(&self.path)
            && !state.has_failed
        {
            state.has_failed = true;
            output::warn(&error.to_string());
        }
        state.written = Instant::now();
    }

    /// Removes the file of a complete picture.
    pub(super) fn remove(self) -> Result<()> {
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(anyhow!("cannot remove {}: {error}", self.path.display()))
            }
            _ => Ok(()),
        }
    }
}

/// The first difference of two records: name and both values.
pub(crate) fn difference(a: &Record, b: &Record) -> Option<(String, String, String)> {
    let value = |record: &Record, name: &str| {
        let found = record.iter().find(|(known, _)| known == name).map(|(_, value)| value.clone());
        found.unwrap_or_else(|| "missing".to_owned())
    };
    let names = a.iter().chain(b).map(|(name, _)| name);
    names.map(|name| (name.clone(), value(a, name), value(b, name))).find(|(_, a, b)| a != b)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use canted_film::{Format, read_picture};
    use canted_renderer::{SceneBvhConfig, frame, resume};

    use super::*;
    use crate::{render::output::Denoising, settings::LookOptions};

    /// An OpenEXR file without a name.
    fn exr(size: [u32; 2]) -> OutputFile {
        OutputFile {
            path: PathBuf::new(),
            format: Format::Exr,
            is_stream: false,
            keeps_others: false,
            crop: None,
            size,
            aovs: Aovs::NONE,
            denoising: Denoising::Off,
            is_transparent: false,
            look: LookOptions::default(),
        }
    }

    /// Stands for the loss of a device, which a test cannot provoke: every failure after the first tile takes this path.
    #[test]
    fn a_failure_writes_the_finished_tiles_and_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let file = OutputFile { path: folder.path().join("out.exr"), ..exr([16, 8]) };
        let settings = Settings { width: 16, height: 8, samples: 1, tile: 8, ..Settings::default() };
        let scene = canted_scene::builtin();
        let bvh = SceneBvh::build(&scene, &SceneBvhConfig::default()).unwrap();
        let camera = frame(&scene, &bvh, 2.0);
        let tiles = Mutex::new(Vec::new());
        let (finished, cancel) = (|tile: &Tile| tiles.lock().unwrap().push(tile.clone()), AtomicBool::new(false));
        let monitor = Monitor { finished: &finished, ..Monitor::quiet(&cancel) };
        let complete = resume(&scene, &bvh, &camera, &settings, Vec::new(), &monitor).unwrap().picture();
        let mut partial = Partial::new(settings.tiling());
        tiles.lock().unwrap().iter().filter(|tile| tile.number == 1).for_each(|tile| partial.add(tile));
        let error = stopped(anyhow!("the device is lost"), file.write_partial(&partial, None));
        assert_eq!(error.to_string(), "the device is lost");
        let left = read_picture(&file.path).unwrap();
        for (x, y) in (0..8).flat_map(|y| (0..16).map(move |x| (x, y))) {
            let at = left.index(x, y);
            assert_eq!(left.pixels[at], if x < 8 { [0.0; 3] } else { complete.pixels[at] }, "{x}, {y}");
        }
        let nowhere = OutputFile { path: folder.path().join("no/out.exr"), ..file };
        let error = stopped(anyhow!("the device is lost"), nowhere.write_partial(&partial, None));
        assert_eq!(error.to_string(), "the device is lost");
        let error = stopped(RenderError::Cancelled.into(), nowhere.write_partial(&partial, None));
        assert!(error.to_string().starts_with("cannot write"), "{error}");
    }

    /// What has one sample per pixel is filtered as a finished picture of one sample is; finished tiles of many samples stay as they are.
    #[test]
    fn a_stopped_picture_of_many_samples_is_filtered_where_it_has_few() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, denoising| OutputFile { path: folder.path().join(name), denoising, ..exr([48, 32]) };
        let scene = canted_scene::builtin();
        let bvh = SceneBvh::build(&scene, &SceneBvhConfig::default()).unwrap();
        let camera = frame(&scene, &bvh, 1.5);
        let surfaces = Surfaces::new(&scene);
        let settings =
            Settings { width: 48, height: 32, samples: 100, tile: 16, means_only: true, ..Settings::default() };
        let written = |name: &str, denoising, finished: Option<&Tile>| {
            let tiles = Tiles::new(Partial::new(settings.tiling()));
            finished.iter().for_each(|tile| tiles.lock().add(tile));
            let cpu = CpuRenderer { surfaces: &surfaces, bvh: &bvh, camera: &camera, settings: &settings };
            write_stopped(&tiles, &cpu, &file(name, denoising)).unwrap();
            read_picture(&folder.path().join(name)).unwrap()
        };
        let one = Settings { samples: 1, aovs: GUIDES.into_iter().collect(), means_only: false, ..settings };
        let cancel = AtomicBool::new(false);
        let monitor = Monitor::quiet(&cancel);
        let film = resume_with(&surfaces, &bvh, &camera, &one, Vec::new(), &monitor).unwrap();
        let filtered = denoise(Noisy::of_film(&film).unwrap(), &Denoise::default());
        assert_eq!(written("off.exr", Denoising::Off, None), film.picture());
        assert_eq!(written("filtered.exr", Denoising::IfStopped, None), filtered);
        let mut tile = settings.tiling().tile(2);
        tile.pixels.fill(canted_film::Pixel::of([0.25; 3]));
        let mixed = written("mixed.exr", Denoising::IfStopped, Some(&tile));
        for (x, y) in (0..32).flat_map(|y| (0..48).map(move |x| (x, y))) {
            let at = mixed.index(x, y);
            if x >= 32 && y < 16 {
                assert_eq!(mixed.pixels[at], [0.25; 3], "{x} {y}");
            } else {
                assert_ne!(mixed.pixels[at], [0.25; 3], "{x} {y}");
            }
        }
        assert_ne!(mixed.pixels, filtered.pixels);
    }

    #[test]
    fn passes_double_up_to_the_total_and_the_time() {
        let second = Duration::from_secs(1);
        let sizes = |n_all: u32| {
            let mut sizes = vec![1];
            while let n @ 1.. = next(sizes.iter().sum(), n_all, second, None) {
                sizes.push(n);
            }
            sizes
        };
        assert_eq!(sizes(1), [1]);
        assert_eq!(sizes(16), [1, 1, 2, 4, 8]);
        assert_eq!(sizes(11), [1, 1, 2, 4, 3]);
        // 8 samples took a second: one and a half more are 12.
        assert_eq!(next(8, 100, second, Some(Duration::from_millis(2500))), 8);
        assert_eq!(next(8, 100, second, Some(Duration::from_millis(1500))), 4);
        assert_eq!(next(8, 100, second, Some(Duration::from_millis(1100))), 0);
        assert_eq!(next(8, 100, second, Some(Duration::from_millis(900))), 0);
    }
}
