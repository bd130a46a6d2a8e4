//! Eight round segments at once: which of them a ray may come near, and where at the earliest.

use canted_trace::lanes::UNIT_ROUNDOFF as U;
use canted_trace::{RoundSegment, ScaledRay};

use super::block::norm;
use super::reach::{RayLine, Reached, dot};
use crate::simd::Simd;

/// How much of the squared radius counts: 9/8, and the roundings of the comparison.
const RADIUS: f32 = 1.126;

/// Nine times the squared error of the distance, relative to the sizes, and more; see [`RayLine::near_segments`].
pub(crate) const ERROR: f32 = 16384.0 * U * U;

/// More than all roundings of a position along the line, relative to the sizes.
const ALONG: f32 = 32.0 * U;

/// More than the roundings of a step along the line, relative to the length of a segment.
const STEP: f32 = 8.0 * U;

/// The greatest squared slant of segments whose nearest point bounds where a ray enters: 2^20.
const SLANTED: f32 = (1 << 20) as f32;

/// More than 1, by more than roundings of the vector across such a segment: 2^-10.
const WIDER: f32 = 1.0 + 1.0 / 1024.0;

/// Squares from here on lose nothing by underflow.
const LEAST: f32 = f32::from_bits((127 - 100) << 23);

/// How much nearer to the axis than the radius a line certainly enters a segment, relative to the sizes.
const CERTAIN: f32 = 64.0 * U;

/// How far in front of a plane a segment is, relative to twice the sizes.
const PLANE: f32 = 16.0 * U;

/// See [`ERROR`], [`ALONG`], [`CERTAIN`] and [`PLANE`].
const ERRORS: [f32; 4] = [ERROR, ALONG, CERTAIN, PLANE];

impl<S: Simd> RayLine<S> {
    /// For [`RayLine::near_segments`].
    #[inline(always)]
    pub(crate) fn to_segments(simd: S, ray: &ScaledRay) -> Self {
        Self::new(simd, ray, ERRORS)
    }

    /// Lanes whose round segment the ray may come near at `t_min <= t <= t_max`; rows as [`numbers`] has them.
    ///
    /// # Method
    /// Relative to the origin of the ray, let `f` be the first end, `a` the vector to the second one, `d` the direction, `m = f × d` and
    /// `c = a × d`. The point at `s` of the axis is `|m + s·c|/|d|` from the line, least at `s = -m·c/c²`, or at the nearer end. Where that exceeds
    /// the greater radius `r`, the line passes the segment. Along the line, the segment is between the ends, but for the radius.
    ///
    /// # Error
    /// Let `F`, `A` and `D` be the lengths of `f`, `a` and `d`, and `R = A·D/|c|`, which is at least 1. Two roundings of inputs and products and
    /// one of a difference put `m` off by 4.3 u·F·D and `c` by 4.3 u·A·D. So `m·c` is off by u·F·D·(7.4·|c| + 4.3·A·D), `c²` by
    /// u·|c|·(8.6·A·D + 3.1·|c|), and `s·|c|`, as far as it is between the ends, by u·D·(11.7·F·R + 13.6·A). The sum `m + s·c` is off by another
    /// 6.3 u·D·(F + A). In all its length exceeds the least one by at most `E = 24 u·D·R·(F + A)`, second order included: for R
    /// from 2^18 on, `E` exceeds every such vector, and no lane is skipped. With `2·(F² + A²)` for `(F + A)²`,
    /// `(r·D + E)² <= 9/8·r²·D² + 9·E²`, where 9·E² is at most 10368 u²·D²·R²·(F² + A²). The rest of [`ERROR`] is
    /// 18 u·R·(F + A) of distance, more than the test of a primitive may be off by. A ball, whose ends are equal, has `c = 0` and
    /// `s = 0`, and the same error with R = 1.
    ///
    /// A segment with `c²` below 2^-100 is kept, unless it is a ball. Then all squares but those of a point near the line are normal, and the smallest
    /// normal number that is added covers these. What overflows or is NaN is kept.
    ///
    /// A position along the line, `f·d` or `f·d + a·d`, is off by less than 6 u·D·(F + A), and the ends of the interval, which count only where
    /// they are as near, by 3 u of theirs; [`ALONG`] is more than both, and more than the test may be off by.
    ///
    /// # Where the ray enters
    /// A point of the segment on the line is within `r` of the point at some `s'` of the axis, whose position along the line is at most
    /// `r·D` beyond. That point is `(s' - s)·|c|/D` farther along the axis than the nearest one, at `s`, clamped or not: so that is at most
    /// `r`. With the errors of `s` and of the test, which `E` and the rest of [`ERROR`] hold, `(s' - s)²·c²` is at most the squared reach
    /// of the comparison. So the position is at least that at `s`, less the step along the line of `reach/|c|`, less `r·D`. Where R is at
    /// most 2^10, `|c|` is off by 2^-11.8, which [`WIDER`] exceeds; elsewhere, and where `c²` is below 2^-100, the nearer end bounds the
    /// entry alone. The position at `s` is off by less than 6 u·D·(F + A) again, and [`STEP`] covers the 6 u·A·D of the step.
    ///
    /// # Certain hits
    /// The line is `|m + s·c|/D` from the point at `s`, whatever `s` is, and 11 u·D·(F + A) covers the roundings of that; the test of a
    /// round segment may be off by 2 u·(F + A + r). So a line that is nearer than the lesser radius by [`CERTAIN`] of the sizes enters the
    /// segment, no later than at the point nearest to that at `s`, and it does so in its interval if the bound of the entry is not before
    /// `t_min`, and that point not beyond `t_max`.
    ///
    /// `may_exit` as in [`RayLine::near_balls`].
    #[inline(always)]
    pub(crate) fn near_segments(&self, simd: S, rows: [S::F; 8], of: u32, t_max: f32, may_exit: bool) -> Reached<S> {
        let [ax, ay, az, bx, by, bz, r0, r1] = rows;
        let [zero, one, tiny] = [0.0, 1.0, f32::MIN_POSITIVE].map(|x| simd.splat(x));
        let from_origin = self.relative(simd, [ax, ay, az]);
        let radius = simd.max(r0, r1);
        let axis = [simd.sub(bx, ax), simd.sub(by, ay), simd.sub(bz, az)];
        let (moment, across) = (self.across_line(simd, from_origin), self.across_line(simd, axis));
        let (across_squared, axis_squared) = (dot(simd, across, across), dot(simd, axis, axis));
        let squared = simd.splat(self.direction_squared);

        let recip = simd.div(one, simd.max(across_squared, simd.splat(LEAST)));
        let at = simd.sub(zero, simd.mul(dot(simd, moment, across), recip));
        let at = simd.min(simd.max(at, zero), one);
        let apart = [
            simd.mul_add(at, across[0], moment[0]),
            simd.mul_add(at, across[1], moment[1]),
            simd.mul_add(at, across[2], moment[2]),
        ];
        let apart = dot(simd, apart, apart);
        let slant = simd.max(simd.mul(simd.mul(axis_squared, squared), recip), one);
        let sizes = simd.mul(simd.add(dot(simd, from_origin, from_origin), axis_squared), self.errors[0]);
        let reach = simd.mul_add(simd.mul(radius, radius), simd.splat(RADIUS), simd.mul(sizes, slant));
        let reach = simd.add(simd.mul(reach, squared), tiny);
        let axis_size = norm(simd, axis);
        // A square that overflows leaves the first end alone.
        let is_finite = simd.le(across_squared, simd.splat(f32::MAX));
        let is_usable = is_finite & simd.lt(simd.splat(LEAST), across_squared) | simd.le(axis_size, zero);
        let near = of & !(simd.lt(reach, apart) & is_usable);
        if may_exit && near == 0 {
            return Reached::none(simd);
        }

        let (first, along) = (dot(simd, from_origin, self.direction), dot(simd, axis, self.direction));
        let second = simd.add(first, along);
        let size = simd.add(simd.add(norm(simd, from_origin), axis_size), radius);
        let pad = simd.mul(self.length, simd.add(radius, simd.mul(self.errors[1], size)));
        let pad = simd.add(pad, tiny);
        let is_before = simd.lt(simd.add(simd.max(first, second), pad), self.start);

        let step = simd.mul_add(simd.mul(self.length, axis_size), simd.splat(STEP), simd.abs(along));
        let aside = simd.mul(simd.sqrt(simd.mul(reach, recip)), simd.splat(WIDER));
        let nearest = simd.mul_add(at, along, first);
        let by_nearest = simd.sub(nearest, simd.mul(aside, step));
        let is_known = simd.pick(simd.splat(LEAST), across_squared, slant, simd.splat(f32::INFINITY));
        let by_ends = simd.min(first, second);
        // The second where the first is NaN.
        let from = simd.max(simd.pick(is_known, simd.splat(SLANTED), by_nearest, by_ends), by_ends);
        let reached = Reached { lanes: 0, certain: 0, from: simd.sub(from, pad), squared: self.direction_squared };
        let is_behind = self.is_behind(simd, [from_origin, self.relative(simd, [bx, by, bz])], axis, [r0, r1]);
        let lanes = near & !(is_before | is_behind) & reached.until(simd, t_max);

        let depth = simd.sub(simd.min(r0, r1), simd.mul(self.errors[2], size));
        let depth = simd.mul(depth, self.length);
        let is_inside = simd.lt(zero, depth) & simd.lt(simd.add(apart, tiny), simd.mul(depth, depth));
        let end = simd.splat(t_max * self.direction_squared);
        let is_within = simd.le(self.start, reached.from) & simd.le(simd.add(nearest, pad), end);
        Reached { lanes, certain: lanes & is_inside & is_within, ..reached }
    }

    /// Lanes whose segment is on one side of a plane, and the ray, from its origin on, on the other, as rays that leave a surface are
    /// beside what they start on.
    ///
    /// # Error
    /// Let `f` and `g` be the vectors to the ends, and `w` the one to a point of the axis, about that whose ball the ray's origin is
    /// nearest to. All points of the segment are beyond the origin along `w` if `w·f` exceeds `r0·|w|` and `w·g` exceeds `r1·|w|`, whatever
    /// `w` is; points of the ray are not if `w·d` is at most 0. A product is off by 4 u·|w|·F, as inputs and three sums are rounded,
    /// `r·|w|` by 4 u of itself, the test of a primitive by 3.5 u·(F + r)·|w|: all are less than 16 u of `|w|·(|f|₁ + |g|₁ + r)`, half of
    /// what [`PLANE`] has. `w·d` is off by 3 u·|w|·D. Where `|w|` times twice the sizes does not overflow, no product does. Where `w²` is
    /// above 2^-100, what underflows is less than the margin.
    #[inline(always)]
    fn is_behind(&self, simd: S, [f, g]: [[S::F; 3]; 2], axis: [S::F; 3], [r0, r1]: [S::F; 2]) -> u32 {
        let zero = simd.splat(0.0);
        let narrowing = simd.sub(r0, r1);
        let squared = simd.neg_mul_sub(narrowing, narrowing, simd.sub(zero, dot(simd, axis, axis)));
        let at = simd.div(simd.neg_mul_sub(r0, narrowing, dot(simd, f, axis)), squared);
        let at = simd.min(simd.max(at, zero), simd.splat(1.0));
        let w = [simd.mul_add(at, axis[0], f[0]), simd.mul_add(at, axis[1], f[1]), simd.mul_add(at, axis[2], f[2])];
        let w_squared = dot(simd, w, w);
        let length = simd.sqrt(w_squared);
        let sizes = simd.add(simd.add(norm(simd, f), norm(simd, g)), simd.max(r0, r1));
        let margin = simd.mul(simd.mul(length, simd.add(sizes, sizes)), self.errors[3]);
        let is_beyond = simd.lt(simd.mul_add(r0, length, margin), dot(simd, w, f))
            & simd.lt(simd.mul_add(r1, length, margin), dot(simd, w, g));
        let turn = simd.mul_add(simd.mul(length, self.length), simd.splat(4.0 * U), dot(simd, w, self.direction));
        is_beyond & simd.le(turn, zero) & simd.lt(simd.splat(LEAST), w_squared)
    }

    #[inline(always)]
    fn relative(&self, simd: S, [x, y, z]: [S::F; 3]) -> [S::F; 3] {
        [simd.sub(x, self.origin[0]), simd.sub(y, self.origin[1]), simd.sub(z, self.origin[2])]
    }

    /// The product of a vector with the direction.
    #[inline(always)]
    pub(super) fn across_line(&self, simd: S, v: [S::F; 3]) -> [S::F; 3] {
        let d = self.direction;
        [
            simd.mul_sub(v[1], d[2], simd.mul(v[2], d[1])),
            simd.mul_sub(v[2], d[0], simd.mul(v[0], d[2])),
            simd.mul_sub(v[0], d[1], simd.mul(v[1], d[0])),
        ]
    }
}

/// The numbers of a round segment: the coordinates of the first end, those of the second, the radii.
#[inline(always)]
pub(crate) fn numbers(segment: &RoundSegment) -> [f32; 8] {
    let RoundSegment { ends: [[ax, ay, az], [bx, by, bz]], radii: [r0, r1] } = *segment;
    [ax, ay, az, bx, by, bz, r0, r1]
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_trace::Ray;

    use super::*;
    use crate::SimdPath;
    use crate::simd::Task;

    /// Whether a ray up to `t_max` may come near a segment, and whether it certainly enters it, by a filter with these errors.
    struct Near<'a>(&'a RoundSegment, &'a ScaledRay, f32, [f32; 4]);

    impl Task for Near<'_> {
        type Output = [bool; 2];

        #[inline(always)]
        fn on<S: Simd>(self, simd: S) -> [bool; 2] {
            let Self(segment, ray, t_max, errors) = self;
            let line = RayLine::new(simd, ray, errors);
            let rows = numbers(segment).map(|x| simd.splat(x));
            let Reached { lanes, certain, .. } = line.near_segments(simd, rows, 0xff, t_max, true);
            let without_exit = line.near_segments(simd, rows, 0xff, t_max, false);
            assert_eq!([lanes, certain], [without_exit.lanes, without_exit.certain]);
            for may_exit in [true, false] {
                let none = line.near_segments(simd, rows, 0, t_max, may_exit);
                assert!(none.lanes == 0 && none.certain == 0, "no lanes, no answers");
            }
            [lanes, certain].map(|mask| {
                assert!(mask == 0 || mask == 0xff, "equal lanes have equal answers");
                mask != 0
            })
        }
    }

    /// Segments and balls of many forms and places, and rays that graze them or start on them, some of which end or begin at the hit.
    fn cases(n: usize) -> impl Iterator<Item = (RoundSegment, ScaledRay)> {
        let hits = |(segment, ray): &(RoundSegment, ScaledRay)| {
            let found = segment.span_scaled(ray);
            found.is_some_and(|[entry, exit]| ray.t_min <= exit.t && entry.t <= ray.t_max)
        };
        lines(n).filter(hits)
    }

    /// The same, and rays that pass them.
    fn lines(n: usize) -> impl Iterator<Item = (RoundSegment, ScaledRay)> {
        let mut rng = SplitMix64::new(11);
        let mut unit = move || (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0;
        (0..n).filter_map(move |i| {
            let scale = [1.0, 1e-6, 1e6, 1e-24, 1e13][i % 5];
            let offset = [0.0, 1.0, 1e4, 1e7][i / 5 % 4];
            let length = [1.0, 1e-3, 0.0, 1e-6][i / 20 % 4];
            let place = [unit() * offset, unit() * offset, unit() * offset];
            let a = [0, 1, 2].map(|k| scale * (place[k] + unit()));
            let b = [0, 1, 2].map(|k| a[k] + scale * length * unit());
            let radius = scale * [0.1, 1e-4, 0.0, 1e-7][i / 80 % 4];
            let mut segment = RoundSegment { ends: [a, b], radii: [radius, radius * unit().abs()] };
            // Towards a point of the surface, from near, far, or along the axis.
            let away = scale * [1.0, 1e3, 1e-2][i / 320 % 3];
            let mut origin = [0, 1, 2].map(|k| a[k] + away * unit());
            if i % 7 == 0 {
                origin = [0, 1, 2].map(|k| a[k] - 10.0 * (b[k] - a[k]) + radius * unit());
            }
            let target = [0, 1, 2].map(|k| a[k] + 0.5 * (b[k] - a[k]) + radius * unit());
            let mut direction = [0, 1, 2].map(|k| target[k] - origin[k]);
            if i % 6 == 5 {
                // On the lateral surface of a capsule, along it, across it or away from it.
                segment.radii[1] = radius;
                let [axis, aside] = [[0, 1, 2].map(|k| b[k] - a[k]), [unit(), unit(), unit()]];
                let across = [1, 2, 0].map(|k| axis[k] * aside[(k + 1) % 3] - axis[(k + 1) % 3] * aside[k]);
                let length = across.iter().map(|x| x * x).sum::<f32>().sqrt();
                let [along, away, s] = [unit(), [0.0, 1e-7, 1.0][i / 6 % 3] * unit(), unit().abs()];
                origin = [0, 1, 2].map(|k| a[k] + s * axis[k] + radius / length * across[k]);
                direction = [0, 1, 2].map(|k| along * axis[k] + away * scale / length * across[k]);
            }
            let mut ray = ScaledRay::new(&Ray::new(origin, direction))?;
            if let Some([entry, exit]) = segment.span_scaled(&ray) {
                match i % 11 {
                    0 => (ray.t_min, ray.t_max) = (0.0, entry.t.max(0.0)),
                    1 => (ray.t_min, ray.t_max) = (exit.t.max(0.0), f32::MAX),
                    _ => (),
                }
            }
            Some((segment, ray))
        })
    }

    /// Whether the test of the segment finds that the ray enters it in its interval.
    fn enters(segment: &RoundSegment, ray: &ScaledRay, t_max: f32) -> bool {
        segment.span_scaled(ray).is_some_and(|[entry, _]| ray.t_min <= entry.t && entry.t <= t_max)
    }

    #[test]
    fn rays_enter_what_they_certainly_enter() {
        let (mut n, mut n_certain) = (0, 0);
        for (segment, ray) in lines(400_000) {
            n += u32::from(enters(&segment, &ray, ray.t_max));
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let [is_near, is_certain] = path.available().run(Near(&segment, &ray, ray.t_max, ERRORS));
                assert!(is_near || !is_certain);
                n_certain += u32::from(is_certain && path == SimdPath::Scalar);
                assert!(!is_certain || enters(&segment, &ray, ray.t_max), "{}: {segment:?} {ray:?}", path.name());
            }
        }
        assert!(n_certain > 10_000 && n_certain < n, "{n_certain} certain of {n}");
    }

    #[test]
    fn without_its_error_they_do_not() {
        let [error, along, _, plane] = ERRORS;
        for certain in [0.0, -CERTAIN] {
            let is_wrong = |(segment, ray): &(RoundSegment, ScaledRay)| {
                let near = Near(segment, ray, ray.t_max, [error, along, certain, plane]);
                let [_, is_certain] = SimdPath::Scalar.available().run(near);
                is_certain && !enters(segment, ray, ray.t_max)
            };
            let n_wrong = lines(400_000).filter(is_wrong).count();
            assert!(n_wrong > 10, "{n_wrong} with {certain}");
        }
    }

    /// Rays that leave what they start beside do not wait for it.
    #[test]
    fn segments_that_rays_start_beside_are_skipped() {
        let mut rng = SplitMix64::new(14);
        let mut unit = || (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0;
        let (mut n, mut n_kept) = (0, 0);
        while n < 20_000 {
            let (a, s) = ([unit(), unit(), unit()], unit().abs());
            let b = a.map(|x| x + 0.3 * unit());
            let segment = RoundSegment { ends: [a, b], radii: [0.02, 0.02 + 0.01 * unit()] };
            let aside = [unit(), unit(), unit()];
            let origin = [0, 1, 2].map(|k| a[k] + s * (b[k] - a[k]) + 0.1 * aside[k]);
            let Some(ray) = ScaledRay::new(&Ray::new(origin, [unit(), unit(), unit()])) else { continue };
            // Beside the lateral surface, and away from it.
            let Some([entry, exit]) = segment.span_scaled(&ray) else { continue };
            if exit.t < -1e-4 && entry.u > 0.01 && exit.u > 0.01 && entry.u < 0.99 && exit.u < 0.99 {
                n += 1;
                let [is_near, _] = SimdPath::detect().available().run(Near(&segment, &ray, ray.t_max, ERRORS));
                n_kept += u32::from(is_near);
            }
        }
        assert!(n_kept < n / 4, "{n_kept} of {n}");
    }

    #[test]
    fn no_segment_that_a_ray_hits_is_skipped() {
        let (mut n, mut n_entered) = (0, 0);
        for (segment, ray) in cases(200_000) {
            n += 1;
            // Up to the end of the ray, and up to the hit itself.
            let [entry, exit] = segment.span_scaled(&ray).expect("the ray hits it");
            let first = if entry.t >= ray.t_min { entry.t } else { exit.t };
            n_entered += u32::from(first <= ray.t_max);
            let until = if first <= ray.t_max { first } else { ray.t_max };
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                for t_max in [ray.t_max, until] {
                    let [is_near, _] = path.available().run(Near(&segment, &ray, t_max, ERRORS));
                    assert!(is_near, "{}: {segment:?} {ray:?} up to {t_max}", path.name());
                }
            }
        }
        assert!(n > 50_000 && n_entered > 50_000, "{n} hits, {n_entered} in the interval");
    }

    #[test]
    fn without_the_errors_some_are() {
        let lost = |(segment, ray): &(RoundSegment, ScaledRay), errors| {
            let [entry, exit] = segment.span_scaled(ray).expect("the ray hits it");
            let first = if entry.t >= ray.t_min { entry.t } else { exit.t };
            !SimdPath::Scalar.available().run(Near(segment, ray, first.min(ray.t_max), errors))[0]
        };
        for (k, wrong) in [(0, 0.0), (1, 0.0), (3, -PLANE)] {
            let mut errors = ERRORS;
            errors[k] = wrong;
            let n_lost = cases(200_000).filter(|case| lost(case, errors)).count();
            assert!(n_lost > 100, "{n_lost} with {errors:?}");
        }
    }

    /// Behind the point where a ray enters a segment that it crosses, other ends are not waited for.
    #[test]
    fn segments_behind_a_hit_are_skipped() {
        let mut rng = SplitMix64::new(13);
        let mut unit = || (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0;
        let (mut n, mut n_kept) = (0, 0);
        while n < 20_000 {
            let (a, b) = ([unit(), unit(), unit()], [unit(), unit(), unit()]);
            let segment = RoundSegment { ends: [a, b], radii: [1e-3, 2e-3] };
            let target = [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
            let origin = [9.0 * unit(), 9.0 * unit(), 9.0 * unit()];
            let Some(ray) = ScaledRay::new(&Ray::new(origin, [0, 1, 2].map(|k| target[k] - origin[k]))) else {
                continue;
            };
            let Some([entry, _]) = segment.span_scaled(&ray) else { continue };
            if entry.t < ray.t_min {
                continue;
            }
            n += 1;
            n_kept += u32::from(SimdPath::detect().available().run(Near(&segment, &ray, entry.t - 0.02, ERRORS))[0]);
        }
        assert!(n_kept < n / 20, "{n_kept} of {n}");
    }

    #[test]
    fn most_segments_that_a_ray_misses_are_skipped() {
        let mut rng = SplitMix64::new(12);
        let mut unit = || (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0;
        let (mut n_missed, mut n_kept) = (0, 0);
        for _ in 0..20_000 {
            let a = [unit(), unit(), unit()];
            let segment = RoundSegment { ends: [a, a.map(|x| x + 0.1 * unit())], radii: [1e-3, 2e-3] };
            let target = a.map(|x| x + 0.1 * unit());
            let origin = [3.0 * unit(), 3.0 * unit(), 3.0 * unit()];
            let Some(ray) = ScaledRay::new(&Ray::new(origin, [0, 1, 2].map(|k| target[k] - origin[k]))) else {
                continue;
            };
            if segment.span_scaled(&ray).is_none() {
                n_missed += 1;
                n_kept += u32::from(SimdPath::detect().available().run(Near(&segment, &ray, ray.t_max, ERRORS))[0]);
            }
        }
        assert!(n_missed > 15_000 && n_kept < n_missed / 100, "{n_kept} of {n_missed}");
    }
}
