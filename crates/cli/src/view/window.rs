//! The window: draws the latest picture and the controls, and turns input into events. It never waits for the session.
//!
//! ```text
//! input -> events -> Session::apply -> (thread) -> Frame -> texture
//! ```

mod input;
mod panel;
mod timing;

use std::{
    path::Path,
    sync::{Arc, OnceLock, mpsc},
    time::Instant,
};

use anyhow::{Result, anyhow};
use canted_film::{Format, write_picture};
use eframe::egui::{self, Color32, ColorImage, Rect, TextureHandle, TextureOptions, pos2, vec2};

use super::{
    events::Event,
    options::Options,
    replay,
    session::{Effect, Session},
};
use crate::{load, output};
use panel::{PANEL_WIDTH, Panel};
use timing::Timing;

/// Opens the window, and returns when it is closed.
///
/// # Errors
/// There is no display or no OpenGL, or an option is invalid.
pub(super) fn run(mut options: Options) -> Result<()> {
    let start = Instant::now();
    #[expect(clippy::cast_precision_loss, reason = "pixels of a screen")]
    let [width, height] = options.args()?.size.map(|side| side as f32);
    // The picture of this size needs no other when the window is open.
    options.set("size", &format!("{width}x{height}"));
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
        self.panel.show(context, &self.session, &self.note, &mut events);
        let central = egui::CentralPanel::default().frame(egui::Frame::NONE.fill(Color32::from_gray(24)));
        central.show(context, |ui| self.picture(ui, &mut events));
        if !context.wants_keyboard_input() {
            events.extend(input::pressed(context));
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
            let path = replay::new_screenshot(Path::new("."));
            let saved = write_picture(&path, &picture, Format::Png);
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
            input::on_picture(ui, &response, rect, shown.size, events);
        } else if self.session.failure.is_none() {
            ui.painter().text(
                area.center(),
                egui::Align2::CENTER_CENTER,
                format!("Reading {} ...", load::name(self.session.options().scene())),
                egui::FontId::proportional(16.0),
                Color32::from_gray(180),
            );
        }
        if let Some(size) = input::wanted_size(area, scale, self.session.options().get("size")) {
            events.push(Event::Resize(size));
        }
    }
}

/// Where a picture is drawn: in its own size where that is the area's, else scaled to fit, with its aspect.
#[expect(clippy::cast_precision_loss, reason = "pixels of a screen")]
fn fitted(area: Rect, size: [u32; 2], scale: f32) -> Rect {
    let own = vec2(size[0] as f32, size[1] as f32) / scale;
    if (own - area.size()).abs().max_elem() * scale < 1.0 {
        return Rect::from_min_size(area.min, own);
    }
    let factor = (area.width() / own.x).min(area.height() / own.y);
    Rect::from_center_size(area.center(), own * factor)
}
