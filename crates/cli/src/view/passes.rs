//! The pictures of a job: coarse, then pass by pass.

use std::{
    path::PathBuf,
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use anyhow::Result;
use canted_film::{Aovs, Film, Picture};
use canted_obb::Obb;
use canted_renderer::{RenderError, Settings, draw_boxes};
use canted_scene::Camera;

use super::{
    channel,
    device::Device,
    frame::{Frame, Seen, View},
    options::Options,
    refine::{Refined, Show, refine},
    stage::Stage,
    traced::Shot,
    worker::{Desk, Job, Message, Outbox},
};
use crate::render::{self, Args};

/// Time that a coarse picture may take.
const COARSE_SECONDS: f64 = 0.04;

/// How long the better picture of a moving camera waits for another position.
const REST: Duration = Duration::from_millis(150);

/// Renders jobs, and keeps what the next one can use.
#[derive(Default)]
pub(super) struct Renderer {
    /// The stage, camera and size of the latest job.
    latest: Option<(Stage, Camera, [u32; 2])>,
    device: Device,
    /// Seconds that the CPU takes for a sample of a pixel.
    pace: Option<f64>,
    /// The last film, complete or not, and what determines it.
    kept: Option<(String, Refined)>,
    /// For which scene the exposure was decided last, and the one that was chosen.
    stops: Option<(Option<PathBuf>, Option<f32>)>,
}

impl Renderer {
    /// Renders a job until it is settled or another one comes.
    pub(super) fn serve(&mut self, job: &Job, desk: &Desk, outbox: &Outbox) -> Result<()> {
        let mut args = job.options.args()?;
        let n_samples = args.settings()?.samples;
        let mut stage = match self.latest.take() {
            Some((stage, ..)) => stage.followed(&job.options, &args)?,
            None => Stage::open(&job.options, &args)?,
        };
        let camera = match stage.traced.camera(&stage.scene, &args) {
            Ok(camera) => camera,
            Err(error) => {
                let camera = Camera::pinhole([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 45.0);
                self.latest = Some((stage, camera, args.size));
                return Err(error);
            }
        };
        let center = args.size.map(|side| 0.5 * f64::from(side));
        let mut chosen = args.clone();
        stage.choose_integrator(&mut chosen);
        let view = View {
            number: job.number,
            size: args.size,
            n_samples,
            is_moving: job.is_moving,
            camera,
            is_file_camera: !stage.scene.cameras.is_empty(),
            integrator: chosen.settings()?.integrator,
            device: "cpu".to_owned(),
            center_distance: stage.seen_at(&camera, args.size, center).map(|seen| f64::from(seen.t)),
            time_range: stage.time_range,
            n_levels: stage.n_levels(),
            ready: stage.ready,
        };
        let result = self.render(&mut stage, job, &mut args, &view, desk, outbox);
        let is_cancelled = |error: &anyhow::Error| matches!(error.downcast_ref(), Some(RenderError::Cancelled));
        if result.as_ref().is_err_and(|error| !is_cancelled(error)) {
            self.device.reset();
        }
        self.latest = Some((stage, camera, args.size));
        result
    }

    fn render(
        &mut self,
        stage: &mut Stage,
        job: &Job,
        args: &mut Args,
        view: &View,
        desk: &Desk,
        outbox: &Outbox,
    ) -> Result<()> {
        let is_exposed = args.needs_exposure();
        let decided = self.stops.as_ref().filter(|(scene, _)| is_exposed && *scene == args.scene);
        let is_decided = !is_exposed || decided.is_some();
        if let Some((_, stops)) = decided {
            args.look.set_stops(*stops);
        }
        let shown = Shown::new(stage, args, &job.options, view.camera)?;
        let send = |view: View, picture: Picture, n_samples: u32, is_settled: bool| {
            outbox.send(Message::Frame(Frame::new(view, shown.with_boxes(picture), n_samples, is_settled)));
        };
        if args.heatmap.is_some() {
            let picture = stage
                .with_surfaces(args.settings()?.lod, |surfaces, traced| traced.heatmap(surfaces, &view.camera, args))?;
            send(view.clone(), picture, 0, true);
            return Ok(());
        }
        let key = job.options.film_key();
        let mut progress = self.kept.take().filter(|(of, _)| *of == key).map(|(_, refined)| refined);
        if let Some(refined) = &progress {
            let is_complete = refined.is_complete();
            if is_complete && !is_decided {
                // The film was rendered while an exposure was given.
                self.choose(stage, &view.camera, args, is_exposed)?;
            }
            send(refined.view(view), shown.picture(&refined.film, args), refined.n_samples(), is_complete);
            if is_complete {
                self.kept = progress.map(|refined| (key, refined));
                return Ok(());
            }
        } else if let Some(film) = self.coarse(stage, args, &job.options, &view.camera)? {
            send(view.clone(), shown.picture(&film, args), 0, false);
        }
        if desk.is_followed_within(if job.is_moving { REST } else { Duration::ZERO }) {
            self.kept = progress.map(|refined| (key, refined));
            return Ok(());
        }
        let is_first = !stage.is_chosen();
        self.choose(stage, &view.camera, args, is_exposed)?;
        // The first coarse picture had a light that may be far too weak or too strong.
        if is_first && let Some(film) = self.coarse(stage, args, &job.options, &view.camera)? {
            send(view.clone(), shown.picture(&film, args), 0, false);
        }
        self.device.choose(args);
        let settings = settings(args, &job.options)?;
        let (args, stage) = (&*args, &*stage);
        let result = stage.with_surfaces(settings.lod, |surfaces, traced| {
            let shot = Shot { surfaces, camera: &view.camera, args, settings: &settings };
            let answer = |position| outbox.send(Message::Seen(stage.seen_at(&view.camera, view.size, position)));
            let send = |refined: &Refined| {
                send(refined.view(view), shown.picture(&refined.film, args), refined.n_samples(), false);
            };
            let show = Show { send: &send, answer: &answer };
            refine(traced, &shot, &self.device, desk, &mut progress, &show)
        });
        if let Some(refined) = &progress {
            if refined.device == "cpu" {
                self.pace = Some(refined.seconds_per_sample);
            }
            if result.is_ok() {
                if let Some(warning) = render::dropped_samples(&refined.film) {
                    crate::output::warn(&warning);
                }
                send(refined.view(view), shown.picture(&refined.film, args), refined.n_samples(), true);
            }
        }
        self.kept = progress.map(|refined| (key, refined));
        result
    }

    /// Decides light, integrator and, if it is not given, the exposure.
    fn choose(&mut self, stage: &mut Stage, camera: &Camera, args: &mut Args, is_exposed: bool) -> Result<()> {
        if is_exposed {
            args.look.set_stops(None);
        }
        stage.choose(camera, args)?;
        self.stops = is_exposed.then(|| (args.scene.clone(), args.look.stops()));
        Ok(())
    }

    /// A film of one sample in each of so few pixels that it takes no longer than [`COARSE_SECONDS`] on the CPU; `None` where the first
    /// pass is as fast.
    fn coarse(&mut self, stage: &Stage, args: &Args, options: &Options, camera: &Camera) -> Result<Option<Film>> {
        const LARGEST: u32 = 16;
        let mut args = args.clone();
        stage.choose_integrator(&mut args);
        let settings = settings(&args, options)?;
        let n_pixels = f64::from(args.size[0]) * f64::from(args.size[1]);
        // A machine that nothing is known of gets a small picture.
        let affordable = self.pace.map_or(0.0, |pace| COARSE_SECONDS / (pace * n_pixels));
        let divisors = [1, 2, 3, 4, 6, 8, 12, LARGEST];
        let divisor = divisors.into_iter().find(|d| affordable * f64::from(d * d) >= 1.0).unwrap_or(LARGEST);
        if divisor == 1 {
            return Ok(None);
        }
        let [width, height] = args.size.map(|side| side.div_ceil(divisor));
        let settings = Settings { width, height, samples: 1, part: None, noise: None, ..settings };
        let start = Instant::now();
        let film = stage.with_surfaces(settings.lod, |surfaces, traced| {
            let shot = Shot { surfaces, camera, args: &args, settings: &settings };
            let mut film = None;
            traced.with_passes(&shot, &Device::default(), &mut |passes| {
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
    pub(super) fn answer(&self, clicks: Vec<[f64; 2]>, outbox: &Outbox) {
        for position in clicks {
            let at = |(stage, camera, size): &(Stage, Camera, [u32; 2])| stage.seen_at(camera, *size, position);
            let seen: Option<Seen> = self.latest.as_ref().and_then(at);
            outbox.send(Message::Seen(seen));
        }
    }
}

/// The settings of the film, with the channel that is shown.
fn settings(args: &Args, options: &Options) -> Result<Settings> {
    let aovs = options.aov.map_or(Aovs::NONE, |aov| Aovs::NONE.with(aov));
    Ok(Settings { aovs, ..args.settings()? })
}

/// How films are shown: as light or as a channel, with or without boxes.
struct Shown {
    aov: Option<canted_film::Aov>,
    size: [u32; 2],
    boxes: Option<(canted_renderer::View, Arc<Vec<Obb>>)>,
}

impl Shown {
    fn new(stage: &mut Stage, args: &Args, options: &Options, camera: Camera) -> Result<Self> {
        let [width, height] = args.size;
        let view = canted_renderer::View::new(&camera, width, height);
        let boxes = args.boxes.map(|level| anyhow::Ok((view?, stage.boxes(level)))).transpose()?;
        Ok(Self { aov: options.aov, size: args.size, boxes })
    }

    /// The picture of a film: a channel, or light with exposure and tone curve.
    fn picture(&self, film: &Film, args: &Args) -> Picture {
        match self.aov {
            Some(aov) => channel::picture(film, aov),
            None => args.look.apply(film.picture()),
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
    #[expect(clippy::cast_possible_truncation, reason = "less than the side of the picture")]
    let pixel = |x: u32, y: u32| {
        let [column, row] = [source(x, width, picture.width), source(y, height, picture.height)].map(|i| i as u32);
        picture.pixels[picture.index(column, row)]
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
    Picture { width, height, pixels }
}
