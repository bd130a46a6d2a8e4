//! All samples of a picture, in passes of 1, 1, 2, 4, ... samples. The last film has the bits of `canted render`.

use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use canted_film::{Film, Part};
use canted_renderer::{Integrator, RenderError, Settings};

use super::{
    device::Device,
    frame::View,
    traced::{Passes, Shot, Traced},
    worker::Desk,
};
use crate::render::{next_pass, whole_film};

/// The film of all samples so far.
pub(super) struct Refined {
    pub(super) film: Film,
    pub(super) integrator: Integrator,
    /// `cpu`, or the value of `--device` where a GPU renders.
    pub(super) device: String,
    /// Seconds for a sample of a pixel, in the last pass.
    pub(super) seconds_per_sample: f64,
    /// The sums that the next pass continues; none where there is no next pass.
    part: Option<Part>,
    n_rays: u64,
    /// Samples of each pixel that are in `part`.
    n_done: u32,
}

impl Refined {
    /// A view with what was decided for the film.
    pub(super) fn view(&self, view: &View) -> View {
        View { integrator: self.integrator, device: self.device.clone(), ..view.clone() }
    }

    /// Whether no pass is missing.
    pub(super) fn is_complete(&self) -> bool {
        self.part.is_none()
    }

    /// Samples of each pixel, on average.
    pub(super) fn n_samples(&self) -> u32 {
        let n_pixels = u64::from(self.film.width()) * u64::from(self.film.height());
        u32::try_from(self.film.n_samples() / n_pixels.max(1)).unwrap_or(u32::MAX)
    }
}

/// Renders the samples that `progress` does not have, and leaves there what is done; `send` shows each film but the last. Clicks in
/// between are answered.
///
/// # Errors
/// Cancelled by another job; the loss of the device.
pub(super) fn refine(
    traced: &dyn Traced,
    shot: &Shot,
    device: &Device,
    desk: &Desk,
    progress: &mut Option<Refined>,
    show: &Show,
) -> Result<()> {
    traced.with_passes(shot, device, &mut |passes| all_passes(passes, shot.settings, desk, progress, show))
}

/// What happens between passes.
pub(super) struct Show<'a> {
    pub(super) send: &'a dyn Fn(&Refined),
    pub(super) answer: &'a dyn Fn([f64; 2]),
}

fn all_passes(
    passes: &dyn Passes,
    settings: &Settings,
    desk: &Desk,
    progress: &mut Option<Refined>,
    show: &Show,
) -> Result<()> {
    let n_pixels = f64::from(settings.width) * f64::from(settings.height);
    // Samples of several devices are not mixed.
    if progress.as_ref().is_some_and(|done| done.device != passes.device()) {
        *progress = None;
    }
    loop {
        let (n_done, n_rays) = progress.as_ref().map_or((0, 0), |done| (done.n_done, done.n_rays));
        let n_next = if n_done == 0 { 1 } else { next_pass(n_done, settings.samples, Duration::ZERO, None) };
        let range = [n_done, n_done + n_next];
        // Adaptive sampling is not divided into passes.
        let part = settings.noise.is_none().then_some(range);
        let start = Instant::now();
        let film = match passes.film(&Settings { part, ..*settings }, desk.cancel()) {
            Err(error) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => {
                // Clicks are answered, then the pass starts again.
                let Some(clicks) = desk.clicks() else { return Err(error) };
                clicks.into_iter().for_each(show.answer);
                continue;
            }
            film => film?,
        };
        let seconds_per_sample = start.elapsed().as_secs_f64() / (n_pixels * f64::from(n_next));
        let n_rays = n_rays + film.n_rays();
        let (film, part) = if part.is_some() {
            // After an error there is no film: one without sums would count as complete.
            let before = progress.take().and_then(|done| done.part);
            let parts = before.into_iter().chain(film.part().cloned()).collect();
            let joined = Part::join(parts).map_err(|error| anyhow!("{error}"))?;
            let has_more = next_pass(range[1], settings.samples, Duration::ZERO, None) > 0;
            (whole_film(settings, joined.clone(), n_rays)?, has_more.then_some(joined))
        } else {
            (film, None)
        };
        let (integrator, device) = (settings.integrator, passes.device().to_owned());
        let refined = Refined { film, integrator, device, seconds_per_sample, part, n_rays, n_done: range[1] };
        let refined = &*progress.insert(refined);
        if refined.is_complete() {
            return Ok(());
        }
        (show.send)(refined);
    }
}
