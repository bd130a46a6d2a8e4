//! Several ways to make one picture, in turn, and the errors that each reaches.

use anyhow::Result;
use canted_renderer::{Film, PIXELS_PER_DEGREE, Settings, flip};

use super::reference::{Errors, Reference};
use crate::clock::{self, Seconds};
use crate::report::{
    fits::{self, Line, Unfit},
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, number},
};

/// Makes a picture by its settings.
type Render<'a> = dyn Fn(&Settings) -> Result<Film> + 'a;

/// A way to make the picture.
pub(super) struct Racer<'a> {
    pub(super) name: String,
    pub(super) reference: &'a Reference,
    /// Added to the seconds where building counts.
    pub(super) build: &'a Samples,
    /// Of the picture, but for its number of samples and its seed.
    pub(super) settings: Settings,
    pub(super) render: Box<Render<'a>>,
}

/// What plots and efficiencies take for the seconds of sampling where the set-up seems to have taken all.
const LEAST_SECONDS: f64 = 1e-6;

/// What one racer reached at one number of samples: an entry a seed.
#[derive(Default)]
pub(super) struct Reached {
    pub(super) wall: Vec<f64>,
    pub(super) cpu: Vec<f64>,
    pub(super) mse: Vec<f64>,
    rel_mse: Vec<f64>,
    flip: Vec<f64>,
}

/// What one racer reached, by number of samples.
pub(super) struct Course {
    pub(super) name: String,
    build: Samples,
    /// What a render spends before its first sample.
    setup: Vec<Seconds>,
    pub(super) reached: Vec<Reached>,
    share_of_reference: f64,
}

/// Runs all racers over all numbers of samples and all seeds, in turn.
pub(super) fn race(racers: &[Racer<'_>], samples: &[u32], n_seeds: u32) -> Result<Vec<Course>> {
    let empty = || samples.iter().map(|_| Reached::default()).collect();
    let mut reached: Vec<Vec<Reached>> = racers.iter().map(|_| empty()).collect();
    let mut setups = vec![vec![]; racers.len()];
    for racer in racers {
        (racer.render)(&racer.settings)?;
    }
    for seed in 0..n_seeds {
        for (racer, setups) in racers.iter().zip(&mut setups) {
            let settings = Settings { width: 1, height: 1, samples: 1, seed, ..racer.settings };
            let (film, took) = clock::time_all(|| (racer.render)(&settings));
            film?;
            setups.push(took);
        }
        for (k, &n) in samples.iter().enumerate() {
            for (racer, reached) in racers.iter().zip(&mut reached) {
                let settings = Settings { samples: n, seed, ..racer.settings };
                let (film, took) = clock::time_all(|| (racer.render)(&settings));
                reached[k].add(took, &film?, racer.reference)?;
            }
        }
    }
    let courses = racers.iter().zip(reached).zip(setups).map(|((racer, mut reached), setup)| {
        for reached in &mut reached {
            reached.leave_out(&setup);
        }
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

    /// Takes the median of the set-up from all seconds; where it varies more than sampling takes, less than nothing is left.
    fn leave_out(&mut self, setup: &[Seconds]) {
        for (clock, seconds) in [(Clock::Wall, &mut self.wall), (Clock::Processor, &mut self.cpu)] {
            let setup = clock.of(setup).median();
            seconds.iter_mut().for_each(|seconds| *seconds -= setup);
        }
    }
}

/// Which clock a race is shown by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Clock {
    /// Seconds of the processor, all threads together.
    Processor,
    /// Seconds that pass, where part of the work is a device's.
    Wall,
}

impl Clock {
    fn seconds(self, reached: &Reached) -> Samples {
        match self {
            Self::Processor => reached.cpu.clone().into(),
            Self::Wall => reached.wall.clone().into(),
        }
    }

    fn of(self, seconds: &[Seconds]) -> Samples {
        let pick = |seconds: &Seconds| if self == Self::Wall { seconds.wall } else { seconds.cpu };
        seconds.iter().map(pick).collect::<Vec<_>>().into()
    }

    fn label(self) -> &'static str {
        match self {
            Self::Processor => "processor seconds",
            Self::Wall => "seconds",
        }
    }
}

impl Course {
    /// Efficiency at the most samples, and the interval that its seeds leave it.
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

    fn series(&self, clock: Clock, with_build: bool, samples: &[u32], error: Pick) -> Series {
        let build = if with_build { self.build.median() + clock.of(&self.setup).median() } else { 0.0 };
        let point = |(&n, reached): (&u32, &Reached)| Point {
            label: format!("{n} samples"),
            x: clock.seconds(reached).values().iter().map(|x| x.max(LEAST_SECONDS) + build).collect::<Vec<_>>().into(),
            y: error(reached).clone().into(),
        };
        let points = samples.iter().zip(&self.reached).map(point).collect();
        Series { name: self.name.clone(), points, is_joined: true }
    }
}

/// One of the errors that were reached.
type Pick = fn(&Reached) -> &Vec<f64>;

/// Adds a race's plots and table: relMSE and MSE, without and with the time of the build.
pub(super) fn show(chapter: &mut Chapter, what: &str, courses: &[Course], samples: &[u32], clock: Clock) {
    const REL_MSE: (&str, Pick) = ("relMSE", |reached| &reached.rel_mse);
    const MSE: (&str, Pick) = ("MSE", |reached| &reached.mse);
    for ((error, pick), with_build) in [(REL_MSE, false), (MSE, false), (REL_MSE, true), (MSE, true)] {
        let series = courses.iter().map(|course| course.series(clock, with_build, samples, pick)).collect();
        let build = if with_build { ", set-up and build included" } else { "" };
        chapter.plots.push(Plot {
            title: format!("{what}: {error} over {}{build}", clock.label()),
            x: Axis::log(format!("{}{build}", clock.label())),
            y: Axis::log(error),
            series,
        });
    }
    let (first, last) = (samples[0], samples[samples.len() - 1]);
    let (head_first, head_last) = (format!("FLIP at {first}"), format!("FLIP at {last}"));
    let mut table = Table::new(
        format!("{what}: how error falls"),
        &[
            "method",
            "relMSE ~ time^",
            "MSE ~ time^",
            "1/(MSE s)",
            "95% interval",
            &head_first,
            &head_last,
            "set-up",
            "cpu at most",
            "wall at most",
            "reference's share",
        ],
    );
    for course in courses {
        let slope = |error: Pick| Cell::text(fits::told(course.slope(clock, error)));
        let (efficiency, [low, high]) = course.efficiency(clock);
        let (start, end) = (&course.reached[0], &course.reached[course.reached.len() - 1]);
        table.rows.push(vec![
            Cell::text(course.name.clone()),
            slope(|reached| &reached.rel_mse),
            slope(|reached| &reached.mse),
            Cell::text(number(efficiency)),
            Cell::text(format!("{} to {}", number(low), number(high))),
            Cell::measured(start.flip.clone(), ""),
            Cell::measured(end.flip.clone(), ""),
            Cell::measured(clock.of(&course.setup).scaled(1e3), "ms"),
            Cell::measured(end.cpu.clone(), "s"),
            Cell::measured(end.wall.clone(), "s"),
            Cell::text(format!("{}%", number(100.0 * course.share_of_reference))),
        ]);
    }
    chapter.tables.push(table);
}

/// The most efficient course and how it compares with another: with words of noise where their intervals meet.
pub(super) fn best(courses: &[&Course], clock: Clock) -> Option<String> {
    let mut ranked: Vec<_> = courses.iter().map(|course| (course, course.efficiency(clock))).collect();
    ranked.sort_by(|a, b| b.1.0.total_cmp(&a.1.0));
    let [(first, (efficiency, [low, _])), (second, (other, [_, high])), ..] = &ranked[..] else { return None };
    let ratio = number(efficiency / other);
    Some(if low > high {
        format!("{} is the most efficient, {ratio} times {}", first.name, second.name)
    } else {
        format!("{} and {} are as efficient as each other but for noise ({ratio} times)", first.name, second.name)
    })
}

pub(super) fn mean(values: &[f64]) -> f64 {
    Samples::from(values.to_vec()).mean()
}
