//! The window: draws the latest picture and the controls, and turns input into events. It never waits for the session.

use std::path::Path;

use anyhow::{Result, anyhow};
use canted_film::{Aov, srgb};
use eframe::egui::{self, Color32, ColorImage, PointerButton, Rect, TextureHandle, TextureOptions, pos2};

use super::{
    events::{Button, Event, Key},
    options::Options,
    replay,
    session::{Effect, STRUCTURES, Session},
};
use crate::output;

/// Points of a notch of the wheel.
const NOTCH: f32 = 50.0;

/// Opens the window, and returns when it is closed.
///
/// # Errors
/// There is no display or no OpenGL, or an option is invalid.
pub(super) fn run(options: Options) -> Result<()> {
    #[expect(clippy::cast_precision_loss, reason = "pixels of a screen")]
    let size = options.args()?.size.map(|side| side as f32);
    let title = options.scene().map_or("canted".to_owned(), |path| format!("{} - canted", path.display()));
    let viewport = egui::ViewportBuilder::default().with_inner_size(size).with_title(title);
    let native = eframe::NativeOptions { viewport, ..eframe::NativeOptions::default() };
    let create: eframe::AppCreator = Box::new(|context| {
        let of_thread = context.egui_ctx.clone();
        let session = Session::start(options, Box::new(move || of_thread.request_repaint()))?;
        Ok(Box::new(Window { session, texture: None, shown: None, note: String::new() }))
    });
    eframe::run_native("canted", native, create).map_err(|error| anyhow!("cannot open a window: {error}"))
}

struct Window {
    session: Session,
    texture: Option<TextureHandle>,
    /// Job and samples of the picture in the texture.
    shown: Option<(u64, u32, bool)>,
    /// The answer to the last action.
    note: String,
}

impl eframe::App for Window {
    fn update(&mut self, context: &egui::Context, _: &mut eframe::Frame) {
        self.session.poll();
        self.upload(context);
        let mut events = Vec::new();
        egui::Window::new("view")
            .default_pos([8.0, 8.0])
            .resizable(false)
            .show(context, |ui| self.controls(ui, &mut events));
        let panel = egui::CentralPanel::default().frame(egui::Frame::NONE);
        panel.show(context, |ui| self.picture(ui, &mut events));
        if !context.wants_keyboard_input() {
            events.extend(pressed(context).into_iter().map(Event::Key));
        }
        for event in events {
            self.apply(&event, context);
        }
        if let Some(reason) = &self.session.failure {
            self.note.clone_from(reason);
        }
    }
}

impl Window {
    fn apply(&mut self, event: &Event, context: &egui::Context) {
        match self.session.apply(event) {
            Ok(Effect::None) => {}
            Ok(Effect::Close) => context.send_viewport_cmd(egui::ViewportCommand::Close),
            Ok(Effect::Copy(command)) => {
                // A terminal keeps it where there is no clipboard.
                let _ = output::to_stdout(&command);
                context.copy_text(command);
                "copied the command".clone_into(&mut self.note);
            }
            Ok(Effect::Screenshot) => {
                let path = replay::new_screenshot(Path::new("."));
                let saved = replay::save(&self.session, &path).map(|()| format!("saved {}", path.display()));
                self.note = saved.unwrap_or_else(|error| error.to_string());
                output::note(&self.note);
            }
            Err(error) => self.note = error.to_string(),
        }
    }

    /// Brings the latest picture into the texture.
    fn upload(&mut self, context: &egui::Context) {
        let Some(frame) = &self.session.frame else { return };
        let state = (frame.number, frame.n_samples, frame.is_settled);
        if self.shown == Some(state) {
            return;
        }
        let size = [frame.picture.width as usize, frame.picture.height as usize];
        let bytes: Vec<u8> = frame.picture.pixels.iter().flatten().map(|&x| srgb::encode(x)).collect();
        let image = ColorImage::from_rgb(size, &bytes);
        match &mut self.texture {
            Some(texture) => texture.set(image, TextureOptions::NEAREST),
            None => self.texture = Some(context.load_texture("picture", image, TextureOptions::NEAREST)),
        }
        self.shown = Some(state);
    }

    /// The picture over the whole window, and the input on it.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels of a window")]
    fn picture(&mut self, ui: &mut egui::Ui, events: &mut Vec<Event>) {
        let rect = ui.max_rect();
        let scale = ui.ctx().pixels_per_point();
        let response = ui.interact(rect, ui.id().with("picture"), egui::Sense::click_and_drag());
        if let Some(texture) = &self.texture {
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().image(texture.id(), rect, whole, Color32::WHITE);
        }
        let at = |p: egui::Pos2| [p.x - rect.min.x, p.y - rect.min.y].map(|x| f64::from(x * scale));
        if let Some(to) = response.interact_pointer_pos() {
            let from = to - response.drag_delta();
            let button = if response.dragged_by(PointerButton::Primary) { Button::Left } else { Button::Right };
            if response.dragged() && from != to {
                events.push(Event::Drag { from: at(from), to: at(to), button });
            }
            if response.clicked() {
                events.push(Event::Click(at(to)));
            }
        }
        let wheel = ui.input(|input| input.smooth_scroll_delta.y);
        if response.hovered() && wheel != 0.0 {
            events.push(Event::Scroll(f64::from(wheel / NOTCH)));
        }
        // A minimized window has no pixels.
        let pixels = [rect.width(), rect.height()].map(|side| (side * scale).round() as u32);
        let wanted = format!("{}x{}", pixels[0], pixels[1]);
        let is_known = self.session.options().get("size") == Some(&wanted[..]);
        if pixels.iter().all(|&side| side >= 8) && !is_known {
            events.push(Event::Resize(pixels));
        }
    }

    fn controls(&mut self, ui: &mut egui::Ui, events: &mut Vec<Event>) {
        let mut set = |name: &str, value: String| events.push(Event::Set(vec![(name.to_owned(), value)]));
        let options = self.session.options();
        let text = |(accel, volumes): (&str, &str)| format!("{accel} {volumes}");
        let mut structure = self.session.structure();
        let before = structure;
        egui::ComboBox::from_label("structure").selected_text(text(STRUCTURES[structure])).show_ui(ui, |ui| {
            for (i, names) in STRUCTURES.into_iter().enumerate() {
                ui.selectable_value(&mut structure, i, text(names));
            }
        });
        let channel = options.aov.map_or("none", Aov::name);
        egui::ComboBox::from_label("channel").selected_text(channel).show_ui(ui, |ui| {
            for name in ["none"].into_iter().chain(Aov::ALL.map(Aov::name)) {
                if ui.selectable_label(name == channel, name).clicked() {
                    set("aov", name.to_owned());
                }
            }
        });
        choice(
            ui,
            "heat map",
            options.get("heatmap").unwrap_or("none"),
            &["none", "boxes", "triangles"],
            &mut |name| {
                set("heatmap", name.to_owned());
            },
        );
        let integrator = self.session.frame.as_ref().map(|frame| format!("{:?}", frame.integrator).to_lowercase());
        choice(ui, "integrator", &integrator.unwrap_or_default(), &["hybrid", "path"], &mut |name| {
            set("integrator", name.to_owned());
        });
        let curves = ["none", "agx", "aces", "filmic-neutral"];
        choice(ui, "tone curve", options.get("tone_map").unwrap_or("none"), &curves, &mut |name| {
            set("tone_map", name.to_owned());
        });
        let mut stops: f32 = options.get("exposure").and_then(|text| text.parse().ok()).unwrap_or(0.0);
        if ui.add(egui::Slider::new(&mut stops, -8.0..=8.0).text("exposure")).changed() {
            set("exposure", stops.to_string());
        }
        if self.session.frame.as_ref().is_some_and(|frame| frame.is_animated) {
            let mut time: f32 = options.get("time").and_then(|text| text.parse().ok()).unwrap_or(0.0);
            if ui.add(egui::Slider::new(&mut time, 0.0..=10.0).text("time in s")).changed() {
                set("time", time.to_string());
            }
        }
        ui.horizontal(|ui| {
            for (label, key) in
                [("screenshot", Key::Screenshot), ("copy as command", Key::Copy), ("first view", Key::Home)]
            {
                if ui.button(label).clicked() {
                    events.push(Event::Key(key));
                }
            }
        });
        if let Some(frame) = &self.session.frame {
            let state = if self.session.is_settled() { "done" } else { "rendering" };
            ui.label(format!("{} x {}, {} samples, {state}", frame.size[0], frame.size[1], frame.n_samples));
        }
        if self.session.seen.is_some() {
            ui.label(replay::described(self.session.seen.as_ref()));
        }
        ui.label(&self.note);
        if structure != before
            && let Err(error) = self.session.set_structure(structure)
        {
            self.note = error.to_string();
        }
    }
}

/// A list of names to choose from.
fn choice(ui: &mut egui::Ui, label: &str, now: &str, names: &[&str], set: &mut dyn FnMut(&str)) {
    egui::ComboBox::from_label(label).selected_text(now).show_ui(ui, |ui| {
        for name in names {
            if ui.selectable_label(*name == now, *name).clicked() {
                set(name);
            }
        }
    });
}

/// The keys with functions that were pressed since the last frame.
fn pressed(context: &egui::Context) -> Vec<Key> {
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
    context.input(|input| input.events.iter().filter_map(key).collect())
}
