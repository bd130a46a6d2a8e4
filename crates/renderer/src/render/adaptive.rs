use std::f64::consts::SQRT_2;
use std::ops::Range;

use canted_film::Sums;

use crate::Settings;

/// Samples after which the error of a cell is estimated first; then at each power of two.
const FIRST_ESTIMATE: u32 = 8;

/// Decides how many samples the pixels of a cell take.
pub(crate) struct Adaptive {
    /// The samples to take next.
    pub(crate) next: Range<u32>,
    end: u32,
    /// The error after half of the samples; infinite at first.
    previous: f64,
}

impl Adaptive {
    pub(crate) fn new(settings: &Settings) -> Self {
        let Range { start, end } = settings.range();
        let first = if settings.noise.is_some() { FIRST_ESTIMATE.min(end) } else { end };
        Self { next: start..first, end, previous: f64::INFINITY }
    }

    /// Continues after the samples of `next` were added to the sums of the cell's pixels; returns whether there are more.
    pub(crate) fn advance(&mut self, settings: &Settings, sums: &[Sums]) -> bool {
        if self.next.end == self.end {
            return false;
        }
        if let Some(noise) = settings.noise {
            let error = error(sums);
            // Two estimates must agree: the error of half the samples, scaled, must be low enough too.
            if error.max(self.previous / SQRT_2) <= f64::from(noise) {
                return false;
            }
            self.previous = error;
        }
        self.next = self.next.end..self.next.end.saturating_mul(2).min(self.end);
        true
    }
}

/// Root mean square of the pixels' errors.
fn error(sums: &[Sums]) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "pixels of a cell")]
    let n = sums.len() as f64;
    (sums.iter().map(|sums| sums.pixel.total().squared_error()).sum::<f64>() / n).sqrt()
}
