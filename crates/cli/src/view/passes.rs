//! The pictures of a job: coarse, then refined in passes of 1, 1, 2, 4, ... samples. The last film has the bits of `canted render`.

use std::{
    path::PathBuf,
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_film::{Aovs, Film, Part, Picture};
use canted_obb::Obb;
use canted_renderer::{Integrator, RenderError, Settings, draw_boxes, heatmap};
use canted_scene::Camera;

use super::{
    frame::{self, Frame, FrameSender, Job, JobQueue, Message, Seen, View},
    options::{FilmKey, Options},
    scene::{Device, FrameInput, Passes, SessionScene},
};
use crate::{
    output,
    render::{self, next_pass, whole_film},
    settings::{LookOptions, Plan},
};

/// Time that a coarse picture may take.
const COARSE_SECONDS: f64 = 0.04;

/// How long the better picture of a moving camera waits for another position.
const REST: Duration = Duration::from_millis(150);

/// Renders jobs, and keeps what the next one can use.
#[derive(Default)]
struct Renderer {
    /// The scene, camera and settings of the latest job.
    latest: Option<(SessionScene, Camera, Settings)>,
    device: Device,
    /// Seconds that the CPU takes for a sample of a pixel.
    pace: Option<f64>,
    /// The last film, complete or not, and what determines it.
    last: Option<(FilmKey, Refined)>,
    /// For which scene the exposure was decided last, and the one that was chosen.
    stops: Option<(Option<PathBuf>, Option<f32>)>,
}

impl Renderer {
    /// Renders a job until it is settled or another one comes.
    fn serve(&mut self, job: &Job, queue: &JobQueue, sender: &FrameSender) -> Result<()> {
        let mut plan = job.options.plan()?;
        let n_samples = plan.settings.samples;
        let mut ready = match self.latest.take() {
            Some((ready, ..)) => ready.followed(&job.options, &plan)?,
            None => SessionScene::open(&job.options, &plan)?,
        };
        let camera = match ready.camera(&mut plan) {
            Ok(camera) => camera,
            Err(error) => {
                let camera = Camera::pinhole([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 45.0);
                self.latest = Some((ready, camera, plan.settings));
                return Err(error);
            }
        };
        let center = plan.size().map(|side| 0.5 * f64::from(side));
        let mut chosen = plan.clone();
        ready.choose_integrator(&mut chosen);
        let view = View {
            number: job.number,
            size: plan.size(),
            n_samples,
            is_moving: job.is_moving,
            camera,
            is_file_camera: !ready.scene.cameras.is_empty(),
            integrator: chosen.settings.integrator,
            device: "cpu".to_owned(),
            center_distance: ready.seen_at(&camera, &plan.settings, center).map(|seen| f64::from(seen.t)),
            time_range: ready.time_range,
            n_levels: ready.n_levels(),
            ready: ready.ready,
        };
        let result = self.render(&mut ready, job, &mut plan, &view, queue, sender);
        let is_cancelled = |error: &anyhow::Error| matches!(error.downcast_ref(), Some(RenderError::Cancelled));
        if result.as_ref().is_err_and(|error| !is_cancelled(error)) {
            self.device.reset();
        }
        self.latest = Some((ready, camera, plan.settings));
        result
    }

    fn render(
        &mut self,
        ready: &mut SessionScene,
        job: &Job,
        plan: &mut Plan,
        view: &View,
        queue: &JobQueue,
        sender: &FrameSender,
    ) -> Result<()> {
        let is_exposed = plan.needs_exposure();
        let decided = self.stops.as_ref().filter(|(scene, _)| is_exposed && *scene == plan.source.scene);
        let is_decided = !is_exposed || decided.is_some();
        if let Some((_, stops)) = decided {
            plan.look.set_stops(*stops);
        }
        let shown = Shown::new(ready, plan, &job.options, view.camera)?;
        let send = |view: View, picture: Picture, n_samples: u32, is_settled: bool| {
            sender.send(Message::Frame(Frame::new(view, shown.with_boxes(picture), n_samples, is_settled)));
        };
        if let Some((measure, scale)) = plan.heatmap {
            let map = ready.with_surfaces(plan.settings.lod, |surfaces| {
                heatmap(surfaces, &ready.bvh, &view.camera, plan.size(), measure, scale)
            });
            let picture = map?.picture;
            send(view.clone(), picture, 0, true);
            return Ok(());
        }
        let key = job.options.film_key();
        let mut progress = self.last.take().filter(|(of, _)| *of == key).map(|(_, refined)| refined);
        if let Some(refined) = &progress {
            let is_complete = refined.is_complete();
            if is_complete && !is_decided {
                // The film was rendered while an exposure was given.
                self.choose(ready, &view.camera, plan, is_exposed)?;
            }
            send(refined.view(view), shown.picture(&refined.film, &plan.look), refined.n_samples(), is_complete);
            if is_complete {
                self.last = progress.map(|refined| (key, refined));
                return Ok(());
            }
        } else if let Some(film) = self.coarse(ready, plan, &job.options, &view.camera)? {
            send(view.clone(), shown.picture(&film, &plan.look), 0, false);
        }
        if queue.is_followed_within(if job.is_moving { REST } else { Duration::ZERO }) {
            self.last = progress.map(|refined| (key, refined));
            return Ok(());
        }
        let is_first = !ready.is_chosen();
        self.choose(ready, &view.camera, plan, is_exposed)?;
        // The first coarse picture had a light that may be far too weak or too strong.
        if is_first && let Some(film) = self.coarse(ready, plan, &job.options, &view.camera)? {
            send(view.clone(), shown.picture(&film, &plan.look), 0, false);
        }
        self.device.choose(job.options.device(), &plan.structure);
        let settings = settings(plan, &job.options)?;
        let (plan, ready) = (&*plan, &*ready);
        let result = ready.with_surfaces(settings.lod, |surfaces| {
            let input = FrameInput { surfaces, bvh: &ready.bvh, camera: &view.camera, plan, settings: &settings };
            let answer = |position| sender.send(Message::Seen(ready.seen_at(&view.camera, &settings, position)));
            let send = |refined: &Refined| {
                send(refined.view(view), shown.picture(&refined.film, &plan.look), refined.n_samples(), false);
            };
            let show = Show { send: &send, answer: &answer };
            refine(&input, &self.device, queue, &mut progress, &show)
        });
        if let Some(refined) = &progress {
            if refined.device == "cpu" {
                self.pace = Some(refined.seconds_per_sample);
            }
            if result.is_ok() {
                if let Some(warning) = render::dropped_samples(&refined.film) {
                    output::warn(&warning);
                }
                send(refined.view(view), shown.picture(&refined.film, &plan.look), refined.n_samples(), true);
            }
        }
        self.last = progress.map(|refined| (key, refined));
        result
    }

    /// Decides light, integrator and, if it is not given, the exposure.
    fn choose(&mut self, ready: &mut SessionScene, camera: &Camera, plan: &mut Plan, is_exposed: bool) -> Result<()> {
        if is_exposed {
            plan.look.set_stops(None);
        }
        ready.choose(camera, plan)?;
        self.stops = is_exposed.then(|| (plan.source.scene.clone(), plan.look.stops()));
        Ok(())
    }

    /// A film of one sample in each of so few pixels that it takes no longer than [`COARSE_SECONDS`] on the CPU; `None` where the first
    /// pass is as fast.
    fn coarse(
        &mut self,
        ready: &SessionScene,
        plan: &Plan,
        options: &Options,
        camera: &Camera,
    ) -> Result<Option<Film>> {
        const LARGEST: u32 = 16;
        let mut plan = plan.clone();
        ready.choose_integrator(&mut plan);
        let settings = settings(&plan, options)?;
        let n_pixels = f64::from(plan.size()[0]) * f64::from(plan.size()[1]);
        // A machine that nothing is known of gets a small picture.
        let affordable = self.pace.map_or(0.0, |pace| COARSE_SECONDS / (pace * n_pixels));
        let divisors = [1, 2, 3, 4, 6, 8, 12, LARGEST];
        let divisor = divisors.into_iter().find(|d| affordable * f64::from(d * d) >= 1.0).unwrap_or(LARGEST);
        if divisor == 1 {
            return Ok(None);
        }
        let [width, height] = plan.size().map(|side| side.div_ceil(divisor));
        let settings = Settings { width, height, samples: 1, part: None, noise: None, ..settings };
        let start = Instant::now();
        let film = ready.with_surfaces(settings.lod, |surfaces| {
            let input = FrameInput { surfaces, bvh: &ready.bvh, camera, plan: &plan, settings: &settings };
            let mut film = None;
            input.with_passes(&Device::default(), |passes| {
                // Not cancelled: a moving camera must show something.
                film = Some(passes.film(&settings, &AtomicBool::new(false))?);
                Ok(())
            })?;
            anyhow::Ok(film)
        })?;
        // The first tiles of a picture also fill the caches, so one measurement is not the truth.
        let pace = start.elapsed().as_secs_f64() / (f64::from(width) * f64::from(height));
        self.pace = Some(self.pace.map_or(pace, |known| 0.5 * (known + pace)));
        Ok(film)
    }

    /// Reports what is at positions of the latest picture.
    fn answer(&self, clicks: Vec<[f64; 2]>, sender: &FrameSender) {
        for position in clicks {
            let at = |(ready, camera, settings): &(SessionScene, Camera, Settings)| {
                ready.seen_at(camera, settings, position)
            };
            let seen: Option<Seen> = self.latest.as_ref().and_then(at);
            sender.send(Message::Seen(seen));
        }
    }
}

/// The settings of the film, with the channel that is shown.
fn settings(plan: &Plan, options: &Options) -> Result<Settings> {
    let of_integrator = plan.settings.integrator.aovs();
    let aov = options.aov.filter(|&aov| of_integrator.contains(aov));
    let aovs = aov.map_or(Aovs::NONE, |aov| Aovs::NONE.with(aov));
    Ok(Settings { aovs, ..plan.settings })
}

/// How films are shown: as light or as a channel, with or without boxes.
struct Shown {
    aov: Option<canted_film::Aov>,
    size: [u32; 2],
    boxes: Option<(canted_renderer::View, Arc<Vec<Obb>>)>,
}

impl Shown {
    fn new(ready: &mut SessionScene, plan: &Plan, options: &Options, camera: Camera) -> Result<Self> {
        let [width, height] = plan.size();
        let view = canted_renderer::View::new(&camera, width, height);
        let boxes = options.boxes().map(|level| anyhow::Ok((view?, ready.boxes(level)))).transpose()?;
        Ok(Self { aov: options.aov, size: plan.size(), boxes })
    }

    /// The picture of a film: a channel, or light with exposure and tone curve.
    fn picture(&self, film: &Film, look: &LookOptions) -> Picture {
        match self.aov {
            Some(aov) => frame::channel(film, aov),
            None => look.apply(film.picture()),
        }
    }

    /// The picture with the boxes that are shown, in full size: lines of a coarse picture would be too wide.
    fn with_boxes(&self, picture: Picture) -> Picture {
        let Some((view, boxes)) = &self.boxes else { return picture };
        let mut whole = enlarged(picture, self.size);
        draw_boxes(&mut whole, [0, 0], view, boxes);
        whole
    }
}

/// A picture of this size from a smaller one, whose pixels it repeats.
fn enlarged(picture: Picture, [width, height]: [u32; 2]) -> Picture {
    if [picture.width, picture.height] == [width, height] {
        return picture;
    }
    let source = |at: u32, n: u32, of: u32| u64::from(at) * u64::from(of) / u64::from(n.max(1));
    let pixel = |x: u32, y: u32| {
        let [column, row] = [source(x, width, picture.width), source(y, height, picture.height)].map(|i| i as u32);
        picture.pixels[picture.index(column, row)]
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
    Picture { width, height, pixels }
}

/// The film of all samples so far.
struct Refined {
    film: Film,
    integrator: Integrator,
    /// `cpu`, or the value of `--device` where a GPU renders.
    device: String,
    /// Seconds for a sample of a pixel, in the last pass.
    seconds_per_sample: f64,
    /// The sums that the next pass continues; none where there is no next pass.
    part: Option<Part>,
    n_rays: u64,
    /// Samples of each pixel that are in `part`.
    n_done: u32,
}

impl Refined {
    /// A view with what was decided for the film.
    fn view(&self, view: &View) -> View {
        View { integrator: self.integrator, device: self.device.clone(), ..view.clone() }
    }

    /// Whether no pass is missing.
    fn is_complete(&self) -> bool {
        self.part.is_none()
    }

    /// Samples of each pixel, on average.
    fn n_samples(&self) -> u32 {
        let n_pixels = u64::from(self.film.width()) * u64::from(self.film.height());
        u32::try_from(self.film.n_samples() / n_pixels.max(1)).unwrap_or(u32::MAX)
    }
}

/// Renders the samples that `progress` does not have, and leaves there what is done; `send` shows each film but the last. Clicks in
/// between are answered.
///
/// # Errors
/// Cancelled by another job; the loss of the device.
fn refine(
    input: &FrameInput,
    device: &Device,
    queue: &JobQueue,
    progress: &mut Option<Refined>,
    show: &Show,
) -> Result<()> {
    input.with_passes(device, |passes| all_passes(passes, input.settings, queue, progress, show))
}

/// What happens between passes.
struct Show<'a> {
    send: &'a dyn Fn(&Refined),
    answer: &'a dyn Fn([f64; 2]),
}

fn all_passes(
    passes: &dyn Passes,
    settings: &Settings,
    queue: &JobQueue,
    progress: &mut Option<Refined>,
    show: &Show,
) -> Result<()> {
    let n_pixels = f64::from(settings.width) * f64::from(settings.height);
    // Samples of several devices are not mixed.
    if progress.as_ref().is_some_and(|done| done.device != passes.device()) {
        *progress = None;
    }
    loop {
        let (n_done, n_rays) = progress.as_ref().map_or((0, 0), |done| (done.n_done, done.n_rays));
        let n_next = if n_done == 0 { 1 } else { next_pass(n_done, settings.samples, Duration::ZERO, None) };
        let range = [n_done, n_done + n_next];
        // Adaptive sampling is not divided into passes.
        let part = settings.noise.is_none().then_some(range);
        let start = Instant::now();
        let film = match passes.film(&Settings { part, ..*settings }, queue.cancel()) {
            Err(error) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => {
                // Clicks are answered, then the pass starts again.
                let Some(clicks) = queue.clicks() else { return Err(error) };
                clicks.into_iter().for_each(show.answer);
                continue;
            }
            film => film?,
        };
        let seconds_per_sample = start.elapsed().as_secs_f64() / (n_pixels * f64::from(n_next));
        let n_rays = n_rays + film.n_rays();
        let (film, part) = if part.is_some() {
            // After an error there is no film: one without sums would count as complete.
            let before = progress.take().and_then(|done| done.part);
            let parts = before.into_iter().chain(film.part().cloned()).collect();
            let joined = Part::join(parts).map_err(|error| anyhow!("{error}"))?;
            let has_more = next_pass(range[1], settings.samples, Duration::ZERO, None) > 0;
            (whole_film(settings, joined.clone(), n_rays)?, has_more.then_some(joined))
        } else {
            (film, None)
        };
        let (integrator, device) = (settings.integrator, passes.device().to_owned());
        let refined = Refined { film, integrator, device, seconds_per_sample, part, n_rays, n_done: range[1] };
        let refined = &*progress.insert(refined);
        if refined.is_complete() {
            return Ok(());
        }
        (show.send)(refined);
    }
}

/// Serves jobs and clicks until the session is closed.
pub(super) fn serve(queue: &JobQueue, sender: &FrameSender) {
    let mut renderer = Renderer::default();
    let mut reported = Vec::new();
    while let Some((job, clicks)) = queue.next() {
        let (_, warnings) = output::collecting(|| {
            if let Some(job) = job {
                let number = job.number;
                if let Err(error) = renderer.serve(&job, queue, sender) {
                    let is_cancelled = matches!(error.downcast_ref(), Some(RenderError::Cancelled));
                    if !is_cancelled {
                        sender.send(Message::Failed { number, reason: error.to_string() });
                    }
                }
            }
            renderer.answer(clicks, sender);
        });
        let new: Vec<String> = warnings.into_iter().filter(|warning| !reported.contains(warning)).collect();
        reported.extend(new.iter().cloned());
        if !new.is_empty() {
            sender.send(Message::Warnings(new));
        }
    }
}
