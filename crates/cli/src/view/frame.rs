//! What a session shows, and what goes between it and the thread that renders: jobs and clicks there, frames and answers back.

use std::{
    sync::{
        Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::Sender,
    },
    time::{Duration, Instant},
};

use canted_film::{Aov, AovValues, Film, Picture, false_color};
use canted_renderer::Integrator;
use canted_scene::Camera;

use super::options::Options;

/// A picture to render.
#[derive(Clone, Debug)]
pub(super) struct Job {
    /// Increases with each job.
    pub(super) number: u64,
    pub(super) options: Options,
    /// Whether another job will follow soon.
    pub(super) is_moving: bool,
}

/// What the thread reports.
pub(super) enum Message {
    Frame(Frame),
    /// What is at the position of a click.
    Seen(Option<Seen>),
    /// Why a job has no picture.
    Failed {
        number: u64,
        reason: String,
    },
    /// Warnings and notes.
    Warnings(Vec<String>),
}

/// What the thread has to do.
#[derive(Default)]
pub(super) struct Pending {
    pub(super) job: Option<Job>,
    pub(super) clicks: Vec<[f64; 2]>,
    pub(super) is_closed: bool,
}

/// What the session has asked for, between it and its thread.
#[derive(Default)]
pub(super) struct JobQueue {
    pending: Mutex<Pending>,
    changed: Condvar,
    cancel: AtomicBool,
}

impl JobQueue {
    fn pending(&self) -> MutexGuard<'_, Pending> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what there is to do, and cancels what runs.
    pub(super) fn post(&self, change: impl FnOnce(&mut Pending)) {
        let mut pending = self.pending();
        change(&mut pending);
        self.cancel.store(true, Ordering::Relaxed);
        self.changed.notify_all();
    }

    /// Waits for something to do: a job or clicks; `None` once the session is closed.
    pub(super) fn next(&self) -> Option<(Option<Job>, Vec<[f64; 2]>)> {
        let mut pending = self.pending();
        loop {
            if pending.is_closed {
                return None;
            }
            if pending.job.is_some() || !pending.clicks.is_empty() {
                self.cancel.store(false, Ordering::Relaxed);
                return Some((pending.job.take(), std::mem::take(&mut pending.clicks)));
            }
            pending = self.changed.wait(pending).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// The clicks during a job, after which it goes on; `None` if another job is there.
    pub(super) fn clicks(&self) -> Option<Vec<[f64; 2]>> {
        let mut pending = self.pending();
        if pending.job.is_some() || pending.is_closed {
            return None;
        }
        self.cancel.store(false, Ordering::Relaxed);
        Some(std::mem::take(&mut pending.clicks))
    }

    /// Whether another job comes within a time.
    pub(super) fn is_followed_within(&self, time: Duration) -> bool {
        let has_none = |pending: &mut Pending| pending.job.is_none() && !pending.is_closed;
        let waited = self.changed.wait_timeout_while(self.pending(), time, has_none);
        let (pending, _) = waited.unwrap_or_else(PoisonError::into_inner);
        pending.job.is_some() || pending.is_closed
    }

    /// Set while there is something else to do.
    pub(super) fn cancel(&self) -> &AtomicBool {
        &self.cancel
    }
}

/// Sends messages, and wakes the receiver.
pub(super) struct FrameSender {
    pub(super) sender: Sender<Message>,
    pub(super) wake: Box<dyn Fn() + Send>,
}

impl FrameSender {
    pub(super) fn send(&self, message: Message) {
        // A session that is closed receives nothing.
        let _ = self.sender.send(message);
        (self.wake)();
    }
}

/// What a job renders, the same for all its pictures.
#[derive(Clone, Debug)]
#[cfg_attr(not(feature = "view"), allow(dead_code, reason = "the window reads all of it"))]
pub(crate) struct View {
    /// The number of the job.
    pub(crate) number: u64,
    pub(crate) size: [u32; 2],
    /// Samples per pixel of the final picture.
    pub(crate) n_samples: u32,
    pub(crate) is_moving: bool,
    pub(crate) camera: Camera,
    /// Whether the camera is one of the file.
    pub(crate) is_file_camera: bool,
    pub(crate) integrator: Integrator,
    /// `cpu`, or the value of `--device` where a GPU renders.
    pub(crate) device: String,
    /// Distance of what is in the center of the picture.
    pub(crate) center_distance: Option<f64>,
    /// First and last time of the animation in seconds, if there is one.
    pub(crate) time_range: Option<[f32; 2]>,
    /// Levels of the structure.
    pub(crate) n_levels: u32,
    /// When the scene and its structure were ready.
    pub(crate) ready: Instant,
}

/// A picture of a job: coarse, after some passes, or final.
#[derive(Clone, Debug)]
#[cfg_attr(not(feature = "view"), allow(dead_code, reason = "the window reads all of it"))]
pub(crate) struct Frame {
    pub(crate) view: View,
    /// As it is encoded; a coarse picture is smaller than the size of the view.
    pub(crate) picture: Picture,
    /// The same in sRGB, row by row: the thread of a window does not encode.
    pub(crate) bytes: Vec<u8>,
    /// Samples per pixel; 0 for a coarse picture.
    pub(crate) n_samples: u32,
    /// Whether no better picture will follow.
    pub(crate) is_settled: bool,
}

impl Frame {
    pub(super) fn new(view: View, picture: Picture, n_samples: u32, is_settled: bool) -> Self {
        let is_shown = cfg!(feature = "view");
        let pixels = picture.pixels.iter().filter(|_| is_shown);
        let bytes = pixels.flatten().map(|&x| canted_film::srgb::encode(x)).collect();
        Self { view, picture, bytes, n_samples, is_settled }
    }
}

/// What is at a position of the picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Seen {
    pub(crate) instance: u32,
    /// Triangle of the mesh.
    pub(crate) primitive: u32,
    /// Distance from the camera in world units.
    pub(crate) t: f32,
    /// Weights of the second and third vertex.
    pub(crate) barycentric: [f32; 2],
    /// Texture coordinates, if the mesh has some.
    pub(crate) texture: Option<[f32; 2]>,
    pub(crate) mesh: String,
    pub(crate) material: String,
}

impl Seen {
    /// What is at the position of a click: names and values.
    pub(super) fn rows(&self) -> Vec<(&'static str, String)> {
        let Seen { instance, primitive, t, barycentric: [u, v], texture, mesh, material } = self;
        let mut rows = vec![
            ("instance", instance.to_string()),
            ("primitive", primitive.to_string()),
            ("t", t.to_string()),
            ("barycentric", format!("{u} {v}")),
        ];
        rows.extend(texture.map(|[u, v]| ("uv", format!("{u} {v}"))));
        rows.extend([("mesh", format!("{mesh:?}")), ("material", format!("{material:?}"))]);
        rows
    }
}

/// Shows a channel of a film: depth as gray, near bright; normals as colors from -1 to 1; ids as a color each; tests in false color; albedo and light
/// as they are. Black where the integrator has no such channel.
pub(super) fn channel(film: &Film, aov: Aov) -> Picture {
    let size = [film.width(), film.height()];
    let black = || Picture::filled(size[0], size[1], [0.0; 3]);
    let pixels = match (film.aov(aov), aov) {
        (None, _) => return black(),
        (Some(AovValues::Ids(ids)), _) => ids.into_iter().map(color_of).collect(),
        (Some(AovValues::Numbers(numbers)), Aov::Depth) => grays(&numbers),
        (Some(AovValues::Numbers(numbers)), Aov::Tests) => {
            let boxes = numbers.chunks(2).map(|tests| tests[0] as u64);
            return false_color(boxes, size, 128);
        }
        (Some(AovValues::Numbers(numbers)), Aov::Normal | Aov::ShadingNormal) => {
            numbers.chunks(3).map(|c| [c[0], c[1], c[2]].map(|x| linear(0.5 + 0.5 * x))).collect()
        }
        (Some(AovValues::Numbers(numbers)), _) => numbers.chunks(3).map(|c| [c[0], c[1], c[2]]).collect(),
    };
    Picture { pixels, ..black() }
}

/// The linear value that is encoded as `x`, so that a value of one half is a middle gray on the screen.
fn linear(x: f32) -> f32 {
    canted_film::srgb::to_linear(f64::from(x)) as f32
}

/// Depths between the nearest and the farthest, from white to dark gray; black without hits.
fn grays(depths: &[f32]) -> Vec<[f32; 3]> {
    let finite = || depths.iter().copied().filter(|depth| depth.is_finite());
    let (near, far) = (finite().fold(f32::INFINITY, f32::min), finite().fold(f32::NEG_INFINITY, f32::max));
    let range = (far - near).max(f32::MIN_POSITIVE);
    let gray = |&depth: &f32| if depth.is_finite() { linear(1.0 - 0.85 * (depth - near) / range) } else { 0.0 };
    depths.iter().map(|depth| [gray(depth); 3]).collect()
}

/// A color for an id; black for none. Near ids have different colors.
fn color_of(id: u32) -> [f32; 3] {
    if id == u32::MAX {
        return [0.0; 3];
    }
    let mixed = id.wrapping_add(1).wrapping_mul(0x9E37_79B9);
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x85EB_CA6B);
    let part = |shift: u32| linear(0.2 + 0.8 * ((mixed >> shift & 255) as f32) / 255.0);
    [part(0), part(8), part(16)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_bright_and_a_miss_is_black() {
        let [near, far, miss] = grays(&[1.0, 5.0, f32::INFINITY])[..] else { panic!("three pixels") };
        assert!(near[0] > far[0] && far[0] > 0.0 && miss == [0.0; 3]);
        assert_eq!(grays(&[2.0])[0], [1.0; 3]);
        assert!(color_of(0) != color_of(1) && color_of(u32::MAX) == [0.0; 3]);
    }
}
