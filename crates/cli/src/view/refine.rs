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
}

impl Refined {
    /// A view with what was decided for the film.
    pub(super) fn view(&self, view: &View) -> View {
        View { integrator: self.integrator, device: self.device.clone(), ..view.clone() }
    }

    /// Samples of each pixel, on average.
    pub(super) fn n_samples(&self) -> u32 {
        let n_pixels = u64::from(self.film.width()) * u64::from(self.film.height());
        u32::try_from(self.film.n_samples() / n_pixels.max(1)).unwrap_or(u32::MAX)
    }
}

/// Renders all samples; `send` shows each film but the last. Clicks in between are answered.
///
/// # Errors
/// Cancelled by another job; the loss of the device.
pub(super) fn refined(
    traced: &dyn Traced,
    shot: &Shot,
    device: &Device,
    desk: &Desk,
    send: &dyn Fn(&Refined),
    answer: &dyn Fn([f64; 2]),
) -> Result<Refined> {
    let mut result = None;
    traced.with_passes(shot, device, &mut |passes| {
        result = Some(all_passes(passes, shot.settings, desk, send, answer)?);
        Ok(())
    })?;
    result.ok_or_else(|| anyhow!("no sample was rendered"))
}

fn all_passes(
    passes: &dyn Passes,
    settings: &Settings,
    desk: &Desk,
    send: &dyn Fn(&Refined),
    answer: &dyn Fn([f64; 2]),
) -> Result<Refined> {
    let n_pixels = f64::from(settings.width) * f64::from(settings.height);
    let (mut joined, mut n_rays, mut n_done, mut n_next): (Option<Part>, _, _, _) = (None, 0, 0, 1);
    loop {
        let range = [n_done, n_done + n_next];
        // Adaptive sampling is not divided into passes.
        let part = settings.noise.is_none().then_some(range);
        let start = Instant::now();
        let film = match passes.film(&Settings { part, ..*settings }, desk.cancel()) {
            Err(error) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => {
                // Clicks are answered, then the pass starts again.
                let Some(clicks) = desk.clicks() else { return Err(error) };
                clicks.into_iter().for_each(answer);
                continue;
            }
            film => film?,
        };
        let seconds_per_sample = start.elapsed().as_secs_f64() / (n_pixels * f64::from(n_next));
        let refined = |film: Film| Refined {
            film,
            integrator: settings.integrator,
            device: passes.device().to_owned(),
            seconds_per_sample,
        };
        if part.is_none() {
            return Ok(refined(film));
        }
        n_rays += film.n_rays();
        let parts = joined.take().into_iter().chain(film.part().cloned()).collect();
        let part = Part::join(parts).map_err(|error| anyhow!("{error}"))?;
        n_done = range[1];
        n_next = next_pass(n_done, settings.samples, Duration::ZERO, None);
        if n_next == 0 {
            return Ok(refined(whole_film(settings, part, n_rays)?));
        }
        send(&refined(whole_film(settings, part.clone(), n_rays)?));
        joined = Some(part);
    }
}
