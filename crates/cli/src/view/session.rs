//! A session: a scene, the options of its picture, and a thread that renders. It has no window.
//!
//! ```text
//! Event -> Session (options, camera) -> job -> thread -> Frame
//! ```

use std::{
    sync::{
        Arc,
        mpsc::{self, Receiver},
    },
    time::Duration,
};

use anyhow::{Result, anyhow};
use canted_film::Aov;
use canted_lbvh::Strategy;
use canted_renderer::{BoxLevel, BvhKind, Integrator, Measure};
use canted_scene::Camera;

use super::{
    events::{Button, Event, Key},
    frame::{Frame, FrameSender, Job, JobQueue, Message, Seen},
    motion::{self, Motion},
    options::Options,
    passes,
};
use crate::{
    options::{Text as _, Value},
    output,
};

/// A structure to compare: `--accel` and `--volumes`.
pub(super) type StructureKind = (BvhKind, Option<Strategy>);

/// All structures to compare.
pub(super) fn structures() -> Vec<StructureKind> {
    let of_kind = |kind| match kind {
        BvhKind::Bvh2 => Strategy::ALL.map(|volumes| (kind, Some(volumes))).to_vec(),
        _ => vec![(kind, None)],
    };
    BvhKind::ALL.into_iter().flat_map(of_kind).collect()
}

/// What the caller of [`Session::apply`] does after an event.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    None,
    /// Put this command line into the clipboard.
    Copy(String),
    /// Save the picture.
    Screenshot,
    Close,
}

/// A scene that is looked at.
pub(crate) struct Session {
    options: Options,
    /// The options at the start, with their camera.
    start: Options,
    worker: Worker,
    n_jobs: u64,
    /// The camera of the latest job, once it is known.
    camera: Option<Camera>,
    /// Whether the camera comes from a file, whose target may be anywhere along its axis.
    has_file_target: bool,
    pub(crate) frame: Option<Frame>,
    /// The answer to the last click.
    pub(crate) seen: Option<Seen>,
    /// Whether there was a click and its answer.
    pub(crate) is_answered: bool,
    n_clicks: usize,
    /// Why the latest job has no picture.
    pub(crate) failure: Option<String>,
    /// All warnings and notes.
    pub(crate) warnings: Vec<String>,
}

impl Session {
    /// Starts to read and render. `wake` is called from another thread when there is something new.
    ///
    /// # Errors
    /// One sentence about an invalid option.
    pub(super) fn start(options: Options, wake: Box<dyn Fn() + Send>) -> Result<Self> {
        let has_file_target = options.has_file_camera();
        let mut session = Self {
            start: options.clone(),
            options,
            worker: Worker::start(wake),
            n_jobs: 0,
            camera: None,
            has_file_target,
            frame: None,
            seen: None,
            is_answered: false,
            n_clicks: 0,
            failure: None,
            warnings: Vec::new(),
        };
        session.render(false);
        Ok(session)
    }

    #[cfg(feature = "view")]
    pub(crate) fn options(&self) -> &Options {
        &self.options
    }

    /// The command line that renders the picture, on the device that rendered it.
    pub(crate) fn command(&self) -> String {
        let current = self.frame.as_ref().filter(|frame| frame.view.number == self.n_jobs);
        let device = current.map(|frame| frame.view.device.clone());
        self.options.command(&device.unwrap_or_else(|| self.options.device().text()))
    }

    /// Whether the picture of the latest options is complete, and clicks are answered.
    pub(crate) fn is_settled(&self) -> bool {
        let is_shown = |frame: &Frame| frame.view.number == self.n_jobs && frame.is_settled;
        self.n_clicks == 0 && (self.failure.is_some() || self.frame.as_ref().is_some_and(is_shown))
    }

    /// Takes what the thread has sent.
    #[cfg(feature = "view")]
    pub(crate) fn poll(&mut self) {
        while let Ok(message) = self.worker.messages.try_recv() {
            self.receive(message);
        }
    }

    /// Waits until the picture is settled.
    ///
    /// # Errors
    /// Why there is no picture.
    pub(super) fn settle(&mut self) -> Result<()> {
        self.wait(Self::is_settled)
    }

    /// Waits until the camera is known.
    ///
    /// # Errors
    /// Why there is no picture.
    pub(super) fn ready(&mut self) -> Result<()> {
        self.wait(|session| session.camera.is_some() || session.failure.is_some())
    }

    fn wait(&mut self, is_over: impl Fn(&Self) -> bool) -> Result<()> {
        while !is_over(self) {
            let message = self.worker.messages.recv();
            self.receive(message.map_err(|_| anyhow!("the thread that renders has stopped"))?);
        }
        self.failure.take().map_or(Ok(()), |reason| Err(anyhow!("{reason}")))
    }

    fn receive(&mut self, message: Message) {
        match message {
            // A picture of an earlier job would show a camera of the past.
            Message::Frame(frame) => {
                if frame.view.number == self.n_jobs {
                    self.camera = Some(frame.view.camera);
                }
                self.frame = Some(frame);
            }
            Message::Seen(seen) => {
                self.n_clicks = self.n_clicks.saturating_sub(1);
                self.seen = seen;
                self.is_answered = true;
            }
            Message::Failed { number, reason } if number == self.n_jobs => self.failure = Some(reason),
            Message::Failed { .. } => {}
            Message::Warnings(warnings) => {
                warnings.iter().for_each(|warning| output::warn(warning));
                self.warnings.extend(warnings);
            }
        }
    }

    /// Changes the session. Returns at once; pictures follow.
    ///
    /// # Errors
    /// One sentence: an invalid option or position. The session stays as it is.
    pub(crate) fn apply(&mut self, event: &Event) -> Result<Effect> {
        match event {
            &Event::Drag { from, to, button } => {
                let by = [to[0] - from[0], to[1] - from[1]];
                self.turn(match button {
                    Button::Left => Motion::Orbit(by),
                    Button::Right => Motion::Pan(by),
                })?;
            }
            &Event::Scroll(notches) => self.turn(Motion::Zoom(notches))?,
            &Event::Key(key) => return self.press(key),
            &Event::Click(position) => {
                let [width, height] = self.options.plan()?.size();
                let is_inside = |x: f64, side: u32| x >= 0.0 && x < f64::from(side);
                let [x, y] = position;
                if !is_inside(x, width) || !is_inside(y, height) {
                    return Err(anyhow!("click [{x}, {y}] is outside the picture of {width} x {height} pixels"));
                }
                self.n_clicks += 1;
                self.worker.click(position);
            }
            &Event::Resize(size) => self.set(|options| options.args.options.0.size = Some(Value(size)))?,
            Event::Set(changes) => self.change(|options| options.set_all(changes))?,
            Event::Close => return Ok(Effect::Close),
        }
        Ok(Effect::None)
    }

    /// Takes over options that were changed.
    ///
    /// # Errors
    /// One sentence: options that contradict each other. The session stays as it is.
    #[cfg(feature = "view")]
    pub(crate) fn take(&mut self, options: Options) -> Result<()> {
        self.set(|own| *own = options)
    }

    fn change(&mut self, change: impl FnOnce(&mut Options) -> Result<()>) -> Result<()> {
        let mut changed = self.options.clone();
        change(&mut changed)?;
        changed.check()?;
        let is_time = changed.has_other_time_than(&self.options);
        // A view that frames the scene would move with each pose.
        let framed = self.frame.as_ref().filter(|frame| is_time && !frame.view.is_file_camera);
        if let Some(camera) = self.camera.filter(|_| framed.is_some()) {
            changed.set_camera(&camera);
        } else if !changed.has_camera_of(&self.options) {
            self.camera = None;
        }
        self.options = changed;
        self.render(is_time);
        Ok(())
    }

    fn press(&mut self, key: Key) -> Result<Effect> {
        /// Pixels of a step that orbits, for a picture of this height.
        const STEP: f64 = 5.0 / 180.0;
        match key {
            Key::Fly(signs) => self.turn(Motion::Fly(signs.map(f64::from)))?,
            Key::Orbit([x, y]) => {
                let rows = f64::from(self.options.plan()?.size()[1]);
                self.turn(Motion::Orbit([-f64::from(x), f64::from(y)].map(|sign| sign * STEP * rows)))?;
            }
            Key::Zoom(sign) => self.turn(Motion::Zoom(f64::from(sign)))?,
            Key::Home => {
                self.options.reset_camera(&self.start);
                self.has_file_target = self.start.has_file_camera();
                self.camera = None;
                self.render(false);
            }
            Key::NextHeatmap => {
                let next = match self.options.measure() {
                    None => Some(Measure::Boxes),
                    Some(Measure::Boxes) => Some(Measure::Triangles),
                    Some(Measure::Triangles) => None,
                };
                self.set(|options| options.diagram().heatmap = next.map(Value))?;
            }
            Key::NextIntegrator => {
                let is_path = self.frame.as_ref().is_some_and(|frame| frame.view.integrator == Integrator::Path);
                let next = if is_path { Integrator::Hybrid } else { Integrator::Path };
                self.set(|options| options.args.options.0.rendering.integrator = Some(Value(next)))?;
            }
            Key::NextChannel => {
                let integrator = self.frame.as_ref().map_or(Integrator::Hybrid, |frame| frame.view.integrator);
                let of_integrator = integrator.aovs();
                let (all, now) = (Aov::ALL.iter().filter(|&&aov| of_integrator.contains(aov)), self.options.aov);
                let next = all.skip_while(|aov| now.is_some_and(|now| now != **aov)).nth(now.is_some().into());
                self.set(|options| options.aov = next.copied())?;
            }
            Key::NextStructure => {
                let all = structures();
                let number = all.iter().position(|kind| *kind == self.structure()).map_or(0, |i| (i + 1) % all.len());
                self.set(|options| options.args.structure.0.set_kind(all[number]))?;
            }
            Key::NextBoxes => {
                let n_levels = self.frame.as_ref().map_or(0, |frame| frame.view.n_levels);
                let next = match self.options.boxes() {
                    None => Some(BoxLevel::Level(0)),
                    Some(BoxLevel::Leaves) => None,
                    Some(BoxLevel::Level(level)) if level + 1 < n_levels => Some(BoxLevel::Level(level + 1)),
                    Some(BoxLevel::Level(_)) => Some(BoxLevel::Leaves),
                };
                self.set(|options| options.diagram().boxes = next.map(Value))?;
            }
            Key::Screenshot => return Ok(Effect::Screenshot),
            Key::Copy => return Ok(Effect::Copy(self.command())),
            Key::Close => return Ok(Effect::Close),
        }
        Ok(Effect::None)
    }

    /// The structure that is traced.
    pub(crate) fn structure(&self) -> StructureKind {
        match self.options.structure_key().kind() {
            (BvhKind::Bvh2, volumes) => (BvhKind::Bvh2, Some(volumes.unwrap_or_default())),
            other => other,
        }
    }

    fn set(&mut self, set: impl FnOnce(&mut Options)) -> Result<()> {
        self.change(|options| {
            set(options);
            Ok(())
        })
    }

    /// Moves the camera; nothing happens before the first picture, or where no valid camera results.
    fn turn(&mut self, motion: Motion) -> Result<()> {
        let Some(mut camera) = self.camera else { return Ok(()) };
        let plan = self.options.plan()?;
        if std::mem::take(&mut self.has_file_target)
            && let Some(distance) = self.frame.as_ref().and_then(|frame| frame.view.center_distance)
        {
            camera = motion::with_target_at(&camera, distance);
        }
        if let Some(moved) = motion::moved(&camera, plan.up(), motion, plan.size()[1]) {
            self.camera = Some(moved);
            self.options.set_camera(&moved);
            self.render(true);
        }
        Ok(())
    }

    /// Starts the picture of the options.
    fn render(&mut self, is_moving: bool) {
        self.n_jobs += 1;
        self.failure = None;
        self.worker.render(Job { number: self.n_jobs, options: self.options.clone(), is_moving });
    }
}

/// The thread and the ends of its channels.
struct Worker {
    queue: Arc<JobQueue>,
    messages: Receiver<Message>,
    /// Disconnected once the thread has ended.
    ended: Receiver<()>,
}

/// How long a session that closes waits for its thread. One that still reads a file or builds a structure ends with the program.
const LONGEST_END: Duration = Duration::from_millis(300);

impl Worker {
    /// Starts the thread, which calls `wake` after each message.
    fn start(wake: Box<dyn Fn() + Send>) -> Self {
        let (sender, messages) = mpsc::channel();
        let (alive, ended) = mpsc::channel();
        let queue = Arc::new(JobQueue::default());
        let of_thread = Arc::clone(&queue);
        std::thread::spawn(move || {
            let _alive = alive;
            passes::serve(&of_thread, &FrameSender { sender, wake });
        });
        Self { queue, messages, ended }
    }

    /// Replaces the job that waits, and cancels the one that runs.
    fn render(&self, job: Job) {
        self.queue.post(|pending| pending.job = Some(job));
    }

    /// Asks what is at a position in pixels of the latest picture.
    fn click(&self, position: [f64; 2]) {
        self.queue.post(|pending| pending.clicks.push(position));
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.queue.post(|pending| pending.is_closed = true);
        let _ = self.ended.recv_timeout(LONGEST_END);
    }
}
