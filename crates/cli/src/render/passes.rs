//! `--preview` and `--seconds`: passes of 1, 1, 2, 4, ... samples over the whole picture. Their sums have the bits of a
//! render in one go.

use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use canted_film::{Film, Part};
use canted_renderer::{Monitor, RenderError, Settings};
use indicatif::ProgressBar;

use super::{Args, film::FilmRenderer, show};
use crate::{interrupt, output};

/// The film of all passes, and the number of samples per pixel.
///
/// Ctrl-C writes the passes that are complete.
///
/// # Errors
/// A device that renders no passes, or what rendering a pass returns.
pub(super) fn render(
    renderer: &dyn FilmRenderer,
    args: &Args,
    settings: &Settings,
    bar: &ProgressBar,
) -> Result<(Film, u32)> {
    let start = Instant::now();
    let budget = args.samples.seconds.map(Duration::from_secs_f32);
    let (mut joined, mut n_rays, mut n_done, mut n_next) = (None, 0, 0, 1);
    while n_next > 0 {
        let range = [n_done, n_done + n_next];
        let progress = |done: usize, all: usize| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        };
        bar.set_prefix(format!("samples {}..{} ", range[0], range[1]));
        let monitor = Monitor { progress: &progress, finished: &|_| {}, cancel: interrupt::cancel_flag() };
        let of_pass = Settings { part: Some(range), ..*settings };
        let film = match renderer.pass(&of_pass, args, &monitor) {
            Err(error) if matches!(error.downcast_ref(), Some(RenderError::Cancelled)) => {
                if let Some(part) = joined {
                    let film = whole(settings, part, n_rays)?;
                    show(args, film)?;
                    output::warn(&format!("the picture has {n_done} of {} samples per pixel", settings.samples));
                }
                return Err(error);
            }
            film => film?,
        };
        n_rays += film.n_rays();
        let parts = joined.take().into_iter().chain(film.part().cloned()).collect();
        let part = Part::join(parts).map_err(|error| anyhow!("{error}"))?;
        n_done = range[1];
        let elapsed = start.elapsed();
        n_next = next(n_done, settings.samples, elapsed, budget);
        if args.samples.preview && n_next > 0 && !args.is_stream() {
            show(args, whole(settings, part.clone(), n_rays)?)?;
        }
        joined = Some(part);
    }
    let part = joined.ok_or_else(|| anyhow!("no sample was rendered"))?;
    Ok((whole(settings, part, n_rays)?, n_done))
}

/// The number of samples of the next pass: as many as are done, fewer where they exceed the total or the time that is left.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the samples that are done")]
pub(crate) fn next(n_done: u32, n_all: u32, elapsed: Duration, budget: Option<Duration>) -> u32 {
    let n = n_done.min(n_all.saturating_sub(n_done));
    let Some(budget) = budget else { return n };
    let left = budget.saturating_sub(elapsed).as_secs_f64();
    let fitting = left / elapsed.as_secs_f64().max(1e-9) * f64::from(n_done);
    n.min(fitting.min(f64::from(n)) as u32)
}

/// The film of a part that starts at sample 0, as a picture in its own right.
pub(crate) fn whole(settings: &Settings, part: Part, n_rays: u64) -> Result<Film> {
    if part.range().start != 0 {
        return Err(anyhow!("the first pass is missing"));
    }
    Ok(Film::of_part(settings.width, settings.height, part, n_rays).without_part())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_double_up_to_the_total_and_the_time() {
        let second = Duration::from_secs(1);
        let sizes = |n_all: u32| {
            let mut sizes = vec![1];
            while let n @ 1.. = next(sizes.iter().sum(), n_all, second, None) {
                sizes.push(n);
            }
            sizes
        };
        assert_eq!(sizes(1), [1]);
        assert_eq!(sizes(16), [1, 1, 2, 4, 8]);
        assert_eq!(sizes(11), [1, 1, 2, 4, 3]);
        // 8 samples took a second: one and a half more are 12.
        assert_eq!(next(8, 100, second, Some(Duration::from_millis(2500))), 8);
        assert_eq!(next(8, 100, second, Some(Duration::from_millis(1500))), 4);
        assert_eq!(next(8, 100, second, Some(Duration::from_millis(1100))), 0);
        assert_eq!(next(8, 100, second, Some(Duration::from_millis(900))), 0);
    }
}
