//! How fast the window is: printed with `-v` when it closes.

use std::{
    fmt,
    time::{Duration, Instant},
};

use crate::view::frame::View;

/// Pictures further apart than this are not of one motion.
const MOTION: Duration = Duration::from_millis(500);

/// What input may wait for.
const LIMIT: Duration = Duration::from_millis(50);

/// Times of a window.
pub(super) struct Timing {
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
    pub(super) fn new(start: Instant) -> Self {
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
    pub(super) fn begin(&mut self, drawn_s: Option<f32>) {
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
    pub(super) fn end(&mut self) {
        self.last = self.begun.elapsed();
    }

    /// A picture is shown.
    pub(super) fn show(&mut self, view: &View) {
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
