//! Eight balls at once: which of them a ray may hit, and where at the earliest.

use canted_trace::lanes::UNIT_ROUNDOFF as U;
use canted_trace::{ScaledRay, Sphere};

use super::block::norm;
use super::reach::{RayLine, Reached, dot};
use crate::simd::Simd;

/// How much nearer to the center than the radius a line certainly enters a ball, relative to the sizes.
const CERTAIN: f32 = 32.0 * U;

/// More than all roundings of the distance between a line and a center, and of a position along the line, relative to the sizes;
/// [`CERTAIN`]; none.
const ERRORS: [f32; 4] = [10.0 * U, 32.0 * U, CERTAIN, 0.0];

impl<S: Simd> RayLine<S> {
    /// For [`RayLine::near_balls`].
    #[inline(always)]
    pub(crate) fn to_balls(simd: S, ray: &ScaledRay) -> Self {
        Self::new(simd, ray, ERRORS)
    }

    /// Lanes whose ball the ray may hit at `t_min <= t <= t_max`; rows of the coordinates of the centers, and of the radii.
    ///
    /// # Method
    /// Let `m` be the vector from the ray's origin to the center, `d` the direction of the length `D`, `F` the length of `m` and `r` the
    /// radius. The line is `|m × d|/D` from the center; at the distance `h` it is in the ball for half a chord of `√((r - h)·(r + h))` on
    /// both sides of `m·d/D`.
    ///
    /// # Error
    /// Two roundings of inputs and products and one of a difference put `m × d` off by at most 4.3 u·F·D, its length `a` by 2.6 u more of
    /// itself, at most u·F·D each, the length of the direction by 5 u of `r·D`, which only makes it longer, and the test of a primitive by
    /// u·(F + r)·D. So with `e = 10 u·(|m|₁ + r)·D`, of which `|m|₁` is at least F, a hit has `r·D + e >= a`, and the chord, times D², is
    /// at most `√((r·D + e - a)·(r·D + e + a))` but for the 4 u of the root itself: the first factor is rounded to 2 u of `r·D + e`, which
    /// `e` has to spare. The position of the center, `m·d`, is off by less than 6 u·F·D, and the ends of the interval, which count only
    /// where they are as near, by 3 u of theirs; 32 u·(|m|₁ + r)·D is more than all of that, the root's share and what the test may be off
    /// by. [`TINY`] covers what underflows, also below the root; balls much smaller than it, in scaled coordinates, are all kept. What
    /// overflows or is NaN is kept.
    ///
    /// Squares are compared first, which is a rounding of the reach more and one of the distance less: `e` has both to spare.
    ///
    /// # Certain hits
    /// A line that is nearer than `r·D` by [`CERTAIN`] of the sizes passes through the ball: that is more than `e` and the 5 u of the
    /// length. It enters before the center, and so in its interval if the bound of the entry is not before `t_min`, and the center not
    /// beyond `t_max`.
    ///
    /// `may_exit` changes time alone: most leaves have no lane that is near the line, but where any hit will do, a branch that is not
    /// predicted takes longer than the rest. It was not measured for lists of all hits, which do without it, too.
    #[inline(always)]
    pub(crate) fn near_balls(
        &self,
        simd: S,
        [x, y, z, radius]: [S::F; 4],
        of: u32,
        t_max: f32,
        may_exit: bool,
    ) -> Reached<S> {
        let m = [simd.sub(x, self.origin[0]), simd.sub(y, self.origin[1]), simd.sub(z, self.origin[2])];
        let across = self.across_line(simd, m);
        let squared = dot(simd, across, across);
        let size = simd.mul(simd.add(norm(simd, m), radius), self.length);
        let tiny = simd.splat(TINY);
        let radius = simd.mul(radius, self.length);
        let reach = simd.add(radius, simd.mul_add(size, self.errors[0], tiny));
        // A square may overflow where the reach does not.
        let passes = simd.lt(simd.mul(reach, reach), squared) & simd.le(squared, simd.splat(f32::MAX));
        if may_exit && of & !passes == 0 {
            return Reached::none(simd);
        }

        let apart = simd.sqrt(squared);
        let gap = simd.max(simd.sub(reach, apart), simd.splat(0.0));
        let pad = simd.mul_add(size, self.errors[1], tiny);
        let half = simd.add(simd.sqrt(simd.mul(gap, simd.add(reach, apart))), pad);
        let center = dot(simd, m, self.direction);
        let is_before = simd.lt(simd.add(center, half), self.start);
        let reached = Reached { lanes: 0, certain: 0, from: simd.sub(center, half), squared: self.direction_squared };
        let lanes = of & !(passes | is_before) & reached.until(simd, t_max);

        let is_inside = simd.lt(simd.add(apart, simd.mul_add(size, self.errors[2], tiny)), radius);
        let end = simd.splat(t_max * self.direction_squared);
        let is_within = simd.le(self.start, reached.from) & simd.le(simd.add(center, pad), end);
        Reached { lanes, certain: lanes & is_inside & is_within, ..reached }
    }
}

/// The root of the smallest normal number, and more: 2^-62.
const TINY: f32 = f32::from_bits((127 - 62) << 23);

/// The numbers of a ball: the coordinates of the center, the radius.
#[inline(always)]
pub(crate) fn numbers_of_ball(&Sphere { center: [x, y, z], radius }: &Sphere) -> [f32; 4] {
    [x, y, z, radius]
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_trace::Ray;

    use super::*;
    use crate::SimdPath;
    use crate::simd::Task;

    /// Whether a ray up to `t_max` may hit a ball, and whether it certainly enters it, by a filter with these errors.
    struct Near<'a>(&'a Sphere, &'a ScaledRay, f32, [f32; 4]);

    impl Task for Near<'_> {
        type Output = [bool; 2];

        #[inline(always)]
        fn on<S: Simd>(self, simd: S) -> [bool; 2] {
            let Self(ball, ray, t_max, errors) = self;
            let line = RayLine::new(simd, ray, errors);
            let rows = numbers_of_ball(ball).map(|x| simd.splat(x));
            let Reached { lanes, certain, .. } = line.near_balls(simd, rows, 0xff, t_max, true);
            let without_exit = line.near_balls(simd, rows, 0xff, t_max, false);
            assert_eq!([lanes, certain], [without_exit.lanes, without_exit.certain]);
            [lanes, certain].map(|mask| {
                assert!(mask == 0 || mask == 0xff, "equal lanes have equal answers");
                mask != 0
            })
        }
    }

    /// Balls of many sizes and places, and rays that graze or pass them; some begin at a hit.
    fn lines(n: usize) -> impl Iterator<Item = (Sphere, ScaledRay)> {
        let mut rng = SplitMix64::new(17);
        let mut unit = move || (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0;
        (0..n).filter_map(move |i| {
            let scale = [1.0, 1e-6, 1e6, 1e-24, 1e13][i % 5];
            let offset = [0.0, 1.0, 1e4, 1e7][i / 5 % 4];
            let radius = scale * [0.1, 1e-4, 0.0, 1e-6, 100.0][i / 20 % 5];
            let center = [0, 1, 2].map(|_| scale * (offset * unit() + unit()));
            let ball = Sphere { center, radius };
            let away = scale * [1.0, 1e3, 1e-2, 0.0][i / 100 % 4];
            let mut origin = [0, 1, 2].map(|k| center[k] + away * unit() + radius * unit());
            if i % 9 == 0 {
                origin = [-0.0; 3];
            }
            // Towards the silhouette.
            let to_center = [0, 1, 2].map(|k| center[k] - origin[k]);
            let aside = [unit(), unit(), unit()];
            let along = (0..3).map(|k| aside[k] * to_center[k]).sum::<f32>()
                / to_center.iter().map(|x| x * x).sum::<f32>().max(f32::MIN_POSITIVE);
            let across = [0, 1, 2].map(|k| aside[k] - along * to_center[k]);
            let length = across.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-6);
            let graze = [0.0, 1.0, 1.0 - 1e-6, unit()][i / 400 % 4];
            let stretch = [1.0, 1e-20, 1e10][i % 3];
            let direction = [0, 1, 2].map(|k| stretch * (to_center[k] + graze * radius / length * across[k]));
            let mut ray = ScaledRay::new(&Ray::new(origin, direction))?;
            if i % 11 == 0
                && let Some([_, exit]) = ball.roots_scaled(&ray)
            {
                (ray.t_min, ray.t_max) = (exit.max(0.0), f32::MAX);
            }
            Some((ball, ray))
        })
    }

    /// Those that hit their balls, and the `t` of the hit.
    fn cases(n: usize) -> impl Iterator<Item = (Sphere, ScaledRay, f32)> {
        lines(n).filter_map(|(ball, ray)| {
            let [entry, exit] = ball.roots_scaled(&ray)?;
            let first = if entry >= ray.t_min { entry } else { exit };
            (ray.t_min <= first && first <= ray.t_max).then_some((ball, ray, first))
        })
    }

    /// Whether the test of the ball finds that the ray enters it in its interval.
    fn enters(ball: &Sphere, ray: &ScaledRay) -> bool {
        ball.roots_scaled(ray).is_some_and(|[entry, _]| ray.t_min <= entry && entry <= ray.t_max)
    }

    #[test]
    fn rays_enter_what_they_certainly_enter() {
        let (mut n, mut n_certain) = (0, 0);
        for (ball, ray) in lines(300_000) {
            n += u32::from(enters(&ball, &ray));
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let [is_near, is_certain] = path.available().run(Near(&ball, &ray, ray.t_max, ERRORS));
                assert!(is_near || !is_certain);
                n_certain += u32::from(is_certain && path == SimdPath::Scalar);
                assert!(!is_certain || enters(&ball, &ray), "{}: {ball:?} {ray:?}", path.name());
            }
        }
        assert!(n_certain > 10_000 && n_certain < n, "{n_certain} certain of {n}");
    }

    #[test]
    fn without_its_error_they_do_not() {
        for certain in [0.0, -CERTAIN] {
            let is_wrong = |(ball, ray): &(Sphere, ScaledRay)| {
                let near = Near(ball, ray, ray.t_max, [ERRORS[0], ERRORS[1], certain, 0.0]);
                SimdPath::Scalar.available().run(near)[1] && !enters(ball, ray)
            };
            let n_wrong = lines(300_000).filter(is_wrong).count();
            assert!(n_wrong > 10, "{n_wrong} with {certain}");
        }
    }

    #[test]
    fn no_ball_that_a_ray_hits_is_skipped() {
        let mut n = 0;
        for (ball, ray, first) in cases(300_000) {
            n += 1;
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                for t_max in [ray.t_max, first] {
                    let [is_near, _] = path.available().run(Near(&ball, &ray, t_max, ERRORS));
                    assert!(is_near, "{}: {ball:?} {ray:?} up to {t_max}", path.name());
                }
            }
        }
        assert!(n > 100_000, "{n} hits");
    }

    /// The error of the distance makes chords longer, so that of the position counts without it.
    #[test]
    fn without_the_errors_some_are() {
        let n_lost = |errors: [f32; 4]| {
            let lost = |(ball, ray, first): &(Sphere, ScaledRay, f32)| {
                !SimdPath::Scalar.available().run(Near(ball, ray, *first, errors))[0]
            };
            cases(300_000).filter(lost).count()
        };
        let [without_distance, without_both] = [n_lost([0.0, ERRORS[1], 0.0, 0.0]), n_lost([0.0; 4])];
        assert!(without_distance > 100 && without_both > without_distance, "{without_distance}, {without_both}");
    }

    #[test]
    fn what_a_ray_misses_or_reaches_later_is_skipped() {
        let mut rng = SplitMix64::new(18);
        let mut unit = || (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0;
        let (mut n, mut n_kept) = ([0; 2], [0; 2]);
        for _ in 0..40_000 {
            let ball = Sphere { center: [unit(), unit(), unit()], radius: 0.05 };
            let target = ball.center.map(|x| x + 0.08 * unit());
            let origin = [3.0 * unit(), 3.0 * unit(), 3.0 * unit()];
            let Some(ray) = ScaledRay::new(&Ray::new(origin, [0, 1, 2].map(|k| target[k] - origin[k]))) else {
                continue;
            };
            let (is_hit, t_max) = match ball.roots_scaled(&ray) {
                Some([entry, _]) if entry > 0.1 => (true, entry - 1e-4),
                Some(_) => continue,
                None => (false, ray.t_max),
            };
            n[usize::from(is_hit)] += 1;
            let [is_near, _] = SimdPath::detect().available().run(Near(&ball, &ray, t_max, ERRORS));
            n_kept[usize::from(is_hit)] += u32::from(is_near);
        }
        assert!((0..2).all(|k| n[k] > 5000 && n_kept[k] < n[k] / 100), "{n_kept:?} of {n:?}");
    }
}
