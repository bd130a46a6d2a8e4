//! The controls next to the picture.

use std::time::Instant;

use canted_film::{Aov, ToneMap};
use canted_renderer::{BoxLevel, Integrator, Measure};
use eframe::egui::{self, RichText, Slider, SliderClamping};

use crate::{
    device::DeviceArg,
    options::{Named, Text as _, Value},
    view::{
        events::{Event, Key},
        options::Options,
        session::{Session, StructureKind, structures},
    },
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

/// A row with a label and a list of values by their names: the value that is chosen, if it is another one.
fn list<T>(
    ui: &mut egui::Ui,
    label: &str,
    now: &str,
    values: impl IntoIterator<Item = (impl AsRef<str>, T)>,
) -> Option<T> {
    ui.label(label);
    let mut chosen = None;
    egui::ComboBox::from_id_salt(label).width(LIST).selected_text(now).height(320.0).show_ui(ui, |ui| {
        for (name, value) in values {
            let name = name.as_ref();
            if ui.selectable_label(name == now, name).clicked() && name != now {
                chosen = Some(value);
            }
        }
    });
    ui.end_row();
    chosen
}

/// Values with their names.
fn named<T: Named>() -> impl Iterator<Item = (&'static str, T)> {
    T::all().into_iter().map(|value| (value.name(), value))
}

/// None, and values with their names.
fn none_or<T: Named>() -> impl Iterator<Item = (&'static str, Option<T>)> {
    std::iter::once(("none", None)).chain(named::<T>().map(|(name, value)| (name, Some(value))))
}

impl Panel {
    /// Shows the controls, which change `options` and add events.
    pub(super) fn show(
        &mut self,
        context: &egui::Context,
        session: &Session,
        note: &str,
        options: &mut Options,
        events: &mut Vec<Event>,
    ) {
        let side = egui::SidePanel::right("controls").exact_width(PANEL_WIDTH).resizable(false);
        side.show(context, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.add_space(6.0);
                let grid =
                    |name: &'static str| egui::Grid::new(name).num_columns(2).min_col_width(LABELS).spacing([8.0, 6.0]);
                grid("rendering").show(ui, |ui| rendering(ui, session, options));
                ui.separator();
                grid("structure").show(ui, |ui| structure(ui, session, options));
                if let Some(range) = session.frame.as_ref().and_then(|frame| frame.view.time_range) {
                    ui.separator();
                    self.time(ui, session, range, options);
                }
                ui.separator();
                actions(ui, events);
                ui.separator();
                readout(ui, session, note);
            });
        });
    }

    /// The time of the animation: a slider over the range of the file, and a switch that plays it again and again.
    fn time(&mut self, ui: &mut egui::Ui, session: &Session, [first, last]: [f32; 2], options: &mut Options) {
        let mut time: f32 = options.args.source.time().unwrap_or(first);
        let mut is_playing = self.playing.is_some();
        ui.horizontal(|ui| {
            ui.label("time");
            ui.spacing_mut().slider_width = 104.0;
            // Only the text is rounded: a slider with decimals rounds a time that is given, too.
            let slider = Slider::new(&mut time, first..=last).clamping(SliderClamping::Never);
            let slider = ui.add(slider.custom_formatter(|time, _| format!("{time:.3} s")));
            if slider.changed() {
                is_playing = false;
                options.args.source.time = Some(Value(time));
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
                let time = first + (from - first + since.elapsed().as_secs_f32()) % length;
                options.args.source.time = Some(Value(time));
            }
            ui.ctx().request_repaint_after(std::time::Duration::from_millis(15));
        }
    }
}

/// What is rendered, and how it is shown.
fn rendering(ui: &mut egui::Ui, session: &Session, options: &mut Options) {
    let frame = session.frame.as_ref();
    let integrator = frame.map_or("", |frame| frame.view.integrator.name());
    if let Some(chosen) = list(ui, "integrator", integrator, named::<Integrator>()) {
        options.args.options.0.rendering.integrator = Some(Value(chosen));
    }
    let samples = frame.map_or(16, |frame| frame.view.n_samples);
    let counts = [1, 4, 16, 64, 256, 1024, 4096].map(|n: u32| (n.to_string(), n));
    if let Some(chosen) = list(ui, "samples", &samples.to_string(), counts) {
        options.args.options.0.rendering.spp = Some(Value(chosen));
    }
    let devices = [DeviceArg::Cpu, DeviceArg::Gpu].map(|device| (device.text(), device));
    let n_devices = if cfg!(feature = "gpu") { 2 } else { 1 };
    if let Some(chosen) = list(ui, "device", &options.device().text(), devices.into_iter().take(n_devices)) {
        options.args.own.0.device = Some(Value(chosen));
    }
    if let Some(chosen) = list(ui, "channel", options.aov.map_or("none", Aov::name), none_or::<Aov>()) {
        options.aov = chosen;
    }
    if let Some(chosen) = list(ui, "heat map", options.measure().map_or("none", Measure::name), none_or::<Measure>()) {
        options.diagram().heatmap = chosen.map(Value);
    }
    let look = &mut options.args.options.0.look;
    if let Some(chosen) = list(ui, "tone curve", look.curve().name(), named::<ToneMap>()) {
        look.tone_map = Some(Value(chosen));
    }
    ui.label("exposure");
    let mut stops: f32 = look.stops().unwrap_or(0.0);
    ui.spacing_mut().slider_width = 88.0;
    let slider = Slider::new(&mut stops, -8.0..=8.0).clamping(SliderClamping::Never);
    if ui.add(slider.custom_formatter(|stops, _| format!("{stops:.1}"))).changed() {
        look.set_stops(Some((10.0 * stops).round() / 10.0));
    }
    ui.end_row();
}

/// The acceleration structure and its boxes.
fn structure(ui: &mut egui::Ui, session: &Session, options: &mut Options) {
    let name = |(kind, volumes): StructureKind| match volumes {
        Some(volumes) => format!("{} {}", kind.name(), volumes.name()),
        None => kind.name().to_owned(),
    };
    let all = structures().into_iter().map(|kind| (name(kind), kind));
    if let Some(chosen) = list(ui, "structure", &name(session.structure()), all) {
        options.args.structure.0.set_kind(chosen);
    }
    let n_levels = session.frame.as_ref().map_or(0, |frame| frame.view.n_levels);
    let text = |level: Option<BoxLevel>| level.map_or_else(|| "none".to_owned(), |level| level.to_string());
    let levels = (0..n_levels).map(BoxLevel::Level).chain([BoxLevel::Leaves]).map(Some);
    let levels = std::iter::once(None).chain(levels).map(|level| (text(level), level));
    if let Some(chosen) = list(ui, "boxes of level", &text(options.boxes()), levels) {
        options.diagram().boxes = chosen.map(Value);
    }
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
