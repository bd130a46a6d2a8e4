//! The pictures of a job: coarse, then pass by pass.

use std::{
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_film::{Aovs, Film, Part, Picture};
use canted_renderer::{Integrator, RenderError, Settings};

use super::{
    channel,
    options::Options,
    stage::Stage,
    worker::{Desk, Frame, Job, Latest, Message, Outbox},
};
use crate::render::{self, Args, next_pass, whole_film};

/// Time that a coarse picture may take.
const COARSE_SECONDS: f64 = 0.05;

/// How long the better picture of a moving camera waits for another position.
const REST: Duration = Duration::from_millis(150);

/// Renders jobs, and keeps what the next one can use.
#[derive(Default)]
pub(super) struct Renderer {
    latest: Latest,
    /// Seconds for a sample of a pixel.
    pace: Option<f64>,
    /// The last complete film, and what determines it.
    complete: Option<(String, Film, Integrator)>,
}

impl Renderer {
    /// Renders a job until it is settled or another one comes.
    pub(super) fn serve(&mut self, job: Job, desk: &Desk, outbox: &Outbox) -> Result<()> {
        let mut args = job.options.args()?;
        args.settings()?;
        let mut stage = match self.latest.take() {
            Some((stage, ..)) => stage.followed(&job.options, &args)?,
            None => Stage::open(&job.options, &args)?,
        };
        let camera = stage.traced.camera(&stage.scene, &args)?;
        let center = args.size.map(|side| 0.5 * f64::from(side));
        let center_distance = stage.seen_at(&camera, args.size, center).map(|seen| f64::from(seen.t));
        let frame = Frame {
            number: job.number,
            picture: Picture::filled(1, 1, [0.0; 3]),
            size: args.size,
            n_samples: 0,
            is_settled: false,
            camera,
            integrator: Integrator::Hybrid,
            center_distance,
            is_animated: stage.is_animated,
        };
        let result = self.render(&mut stage, &job, &mut args, &frame, desk, outbox);
        self.latest = Some((stage, camera, args.size));
        result
    }

    fn render(
        &mut self,
        stage: &mut Stage,
        job: &Job,
        args: &mut Args,
        frame: &Frame,
        desk: &Desk,
        outbox: &Outbox,
    ) -> Result<()> {
        let key = job.options.film_key();
        let complete = self.complete.as_ref().filter(|(of, ..)| *of == key && args.heatmap.is_none());
        if let Some((_, film, integrator)) = complete {
            let (picture, n_samples) = (shown(film, args, &job.options), samples_of(film));
            outbox.send(Message::Frame(Frame {
                picture,
                n_samples,
                is_settled: true,
                integrator: *integrator,
                ..frame.clone()
            }));
            return Ok(());
        }
        if args.heatmap.is_some() {
            let picture = stage.with_surfaces(args.settings()?.lod, |surfaces, traced| {
                traced.heatmap(surfaces, &frame.camera, args)
            })?;
            outbox.send(Message::Frame(Frame { picture, is_settled: true, ..frame.clone() }));
            return Ok(());
        }
        if let Some(picture) = self.coarse(stage, args, &job.options, frame)? {
            outbox.send(Message::Frame(Frame { picture, ..frame.clone() }));
        }
        if desk.is_followed_within(if job.is_moving { REST } else { Duration::ZERO }) {
            return Ok(());
        }
        stage.choose(&frame.camera, args)?;
        let settings = settings(args, &job.options)?;
        let frame = Frame { integrator: settings.integrator, ..frame.clone() };
        let film = self.refine(stage, job, args, &settings, &frame, desk, outbox)?;
        let (picture, n_samples) = (shown(&film, args, &job.options), samples_of(&film));
        if let Some(warning) = render::dropped_samples(&film) {
            crate::output::warn(&warning);
        }
        self.complete = Some((key, film, settings.integrator));
        outbox.send(Message::Frame(Frame { picture, n_samples, is_settled: true, ..frame }));
        Ok(())
    }

    /// A picture of one sample in each of so few pixels that it takes no longer than [`COARSE_SECONDS`]; `None` where the first pass
    /// is as fast.
    fn coarse(&self, stage: &mut Stage, args: &Args, options: &Options, frame: &Frame) -> Result<Option<Picture>> {
        let mut args = args.clone();
        stage.choose_integrator(&mut args);
        let settings = settings(&args, options)?;
        let n_pixels = f64::from(args.size[0]) * f64::from(args.size[1]);
        // A machine that nothing is known of gets a small picture.
        let affordable = self.pace.map_or(1.0 / 16.0, |pace| COARSE_SECONDS / (pace * n_pixels));
        let Some(divisor) = [1, 2, 3, 4, 6, 8, 12, 16].into_iter().find(|d| affordable * f64::from(d * d) >= 1.0)
        else {
            return self.coarse_by(16, stage, settings, &args, options, frame).map(Some);
        };
        if divisor == 1 { Ok(None) } else { self.coarse_by(divisor, stage, settings, &args, options, frame).map(Some) }
    }

    fn coarse_by(
        &self,
        divisor: u32,
        stage: &mut Stage,
        settings: Settings,
        args: &Args,
        options: &Options,
        frame: &Frame,
    ) -> Result<Picture> {
        let [width, height] = args.size.map(|side| side.div_ceil(divisor));
        let settings = Settings { width, height, samples: 1, part: None, noise: None, ..settings };
        // Not cancelled: a moving camera must show something.
        let cancel = AtomicBool::new(false);
        let film = stage
            .with_surfaces(settings.lod, |surfaces, traced| traced.film(surfaces, &frame.camera, &settings, &cancel))?;
        Ok(shown(&film, args, options))
    }

    /// All samples, with a picture after each pass. The film has the bits of `canted render`.
    #[expect(clippy::too_many_arguments, reason = "the state of a job, and where it comes from and goes")]
    fn refine(
        &mut self,
        stage: &mut Stage,
        job: &Job,
        args: &Args,
        settings: &Settings,
        frame: &Frame,
        desk: &Desk,
        outbox: &Outbox,
    ) -> Result<Film> {
        let (mut joined, mut n_rays, mut n_done, mut n_next) = (None, 0, 0, 1);
        loop {
            let range = [n_done, n_done + n_next];
            // Adaptive sampling is not divided into passes.
            let part = settings.noise.is_none().then_some(range);
            let of_pass = Settings { part, ..*settings };
            let start = Instant::now();
            let film = stage.with_surfaces(settings.lod, |surfaces, traced| {
                traced.film(surfaces, &frame.camera, &of_pass, desk.cancel())
            });
            let film = match film {
                Err(error) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => {
                    // Clicks are answered, then the pass starts again.
                    let Some(clicks) = desk.clicks() else { return Err(error) };
                    answer(stage, frame, clicks, outbox);
                    continue;
                }
                film => film?,
            };
            if part.is_none() {
                return Ok(film);
            }
            let n_pixels = f64::from(settings.width) * f64::from(settings.height);
            self.pace = Some(start.elapsed().as_secs_f64() / (n_pixels * f64::from(n_next)));
            n_rays += film.n_rays();
            let parts = joined.take().into_iter().chain(film.part().cloned()).collect();
            let part = Part::join(parts).map_err(|error| anyhow!("{error}"))?;
            n_done = range[1];
            n_next = next_pass(n_done, settings.samples, Duration::ZERO, None);
            let film = whole_film(settings, part.clone(), n_rays)?;
            if n_next == 0 {
                return Ok(film);
            }
            let picture = shown(&film, args, &job.options);
            outbox.send(Message::Frame(Frame { picture, n_samples: n_done, ..frame.clone() }));
            joined = Some(part);
        }
    }

    /// Reports what is at positions of the latest picture.
    pub(super) fn answer(&self, clicks: Vec<[f64; 2]>, outbox: &Outbox) {
        for position in clicks {
            let seen = self.latest.as_ref().and_then(|(stage, camera, size)| stage.seen_at(camera, *size, position));
            outbox.send(Message::Seen(seen));
        }
    }
}

fn answer(stage: &Stage, frame: &Frame, clicks: Vec<[f64; 2]>, outbox: &Outbox) {
    for position in clicks {
        outbox.send(Message::Seen(stage.seen_at(&frame.camera, frame.size, position)));
    }
}

/// The settings of the film, with the channel that is shown.
fn settings(args: &Args, options: &Options) -> Result<Settings> {
    let aovs = options.aov.map_or(Aovs::NONE, |aov| Aovs::NONE.with(aov));
    Ok(Settings { aovs, ..args.settings()? })
}

/// The picture of a film: a channel, or light with exposure and tone curve.
fn shown(film: &Film, args: &Args, options: &Options) -> Picture {
    match options.aov {
        Some(aov) => channel::picture(film, aov),
        None => args.look.apply(film.picture()),
    }
}

/// Samples of each pixel, on average.
fn samples_of(film: &Film) -> u32 {
    let n_pixels = u64::from(film.width()) * u64::from(film.height());
    u32::try_from(film.n_samples() / n_pixels.max(1)).unwrap_or(u32::MAX)
}
