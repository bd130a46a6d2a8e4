//! Input of the window as events.

use eframe::egui::{self, PointerButton, Rect};

use crate::view::events::{Button, Event, Key};

/// Points that a notch of the wheel scrolls.
const NOTCH: f32 = 50.0;

/// The events on a picture of this size that is drawn in `rect`.
pub(super) fn on_picture(
    ui: &egui::Ui,
    response: &egui::Response,
    rect: Rect,
    size: [u32; 2],
    events: &mut Vec<Event>,
) {
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
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels of a window")]
pub(super) fn wanted_size(area: Rect, scale: f32, size: Option<&str>) -> Option<[u32; 2]> {
    const LEAST: u32 = 8;
    let pixels = [area.width(), area.height()].map(|side| (side * scale).round() as u32);
    let is_known = size == Some(&format!("{}x{}", pixels[0], pixels[1])[..]);
    (pixels.iter().all(|&side| side >= LEAST) && !is_known).then_some(pixels)
}

/// The keys with functions that were pressed since the last frame.
pub(super) fn pressed(context: &egui::Context) -> Vec<Event> {
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
