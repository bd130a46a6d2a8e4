//! The controls next to the picture.

use std::time::Instant;

use canted_film::Aov;
use eframe::egui::{self, RichText, Slider, SliderClamping};

use crate::options::{Named, Text as _};
use crate::view::{
    events::{Event, Key},
    session::{STRUCTURES, Session},
};

/// Width of the controls in points.
pub(super) const PANEL_WIDTH: f32 = 264.0;

/// Width of labels in points.
const LABELS: f32 = 92.0;

/// Width of lists in points.
const LIST: f32 = 140.0;

/// The controls.
#[derive(Default)]
pub(super) struct Panel {
    /// The time of the clock and of the animation when it began to play.
    playing: Option<(Instant, f32)>,
    /// The picture that the last time was set for.
    played_job: u64,
}

/// Collects changes of options.
struct Changes<'a>(&'a mut Vec<Event>);

impl Changes<'_> {
    fn set(&mut self, name: &str, value: impl ToString) {
        self.0.push(Event::Set(vec![(name.to_owned(), value.to_string())]));
    }

    /// A row with a list of values of an option.
    fn list(&mut self, ui: &mut egui::Ui, label: &str, option: &str, now: &str, names: &[&str]) {
        list(ui, label, now, names.iter().copied(), |name| self.set(option, name));
    }
}

/// A row with a label and a list.
fn list<'a>(
    ui: &mut egui::Ui,
    label: &str,
    now: &str,
    names: impl Iterator<Item = &'a str>,
    mut choose: impl FnMut(&'a str),
) {
    ui.label(label);
    egui::ComboBox::from_id_salt(label).width(LIST).selected_text(now).height(320.0).show_ui(ui, |ui| {
        for name in names {
            if ui.selectable_label(name == now, name).clicked() && name != now {
                choose(name);
            }
        }
    });
    ui.end_row();
}

impl Panel {
    pub(super) fn show(&mut self, context: &egui::Context, session: &Session, note: &str, events: &mut Vec<Event>) {
        let side = egui::SidePanel::right("controls").exact_width(PANEL_WIDTH).resizable(false);
        side.show(context, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.add_space(6.0);
                let grid =
                    |name: &'static str| egui::Grid::new(name).num_columns(2).min_col_width(LABELS).spacing([8.0, 6.0]);
                grid("rendering").show(ui, |ui| rendering(ui, session, &mut Changes(events)));
                ui.separator();
                grid("structure").show(ui, |ui| structure(ui, session, &mut Changes(events)));
                if let Some(range) = session.frame.as_ref().and_then(|frame| frame.view.time_range) {
                    ui.separator();
                    self.time(ui, session, range, &mut Changes(events));
                }
                ui.separator();
                actions(ui, events);
                ui.separator();
                readout(ui, session, note);
            });
        });
    }

    /// The time of the animation: a slider over the range of the file, and a switch that plays it again and again.
    fn time(&mut self, ui: &mut egui::Ui, session: &Session, [first, last]: [f32; 2], changes: &mut Changes) {
        let mut time: f32 = session.options().args().source.time.unwrap_or(first);
        let mut is_playing = self.playing.is_some();
        ui.horizontal(|ui| {
            ui.label("time");
            ui.spacing_mut().slider_width = 104.0;
            // Only the text is rounded: a slider with decimals rounds a time that is given, too.
            let slider = Slider::new(&mut time, first..=last).clamping(SliderClamping::Never);
            let slider = ui.add(slider.custom_formatter(|time, _| format!("{time:.3} s")));
            if slider.changed() {
                is_playing = false;
                changes.set("time", time);
            }
        });
        ui.checkbox(&mut is_playing, "play");
        match (is_playing, self.playing) {
            (true, None) => self.playing = Some((Instant::now(), time)),
            (false, _) => self.playing = None,
            (true, Some(_)) => {}
        }
        if let Some((since, from)) = self.playing {
            let length = (last - first).max(f32::MIN_POSITIVE);
            // The next time follows the picture of the last one, however long that takes.
            let shown = session.frame.as_ref().map_or(0, |frame| frame.view.number);
            if shown > self.played_job {
                self.played_job = shown;
                changes.set("time", first + (from - first + since.elapsed().as_secs_f32()) % length);
            }
            ui.ctx().request_repaint_after(std::time::Duration::from_millis(15));
        }
    }
}

/// What is rendered, and how it is shown.
fn rendering(ui: &mut egui::Ui, session: &Session, changes: &mut Changes) {
    let (options, frame) = (session.options(), session.frame.as_ref());
    let integrator = frame.map(|frame| format!("{:?}", frame.view.integrator).to_lowercase()).unwrap_or_default();
    changes.list(ui, "integrator", "integrator", &integrator, &["hybrid", "path"]);
    let samples = frame.map_or(16, |frame| frame.view.n_samples);
    let counts = ["1", "4", "16", "64", "256", "1024", "4096"];
    changes.list(ui, "samples", "spp", &samples.to_string(), &counts);
    let device = options.args().own.device.text();
    let devices = if cfg!(feature = "gpu") { &["cpu", "gpu"][..] } else { &["cpu"] };
    changes.list(ui, "device", "device", &device, devices);
    let channel = options.aov.map_or("none", Aov::name);
    let channels = ["none"].into_iter().chain(Aov::ALL.map(Aov::name));
    list(ui, "channel", channel, channels, |name| changes.set("aov", name));
    changes.list(
        ui,
        "heat map",
        "heatmap",
        options.args().own.diagram.0.heatmap.map_or("none", Named::name),
        &["none", "boxes", "triangles"],
    );
    let curves = ["none", "agx", "aces", "filmic-neutral"];
    let look = &options.args().options.0.look;
    changes.list(ui, "tone curve", "tone_map", look.tone_map.map_or("none", Named::name), &curves);
    ui.label("exposure");
    let mut stops: f32 = look.stops().unwrap_or(0.0);
    ui.spacing_mut().slider_width = 88.0;
    let slider = Slider::new(&mut stops, -8.0..=8.0).clamping(SliderClamping::Never);
    if ui.add(slider.custom_formatter(|stops, _| format!("{stops:.1}"))).changed() {
        changes.set("exposure", (10.0 * stops).round() / 10.0);
    }
    ui.end_row();
}

/// The acceleration structure and its boxes.
fn structure(ui: &mut egui::Ui, session: &Session, changes: &mut Changes) {
    let name = |(accel, volumes): (&str, &str)| format!("{accel} {volumes}").trim().to_owned();
    let names = STRUCTURES.map(name);
    let now = &names[session.structure()];
    list(ui, "structure", now, names.iter().map(|name| &name[..]), |chosen| {
        if let Some(i) = names.iter().position(|name| name == chosen) {
            let (accel, volumes) = STRUCTURES[i];
            let both =
                [("accel", accel), ("volumes", volumes)].map(|(name, value)| (name.to_owned(), value.to_owned()));
            changes.0.push(Event::Set(both.to_vec()));
        }
    });
    let n_levels = session.frame.as_ref().map_or(0, |frame| frame.view.n_levels);
    let levels: Vec<String> = (0..n_levels).map(|level| level.to_string()).collect();
    let shown = session.options().boxes().map_or_else(|| "none".to_owned(), |level| level.to_string());
    let values = ["none"].into_iter().chain(levels.iter().map(|level| &level[..])).chain(["leaves"]);
    list(ui, "boxes of level", &shown, values, |level| changes.set("boxes", level));
}

fn actions(ui: &mut egui::Ui, events: &mut Vec<Event>) {
    ui.horizontal(|ui| {
        for (label, key, help) in [
            ("Screenshot", Key::Screenshot, "Saves canted_001.png, ... in the current folder (p)"),
            ("Copy command", Key::Copy, "Copies the command that renders this picture (c)"),
            ("First view", Key::Home, "Returns to the first view (home)"),
        ] {
            if ui.button(label).on_hover_text(help).clicked() {
                events.push(Event::Key(key));
            }
        }
    });
}

/// The state of the picture, what was clicked, and messages.
fn readout(ui: &mut egui::Ui, session: &Session, note: &str) {
    if let Some(frame) = &session.frame {
        let state = if session.is_settled() { "done" } else { "rendering" };
        let [width, height] = frame.view.size;
        let (n, all, device) = (frame.n_samples, frame.view.n_samples, &frame.view.device);
        ui.label(format!("{width} x {height}, {n} of {all} samples"));
        ui.label(format!("{state} on {device}"));
    }
    match &session.seen {
        None => {
            let text =
                if session.is_answered { "Nothing is there." } else { "Click the picture to see what is there." };
            ui.label(RichText::new(text).weak());
        }
        Some(seen) => {
            egui::Grid::new("seen").num_columns(2).spacing([8.0, 2.0]).show(ui, |ui| {
                for (name, value) in seen.rows() {
                    ui.label(RichText::new(name).weak());
                    ui.add(egui::Label::new(RichText::new(value).monospace()).wrap());
                    ui.end_row();
                }
            });
        }
    }
    if !note.is_empty() {
        ui.separator();
        ui.label(note);
    }
    for warning in session.warnings.iter().rev().take(3) {
        ui.label(RichText::new(warning).color(egui::Color32::from_rgb(230, 180, 90)));
    }
    ui.separator();
    egui::Grid::new("help").num_columns(2).min_col_width(LABELS).spacing([8.0, 2.0]).show(ui, |ui| {
        for (input, effect) in HELP {
            ui.label(RichText::new(input).weak());
            ui.label(RichText::new(effect).weak());
            ui.end_row();
        }
    });
}

/// What mouse and keys do.
const HELP: [(&str, &str); 9] = [
    ("drag", "orbit"),
    ("right drag", "pan"),
    ("wheel, + -", "zoom"),
    ("w s a d q e", "fly"),
    ("arrow keys", "orbit"),
    ("i v h", "integrator, channel, heat map"),
    ("x b", "structure, boxes"),
    ("p c", "screenshot, command"),
    ("home, escape", "first view, close"),
];
