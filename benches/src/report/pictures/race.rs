//! Several methods that render one picture in turn, and the errors that each reaches.

use anyhow::Result;
use canted_film::{Film, PIXELS_PER_DEGREE, flip};
use canted_renderer::Settings;

use super::reference::{Errors, Reference};
use crate::clock::{self, Seconds};
use crate::interleave::median;
use crate::report::{
    fits::{self, Line, Unfit},
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, number},
};

/// Renders a picture with the given settings.
type Render<'a> = dyn Fn(&Settings) -> Result<Film> + 'a;

/// A method to render the picture.
pub(super) struct Racer<'a> {
    pub(super) name: String,
    pub(super) reference: &'a Reference,
    /// Build seconds, added in plots that include the build.
    pub(super) build: &'a Samples,
    /// Settings except the number of samples and the seed.
    pub(super) settings: Settings,
    pub(super) render: Box<Render<'a>>,
}

/// Minimum sampling seconds of plots and efficiencies, if the set-up appears to take all the time.
const LEAST_SECONDS: f64 = 1e-6;

/// Results of one method at one number of samples: an entry per seed.
#[derive(Default)]
pub(super) struct Reached {
    pub(super) wall: Vec<f64>,
    pub(super) cpu: Vec<f64>,
    pub(super) mse: Vec<f64>,
    rel_mse: Vec<f64>,
    flip: Vec<f64>,
}

/// Results of one method by number of samples.
pub(super) struct Course {
    pub(super) name: String,
    build: Samples,
    /// Time of a render that does not depend on the number of samples.
    setup: Seconds,
    pub(super) reached: Vec<Reached>,
    share_of_reference: f64,
}

/// Runs all methods with all numbers of samples and all seeds, in turn.
pub(super) fn race(racers: &[Racer<'_>], samples: &[u32], n_seeds: u32) -> Result<Vec<Course>> {
    let empty = || samples.iter().map(|_| Reached::default()).collect();
    let mut reached: Vec<Vec<Reached>> = racers.iter().map(|_| empty()).collect();
    for racer in racers {
        (racer.render)(&racer.settings)?;
    }
    for seed in 0..n_seeds {
        for (k, &n) in samples.iter().enumerate() {
            for (racer, reached) in racers.iter().zip(&mut reached) {
                let settings = Settings { samples: n, seed, ..racer.settings };
                let (film, took) = clock::time_all(|| (racer.render)(&settings));
                reached[k].add(took, &film?, racer.reference)?;
            }
        }
    }
    let courses = racers.iter().zip(reached).map(|(racer, mut reached)| {
        let setup = subtract_setup(samples, &mut reached);
        let last = mean(&reached[samples.len() - 1].mse);
        let share_of_reference = racer.reference.share(last);
        Course { name: racer.name.clone(), build: racer.build.clone(), setup, reached, share_of_reference }
    });
    Ok(courses.collect())
}

impl Reached {
    fn add(&mut self, took: Seconds, film: &Film, reference: &Reference) -> Result<()> {
        let picture = film.picture();
        let Errors { mse, rel_mse } = reference.errors(&picture)?;
        self.wall.push(took.wall);
        self.cpu.push(took.cpu);
        self.mse.push(mse);
        self.rel_mse.push(rel_mse);
        self.flip.push(flip(&picture, &reference.picture, PIXELS_PER_DEGREE)?.mean());
        Ok(())
    }
}

/// Subtracts and returns the time that does not grow with the number of samples. A picture of one pixel cannot measure
/// it, because part of it grows with the pixels.
fn subtract_setup(samples: &[u32], reached: &mut [Reached]) -> Seconds {
    let mut take = |seconds: fn(&mut Reached) -> &mut Vec<f64>| {
        let point = |(&n, reached): (&u32, &mut Reached)| (f64::from(n), median(seconds(reached)));
        let setup = fits::intercept(&samples.iter().zip(reached.iter_mut()).map(point).collect::<Vec<_>>());
        reached.iter_mut().flat_map(seconds).for_each(|seconds| *seconds -= setup);
        setup
    };
    Seconds { wall: take(|reached| &mut reached.wall), cpu: take(|reached| &mut reached.cpu) }
}

/// The clock of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Clock {
    /// Processor seconds of all threads.
    Processor,
    /// Wall seconds, if a device does part of the work.
    Wall,
}

impl Clock {
    fn seconds(self, reached: &Reached) -> Samples {
        match self {
            Self::Processor => reached.cpu.clone().into(),
            Self::Wall => reached.wall.clone().into(),
        }
    }

    fn of(self, seconds: Seconds) -> f64 {
        if self == Self::Wall { seconds.wall } else { seconds.cpu }
    }

    fn label(self) -> &'static str {
        match self {
            Self::Processor => "processor seconds",
            Self::Wall => "seconds",
        }
    }
}

impl Course {
    /// Efficiency at the largest sample count, and its interval over seeds.
    pub(super) fn efficiency(&self, clock: Clock) -> (f64, [f64; 2]) {
        let last = &self.reached[self.reached.len() - 1];
        let (mse, seconds): (Samples, Samples) = (last.mse.clone().into(), clock.seconds(last));
        let of = |drawn: &[usize]| {
            1.0 / (fits::drawn_mean(&mse, drawn) * fits::drawn_mean(&seconds, drawn).max(LEAST_SECONDS))
        };
        let all: Vec<usize> = (0..last.mse.len()).collect();
        (of(&all), fits::interval(all.len(), of))
    }

    /// Exponent of an error over seconds.
    fn slope(&self, clock: Clock, error: Pick) -> Result<Line, Unfit> {
        let point = |reached: &Reached| (clock.seconds(reached), mean(error(reached)));
        fits::exponent(&self.reached.iter().map(point).collect::<Vec<_>>())
    }

    /// Exponent of the MSE over the number of samples.
    fn slope_of_samples(&self, samples: &[u32]) -> Result<Line, Unfit> {
        let point = |(&n, reached): (&u32, &Reached)| (Samples::from(f64::from(n)), mean(&reached.mse));
        fits::exponent(&samples.iter().zip(&self.reached).map(point).collect::<Vec<_>>())
    }

    fn series(&self, clock: Clock, with_build: bool, samples: &[u32], error: Pick) -> Series {
        let build = if with_build { self.build.median() + clock.of(self.setup) } else { 0.0 };
        let point = |(&n, reached): (&u32, &Reached)| Point {
            label: format!("{n} samples"),
            x: clock.seconds(reached).values().iter().map(|x| x.max(LEAST_SECONDS) + build).collect::<Vec<_>>().into(),
            y: error(reached).clone().into(),
        };
        let points = samples.iter().zip(&self.reached).map(point).collect();
        Series { name: self.name.clone(), points, is_joined: true }
    }
}

/// Selects an error.
type Pick = fn(&Reached) -> &Vec<f64>;

/// Adds plots and table of a comparison: relMSE and MSE, without and with the build time.
pub(super) fn show(chapter: &mut Chapter, what: &str, courses: &[Course], samples: &[u32], clock: Clock) {
    const REL_MSE: (&str, Pick) = ("relMSE", |reached| &reached.rel_mse);
    const MSE: (&str, Pick) = ("MSE", |reached| &reached.mse);
    for ((error, pick), with_build) in [(REL_MSE, false), (MSE, false), (REL_MSE, true), (MSE, true)] {
        let series = courses.iter().map(|course| course.series(clock, with_build, samples, pick)).collect();
        let build = if with_build { ", including set-up and build" } else { "" };
        chapter.plots.push(Plot {
            title: format!("{what}: {error} over {}{build}", clock.label()),
            x: Axis::log(format!("{}{build}", clock.label())),
            y: Axis::log(error),
            series,
        });
    }
    let (first, last) = (samples[0], samples[samples.len() - 1]);
    let mut table = Table::new(
        format!("{what}: error over time"),
        &[
            "method",
            "relMSE ~ time^",
            "MSE ~ time^",
            "MSE ~ samples^",
            "1/(MSE s)",
            &format!("95% interval, {} seeds", courses.first().map_or(0, |course| course.reached[0].mse.len())),
            &format!("FLIP at {first}"),
            &format!("FLIP at {last}"),
            "set-up",
            &format!("CPU time at {last} samples"),
            &format!("wall time at {last} samples"),
            "reference's share",
        ],
    );
    for course in courses {
        let slope = |error: Pick| Cell::text(fits::formatted(course.slope(clock, error)));
        let (efficiency, [low, high]) = course.efficiency(clock);
        let (start, end) = (&course.reached[0], &course.reached[course.reached.len() - 1]);
        table.rows.push(vec![
            Cell::text(course.name.clone()),
            slope(|reached| &reached.rel_mse),
            slope(|reached| &reached.mse),
            Cell::text(fits::formatted(course.slope_of_samples(samples))),
            Cell::text(number(efficiency)),
            Cell::text(format!("{} to {}", number(low), number(high))),
            Cell::measured(start.flip.clone(), ""),
            Cell::measured(end.flip.clone(), ""),
            Cell::measured(1e3 * clock.of(course.setup), "ms"),
            Cell::measured(end.cpu.clone(), "s"),
            Cell::measured(end.wall.clone(), "s"),
            Cell::text(format!("{}%", number(100.0 * course.share_of_reference))),
        ]);
    }
    chapter.tables.push(table);
}

/// The most efficient method compared with the second; noise if their intervals overlap.
pub(super) fn best(courses: &[&Course], clock: Clock) -> Option<String> {
    let mut ranked: Vec<_> = courses.iter().map(|course| (course, course.efficiency(clock))).collect();
    ranked.sort_by(|a, b| b.1.0.total_cmp(&a.1.0));
    let [(first, (efficiency, [low, _])), (second, (other, [_, high])), ..] = &ranked[..] else { return None };
    let ratio = number(efficiency / other);
    Some(if low > high {
        format!("{} is the most efficient, {ratio} times {}", first.name, second.name)
    } else {
        format!("{} and {} are equally efficient within noise ({ratio} times)", first.name, second.name)
    })
}

pub(super) fn mean(values: &[f64]) -> f64 {
    Samples::from(values.to_vec()).mean()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_samples_err_with_the_root_of_time_regardless_of_setup() {
        let samples = [1, 2, 4, 8, 16];
        // Seconds of five seeds that differ by 2 %, plus a set-up of half a sample.
        let of = |n: u32| Reached {
            cpu: (0..5).map(|seed| (0.5 + f64::from(n)) * (1.0 + 0.01 * f64::from(seed - 2))).collect(),
            wall: vec![f64::from(n); 5],
            mse: vec![1.0 / f64::from(n); 5],
            ..Reached::default()
        };
        let mut reached: Vec<Reached> = samples.map(of).into();
        let setup = subtract_setup(&samples, &mut reached);
        assert!((setup.cpu - 0.5).abs() < 1e-9 && setup.wall < 1e-9, "{setup:?}");
        let course = Course { name: String::new(), build: 0.0.into(), setup, reached, share_of_reference: 0.0 };
        let slopes = [course.slope(Clock::Processor, |reached| &reached.mse), course.slope_of_samples(&samples)];
        for slope in slopes.map(Result::unwrap) {
            assert!((slope.slope + 1.0).abs() < 1e-9, "{slope}");
        }
    }
}
