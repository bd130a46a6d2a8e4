//! How long the pixels of a cell go on taking samples.

use std::f64::consts::SQRT_2;
use std::ops::Range;

use canted_film::Sums;

use crate::Settings;

/// Samples after which the error of a cell is looked at for the first time; then at each power of two.
const FIRST_LOOK: u32 = 8;

/// How far the samples of a cell have got.
pub(crate) struct Course {
    /// The samples to take now.
    pub(crate) next: Range<u32>,
    /// One past the last that there are.
    last: u32,
    /// What half of the samples said before them; nothing at first.
    before: f64,
}

impl Course {
    pub(crate) fn new(settings: &Settings) -> Self {
        let Range { start, end: last } = settings.range();
        let end = if settings.noise.is_some() { FIRST_LOOK.min(last) } else { last };
        Self { next: start..end, last, before: f64::INFINITY }
    }

    /// Goes on after `next` was taken, into the sums of the cell's pixels; whether there is more to take.
    pub(crate) fn goes_on(&mut self, settings: &Settings, sums: &[Sums]) -> bool {
        if self.next.end == self.last {
            return false;
        }
        if let Some(noise) = settings.noise {
            let now = error(sums);
            // Luck must strike twice: the first half, by itself, must have foretold that this many are enough.
            if now.max(self.before / SQRT_2) <= f64::from(noise) {
                return false;
            }
            self.before = now;
        }
        self.next = self.next.end..self.next.end.saturating_mul(2).min(self.last);
        true
    }
}

/// Root of the mean of the pixels' squared errors.
fn error(sums: &[Sums]) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "pixels of a cell")]
    let n = sums.len() as f64;
    (sums.iter().map(|sums| sums.pixel.total().squared_error()).sum::<f64>() / n).sqrt()
}
