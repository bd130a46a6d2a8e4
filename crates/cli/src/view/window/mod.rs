//! The window: draws the latest picture and the controls, and turns input into events. It never waits for the session.
//!
//! ```text
//! input -> events -> Session::apply -> (thread) -> Frame -> texture
//! ```

mod panel;

use std::{
    fmt,
    path::Path,
    sync::{Arc, OnceLock, mpsc},
    time::{Duration, Instant},
};

use anyhow::{Result, anyhow};
use canted_film::{Format, write_picture};
use eframe::egui::{self, Color32, ColorImage, PointerButton, Rect, TextureHandle, TextureOptions, pos2, vec2};

use super::{
    events::{Button, Event, Key},
    frame::View,
    options::Options,
    session::{Effect, Session},
};
use crate::{load, options::Value, output};
use panel::{PANEL_WIDTH, Panel};

/// Opens the window, and returns when it is closed.
///
/// # Errors
/// There is no display or no OpenGL, or an option is invalid.
pub(super) fn run(mut options: Options) -> Result<()> {
    let start = Instant::now();
    let size = options.plan()?.size();
    // The picture of this size needs no other when the window is open.
    options.args.options.0.size = Some(Value(size));
    let [width, height] = size.map(|side| side as f32);
    let title = format!("{} - canted", load::name(options.scene()));
    let viewport = egui::ViewportBuilder::default()
        .with_inner_size([width + PANEL_WIDTH, height])
        .with_min_inner_size([PANEL_WIDTH + 64.0, 120.0])
        .with_title(title)
        .with_app_id("canted");
    let native = eframe::NativeOptions { viewport, ..eframe::NativeOptions::default() };
    // The scene is read while the window opens.
    let context: Arc<OnceLock<egui::Context>> = Arc::default();
    let of_thread = Arc::clone(&context);
    let wake = move || {
        if let Some(context) = of_thread.get() {
            context.request_repaint();
        }
    };
    let session = Session::start(options, Box::new(wake))?;
    let create: eframe::AppCreator = Box::new(move |creation| {
        let _ = context.set(creation.egui_ctx.clone());
        creation.egui_ctx.set_visuals(egui::Visuals::dark());
        // A message that came before the context was known woke nothing.
        creation.egui_ctx.request_repaint();
        Ok(Box::new(Window::new(session, start)))
    });
    eframe::run_native("canted", native, create).map_err(|error| anyhow!("cannot open a window: {error}"))
}

struct Window {
    session: Session,
    panel: Panel,
    texture: Option<TextureHandle>,
    /// What the texture shows.
    shown: Option<Shown>,
    /// The answer to the last action.
    note: String,
    /// Answers of screenshots, which other threads write.
    saved: (mpsc::Sender<String>, mpsc::Receiver<String>),
    timing: Timing,
}

/// A picture in the texture.
#[derive(Clone, Copy, PartialEq)]
struct Shown {
    job: u64,
    n_samples: u32,
    is_settled: bool,
    /// The size of the whole picture, of which the texture may be a coarse version.
    size: [u32; 2],
}

impl eframe::App for Window {
    fn update(&mut self, context: &egui::Context, frame: &mut eframe::Frame) {
        self.timing.begin(frame.info().cpu_usage);
        self.session.poll();
        self.upload(context);
        let mut events = Vec::new();
        if let Ok(note) = self.saved.1.try_recv() {
            output::note(&note);
            self.note = note;
        }
        if let Some(reason) = &self.session.failure {
            self.note.clone_from(reason);
        }
        let mut options = self.session.options().clone();
        self.panel.show(context, &self.session, &self.note, &mut options, &mut events);
        if options != *self.session.options() {
            self.note = self.session.take(options).map_or_else(|error| error.to_string(), |()| String::new());
        }
        let central = egui::CentralPanel::default().frame(egui::Frame::NONE.fill(Color32::from_gray(24)));
        central.show(context, |ui| self.picture(ui, &mut events));
        if !context.wants_keyboard_input() {
            events.extend(pressed(context));
        }
        for event in events {
            self.apply(&event, context);
        }
        self.timing.end();
    }

    fn on_exit(&mut self, _: Option<&eframe::glow::Context>) {
        output::detail(|| self.timing.to_string());
    }
}

impl Window {
    fn new(session: Session, start: Instant) -> Self {
        Self {
            session,
            panel: Panel::default(),
            texture: None,
            shown: None,
            note: String::new(),
            saved: mpsc::channel(),
            timing: Timing::new(start),
        }
    }

    fn apply(&mut self, event: &Event, context: &egui::Context) {
        match self.session.apply(event) {
            Ok(Effect::None) => self.note.clear(),
            Ok(Effect::Close) => context.send_viewport_cmd(egui::ViewportCommand::Close),
            Ok(Effect::Copy(command)) => {
                // A terminal keeps it where there is no clipboard.
                let _ = output::to_stdout(&command);
                context.copy_text(command);
                "Copied the command to the clipboard.".clone_into(&mut self.note);
            }
            Ok(Effect::Screenshot) => self.save(context),
            Err(error) => self.note = error.to_string(),
        }
    }

    /// Writes the picture as `canted render` does, on a thread of its own: large pictures take longer than a frame of the window.
    fn save(&mut self, context: &egui::Context) {
        let Some(frame) = &self.session.frame else {
            "There is no picture yet.".clone_into(&mut self.note);
            return;
        };
        let (picture, context, sender) = (frame.picture.clone(), context.clone(), self.saved.0.clone());
        "Saving ...".clone_into(&mut self.note);
        std::thread::spawn(move || {
            let path = new_screenshot(Path::new("."));
            let saved = write_picture(&path, &picture, None, Format::Png);
            let note = saved.map_or_else(|error| error.to_string(), |()| format!("Saved {}", path.display()));
            let _ = sender.send(note);
            context.request_repaint();
        });
    }

    /// Brings the latest picture into the texture.
    fn upload(&mut self, context: &egui::Context) {
        let Some(frame) = &self.session.frame else { return };
        let shown = Shown {
            job: frame.view.number,
            n_samples: frame.n_samples,
            is_settled: frame.is_settled,
            size: frame.view.size,
        };
        if self.shown == Some(shown) {
            return;
        }
        let size = [frame.picture.width, frame.picture.height];
        let image = ColorImage::from_rgb(size.map(|side| side as usize), &frame.bytes);
        // A whole picture has a pixel of the screen for each of its own.
        let options = if size == frame.view.size { TextureOptions::NEAREST } else { TextureOptions::LINEAR };
        match &mut self.texture {
            Some(texture) => texture.set(image, options),
            None => self.texture = Some(context.load_texture("picture", image, options)),
        }
        self.timing.show(&frame.view);
        self.shown = Some(shown);
    }

    /// The picture, and the input on it.
    fn picture(&mut self, ui: &mut egui::Ui, events: &mut Vec<Event>) {
        let area = ui.max_rect();
        let scale = ui.ctx().pixels_per_point();
        let response = ui.interact(area, ui.id().with("picture"), egui::Sense::click_and_drag());
        if let (Some(texture), Some(shown)) = (&self.texture, self.shown) {
            let rect = fitted(area, shown.size, scale);
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().image(texture.id(), rect, whole, Color32::WHITE);
            on_picture(ui, &response, rect, shown.size, events);
        } else if self.session.failure.is_none() {
            ui.painter().text(
                area.center(),
                egui::Align2::CENTER_CENTER,
                format!("Reading {} ...", load::name(self.session.options().scene())),
                egui::FontId::proportional(16.0),
                Color32::from_gray(180),
            );
        }
        if let Some(size) = wanted_size(area, scale, self.session.options().args.options.0.size.map(|size| size.0)) {
            events.push(Event::Resize(size));
        }
    }
}

/// Where a picture is drawn: in its own size where that is the area's, else scaled to fit, with its aspect.
fn fitted(area: Rect, size: [u32; 2], scale: f32) -> Rect {
    let own = vec2(size[0] as f32, size[1] as f32) / scale;
    if (own - area.size()).abs().max_elem() * scale < 1.0 {
        return Rect::from_min_size(area.min, own);
    }
    let factor = (area.width() / own.x).min(area.height() / own.y);
    Rect::from_center_size(area.center(), own * factor)
}

/// The first name of a screenshot in a folder that no file has.
fn new_screenshot(folder: &Path) -> std::path::PathBuf {
    let name = |i: u32| folder.join(format!("canted_{i:03}.png"));
    (1..).map(name).find(|path| !path.exists()).unwrap_or_else(|| name(0))
}

/// Points that a notch of the wheel scrolls.
const NOTCH: f32 = 50.0;

/// The events on a picture of this size that is drawn in `rect`.
fn on_picture(ui: &egui::Ui, response: &egui::Response, rect: Rect, size: [u32; 2], events: &mut Vec<Event>) {
    // Pixels of the picture for a point of the screen.
    let scale = f64::from(size[1]) / f64::from(rect.height().max(1.0));
    let at = |p: egui::Pos2| [p.x - rect.min.x, p.y - rect.min.y].map(|x| f64::from(x) * scale);
    if let Some(to) = response.interact_pointer_pos() {
        let from = to - response.drag_delta();
        let button = if response.dragged_by(PointerButton::Primary) { Button::Left } else { Button::Right };
        if response.dragged() && from != to {
            events.push(Event::Drag { from: at(from), to: at(to), button });
        }
        if response.clicked() && rect.contains(to) {
            let limits = size.map(|side| f64::from(side).next_down());
            let [x, y] = at(to);
            events.push(Event::Click([x.clamp(0.0, limits[0]), y.clamp(0.0, limits[1])]));
        }
        if response.clicked() || response.dragged() {
            // Keys go to the picture again.
            ui.memory_mut(|memory| memory.focused().into_iter().for_each(|id| memory.surrender_focus(id)));
        }
    }
    let wheel = ui.input(|input| input.smooth_scroll_delta.y);
    if response.hovered() && wheel != 0.0 {
        events.push(Event::Scroll(f64::from(wheel / NOTCH)));
    }
}

/// The size of the picture that fills an area, unless it is `size`. None for a window without pixels, such as a minimized one.
fn wanted_size(area: Rect, scale: f32, size: Option<[u32; 2]>) -> Option<[u32; 2]> {
    const LEAST: u32 = 8;
    let pixels = [area.width(), area.height()].map(|side| (side * scale).round() as u32);
    let is_known = size == Some(pixels);
    (pixels.iter().all(|&side| side >= LEAST) && !is_known).then_some(pixels)
}

/// The keys with functions that were pressed since the last frame.
fn pressed(context: &egui::Context) -> Vec<Event> {
    let key = |event: &egui::Event| match event {
        egui::Event::Text(text) => Key::named(text),
        egui::Event::Key { key, pressed: true, .. } => match key {
            egui::Key::ArrowLeft => Key::named("left"),
            egui::Key::ArrowRight => Key::named("right"),
            egui::Key::ArrowUp => Key::named("up"),
            egui::Key::ArrowDown => Key::named("down"),
            egui::Key::Home => Some(Key::Home),
            egui::Key::Escape => Some(Key::Close),
            _ => None,
        },
        _ => None,
    };
    context.input(|input| input.events.iter().filter_map(key).map(Event::Key).collect())
}

/// Pictures further apart than this are not of one motion.
const MOTION: Duration = Duration::from_millis(500);

/// What input may wait for.
const LIMIT: Duration = Duration::from_millis(50);

/// Times of a window.
struct Timing {
    start: Instant,
    begun: Instant,
    n_updates: u32,
    /// The longest that the thread of the window worked on one frame: input, layout and drawing.
    longest: Duration,
    /// Frames that took longer than [`LIMIT`].
    n_long: u32,
    /// The time of the last frame without its drawing.
    last: Duration,
    /// From the start, and from the moment when the scene was ready, to the first picture.
    first: Option<[Duration; 2]>,
    /// When the last picture of a moving camera was shown.
    moved: Option<Instant>,
    n_moving: u32,
    moving: Duration,
}

impl Timing {
    fn new(start: Instant) -> Self {
        Self {
            start,
            begun: start,
            n_updates: 0,
            longest: Duration::ZERO,
            n_long: 0,
            last: Duration::ZERO,
            first: None,
            moved: None,
            n_moving: 0,
            moving: Duration::ZERO,
        }
    }

    /// A frame of the window begins; `drawn_s` is the time of the last one with its drawing, but without the wait for the screen.
    fn begin(&mut self, drawn_s: Option<f32>) {
        self.begun = Instant::now();
        self.n_updates += 1;
        // The first frame also makes fonts and textures.
        if self.n_updates > 2 {
            let drawn = drawn_s.filter(|seconds| *seconds > 0.0).map_or(Duration::ZERO, Duration::from_secs_f32);
            let whole = self.last.max(drawn);
            self.longest = self.longest.max(whole);
            self.n_long += u32::from(whole > LIMIT);
        }
    }

    /// A frame of the window ends, but for its drawing.
    fn end(&mut self) {
        self.last = self.begun.elapsed();
    }

    /// A picture is shown.
    fn show(&mut self, view: &View) {
        let now = Instant::now();
        self.first.get_or_insert_with(|| [now - self.start, now.saturating_duration_since(view.ready)]);
        if view.is_moving {
            if let Some(since) = self.moved.map(|moved| now - moved).filter(|since| *since < MOTION) {
                self.n_moving += 1;
                self.moving += since;
            }
            self.moved = Some(now);
        }
    }
}

impl fmt::Display for Timing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |time: Duration| 1000.0 * time.as_secs_f64();
        let Self { n_updates, n_long, longest, .. } = self;
        write!(
            f,
            "window: {n_updates} frames, the longest {:.1} ms, {n_long} over {} ms",
            ms(*longest),
            LIMIT.as_millis()
        )?;
        if let Some([start, ready]) = self.first {
            write!(f, "; first picture {:.0} ms after the start, {:.0} ms after reading", ms(start), ms(ready))?;
        }
        if self.n_moving > 0 {
            let rate = f64::from(self.n_moving) / self.moving.as_secs_f64();
            write!(f, "; {rate:.1} pictures per second while moving")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use canted_renderer::Integrator;
    use canted_scene::Camera;

    use super::*;

    #[test]
    fn counts_pictures_of_motions_only() {
        let mut timing = Timing::new(Instant::now());
        let view = |is_moving| View {
            number: 1,
            size: [8, 8],
            n_samples: 1,
            is_moving,
            camera: Camera::pinhole([0.0; 3], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], 40.0),
            is_file_camera: false,
            integrator: Integrator::Hybrid,
            device: "cpu".to_owned(),
            center_distance: None,
            time_range: None,
            n_levels: 1,
            ready: Instant::now(),
        };
        timing.begin(None);
        timing.end();
        timing.show(&view(false));
        assert!(!timing.to_string().contains("moving"));
        for _ in 0..3 {
            timing.show(&view(true));
        }
        let text = timing.to_string();
        assert!(
            text.starts_with("window: 1 frames") && text.contains("first picture") && timing.n_moving == 2,
            "{text}"
        );
    }
}
