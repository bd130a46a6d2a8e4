use canted_obb::vector::{cross, dot, to_f64};
use canted_obb::{Affine, round::U as U64};
use canted_trace::{ObjectRay, WorldRay};

use crate::instance::{Columns, Rows, invert, row_sum_norm};

/// The transform of a moving instance: `M(s) = open + s·change`, for times `s` in `[0, 1]`.
///
/// Every entry of the matrix is a linear function of time.
#[derive(Clone, Debug)]
pub struct Motion {
    open: Columns,
    change: Columns,
}

impl Motion {
    /// The motion between two `world_from_object` transforms: at the opening and at the closing of the shutter.
    #[must_use]
    pub fn new(open: &Affine, close: &Affine) -> Self {
        let [open, close] = [open, close].map(|map| map.columns.map(|column| column.map(f64::from)));
        Self { open, change: zip(open, close, |open, close| close - open) }
    }

    /// Columns of the transform that rays of this time see, computed in `f64`. Times are clamped to `[0, 1]`; NaN is 0.
    #[inline]
    #[must_use]
    pub fn world_from_object(&self, time: f32) -> [[f64; 3]; 4] {
        self.at(within_shutter(time))
    }

    /// The inverse at a time, computed in `f64`. Times are clamped to `[0, 1]`; NaN is 0. [`Motion::residual`] bounds its error.
    #[inline]
    pub(crate) fn object_from_world(&self, time: f32) -> Rows {
        self.inverse(within_shutter(time))
    }

    /// The world ray in object space, at its time, up to the scaled `t_max`. `None` where its interval is empty.
    pub(crate) fn ray_object(&self, ray: &WorldRay<'_>, t_max: f64) -> Option<ObjectRay> {
        let rows = self.object_from_world(ray.ray.time);
        let linear = |v: [f32; 3]| rows.map(|[x, y, z, _]| dot([x, y, z], to_f64(v)));
        let (origin, direction) = (linear(ray.ray.origin), linear(ray.ray.direction));
        ray.in_object(std::array::from_fn(|k| origin[k] + rows[k][3]), direction, t_max)
    }

    #[inline]
    fn inverse(&self, time: f64) -> Rows {
        invert(&self.at(time))
    }

    #[inline]
    fn at(&self, time: f64) -> Columns {
        zip(self.open, self.change, |open, change| open + time * change)
    }

    /// A bound φ of `‖I - M·X‖` in the greatest-row-sum norm, for the computed inverse `X` of the linear part `M` at any time,
    /// where `condition` is the greatest `‖M‖` times the greatest `‖M⁻¹‖` of the motion.
    ///
    /// Let u = 2⁻⁵³, μ the greatest entry of `M`, and `A = adj(M)`. A cofactor is a difference of two products: it is at most 2μ²,
    /// and off by at most 3u·2μ². A row of `M·ΔA` then sums to at most `3·3·6u·μ³ = 54u·μ³`. The determinant is a sum of three
    /// products `a·A` and off by `3·(3u·2μ³ + 6u·μ³) = 36u·μ³`. The computed inverse is `(A + ΔA)/(det + δ)` but for two more
    /// roundings of entries of `A/det`, whose rows sum to at most `‖M⁻¹‖`: in all `‖I - M·X‖ <= 92u·μ³/|det| + 3u·‖M‖·‖M⁻¹‖` with
    /// second order. With singular values σ, `μ <= σ₁`, and `|det| >= σ₁·σ₃²`, so `μ³/|det| <= (σ₁/σ₃)²`; as each 2-norm is at most
    /// √3 times the row-sum norm, that is at most `9·condition²`: `832u·condition²` covers both terms. The entries of `M` take
    /// three roundings, which is within the slack.
    pub(crate) fn residual(condition: f64) -> f64 {
        832.0 * U64 * condition * condition
    }

    /// A bound of `‖M(s)⁻¹‖` over all times, the greatest row sum, at most 4/3 of the greatest value.
    ///
    /// Times are halved into intervals until each has a bound that is at most 4/3 of the norm at some time: [`Interval::bound`].
    /// An interval whose bound does not come that close however narrow it is contains a time at which the map is singular
    /// up to rounding.
    ///
    /// # Errors
    /// A time at which the norm is above `limit` or not finite, and the norm.
    pub(crate) fn norm_of_inverse(&self, limit: f64) -> Result<f64, (f64, f64)> {
        self.norm_of_inverse_in(limit, &mut 0)
    }

    /// [`Motion::norm_of_inverse`], with the number of intervals that it took.
    fn norm_of_inverse_in(&self, limit: f64, n_intervals: &mut u32) -> Result<f64, (f64, f64)> {
        let mut least = 0.0_f64;
        for end in [0.0, 1.0] {
            least = least.max(within(end, row_sum_norm(&self.inverse(end)), limit)?);
        }
        let mut bound = least;
        // Ends of intervals, exact in f64.
        let mut waiting = vec![(0.0, 1.0)];
        while let Some((start, end)) = waiting.pop() {
            *n_intervals += 1;
            let of_interval = Interval::new(&self.at(start), &self.at(end)).bound();
            if of_interval <= TIGHT * least {
                bound = bound.max(of_interval);
                continue;
            }
            let midpoint = 0.5 * (start + end);
            least = least.max(within(midpoint, row_sum_norm(&self.inverse(midpoint)), limit)?);
            if end - start < NARROWEST {
                return Err((midpoint, of_interval));
            }
            waiting.extend([(midpoint, end), (start, midpoint)]);
        }
        Ok(bound)
    }
}

/// How far a bound may exceed a norm that occurs.
const TIGHT: f64 = 4.0 / 3.0;

/// Width below which the map changes by less than 2⁻⁸ of itself: `‖M⁻¹‖·‖change‖ <= 2·MAX_CONDITION`.
const NARROWEST: f64 = 1.0 / (1u64 << 29) as f64;

/// The time of a ray, clamped to `[0, 1]`; NaN becomes 0.
#[inline]
#[expect(clippy::manual_clamp, reason = "clamp returns NaN for NaN")]
fn within_shutter(time: f32) -> f64 {
    f64::from(time.max(0.0).min(1.0))
}

/// `norm`; an error with the time if it is above `limit` or infinite.
fn within(time: f64, norm: f64, limit: f64) -> Result<f64, (f64, f64)> {
    if norm <= limit && norm.is_finite() { Ok(norm) } else { Err((time, norm)) }
}

fn zip(a: Columns, b: Columns, f: impl Fn(f64, f64) -> f64) -> Columns {
    std::array::from_fn(|i| std::array::from_fn(|k| f(a[i][k], b[i][k])))
}

/// Rounding of a determinant of three columns, and the average of three such, relative to the cube of the greatest entry: 36 of
/// 2⁻⁵³ in the determinant (see `Motion::residual`) and four in the average of terms of at most 6.
const DETERMINANT_ERROR: f64 = 64.0 * U64;

/// Rounding of a cofactor, and the average of two such, relative to the square of the greatest entry.
const COFACTOR_ERROR: f64 = 16.0 * U64;

/// Two maps, and all between them: bounds of the inverse of a map that changes linearly.
///
/// Between two maps `P` and `Q`, `M = (1 - τ)·P + τ·Q`. A cofactor of `M` is a polynomial of degree two in τ, the determinant one of
/// degree three. In the Bernstein basis their coefficients are the multilinear forms themselves, with columns taken from
/// `P` and `Q` and averaged, and a polynomial lies between its least and its greatest coefficient (Farin 2002, chapter 5). They are
/// computed from the maps at both ends of the interval, so that rounding is relative to the entries there.
struct Interval<'a> {
    ends: [&'a Columns; 2],
    /// Greatest entry of the linear parts of both.
    greatest: f64,
}

impl<'a> Interval<'a> {
    fn new(start: &'a Columns, end: &'a Columns) -> Self {
        let entries = [start, end].into_iter().flat_map(|map| map[..3].as_flattened());
        Self { ends: [start, end], greatest: entries.fold(0.0, |most, x| most.max(x.abs())) }
    }

    /// A bound of the greatest row sum of the inverse of every map between; infinite where the determinant may be zero.
    ///
    /// `M⁻¹ = adj(M)/det(M)`: the greatest absolute coefficients of the cofactors over the least absolute one of the determinant.
    fn bound(&self) -> f64 {
        let greatest = self.greatest;
        let determinants = self.determinants();
        let (least, most) = determinants.iter().fold((f64::MAX, f64::MIN), |(lo, hi), &x| (lo.min(x), hi.max(x)));
        let error = DETERMINANT_ERROR * greatest * greatest * greatest;
        let determinant = least.max(-most) - error;
        if determinant.is_nan() || determinant <= 0.0 {
            return f64::INFINITY;
        }
        let error = COFACTOR_ERROR * greatest * greatest;
        let row = |i: usize| -> f64 { self.cofactors((i + 1) % 3, (i + 2) % 3).iter().map(|x| x + error).sum() };
        // The sums and the quotient take fewer than eight roundings.
        row(0).max(row(1)).max(row(2)) / determinant * (1.0 + 8.0 * U64)
    }

    /// The Bernstein coefficients of the determinant.
    fn determinants(&self) -> [f64; 4] {
        let determinant = |x: usize, y: usize, z: usize| {
            let [a, b, c] = [self.ends[x][0], self.ends[y][1], self.ends[z][2]];
            dot(a, cross(b, c))
        };
        [
            determinant(0, 0, 0),
            (determinant(1, 0, 0) + determinant(0, 1, 0) + determinant(0, 0, 1)) / 3.0,
            (determinant(0, 1, 1) + determinant(1, 0, 1) + determinant(1, 1, 0)) / 3.0,
            determinant(1, 1, 1),
        ]
    }

    /// The greatest absolute Bernstein coefficient of each component of the cross product of two columns: a row of the adjugate.
    fn cofactors(&self, i: usize, j: usize) -> [f64; 3] {
        let [p, q] = self.ends;
        let (first, last) = (cross(p[i], p[j]), cross(q[i], q[j]));
        let (a, b) = (cross(p[i], q[j]), cross(q[i], p[j]));
        std::array::from_fn(|k| first[k].abs().max(last[k].abs()).max((0.5 * (a[k] + b[k])).abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotated(angle: f64, scale: [f64; 3], shift: [f32; 3]) -> Affine {
        let column = |c: [f64; 3], s: f64| c.map(|x| (x * s) as f32);
        let (sine, cosine) = angle.sin_cos();
        let columns = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]];
        let [x, y, z] = std::array::from_fn(|i| column(columns[i], scale[i]));
        Affine { columns: [x, y, z, shift] }
    }

    /// The norm at a hundred thousand times never exceeds the bound, and reaches three quarters of it.
    #[test]
    fn inverses_are_bounded_at_all_times() {
        for angle in [0.0, 0.3, 1.0, 1.57, 2.5] {
            for scale in [[1.0; 3], [1.0, 2.0, 0.1], [-1.0, 1.0, 1e3], [1e-3, 1e-3, 1e-3], [1.0, 1.0, 1e-5]] {
                // Between a mirror image and a rotation the map is singular at some time, so both ends have the same determinant sign.
                let open = rotated(0.2, scale.map(f64::signum), [0.0; 3]);
                let motion = Motion::new(&open, &rotated(0.2 + angle, scale, [1e7; 3]));
                let bound = motion.norm_of_inverse(1e12).unwrap();
                let times = (0..=100_000).map(|i| f64::from(i) / 100_000.0);
                let greatest = times.map(|time| row_sum_norm(&motion.inverse(time))).fold(0.0, f64::max);
                assert!(greatest <= bound && bound <= 1.34 * greatest, "{angle} {scale:?}: {greatest} {bound}");
            }
        }
    }

    #[test]
    fn times_outside_the_shutter_are_clamped() {
        let (open, close) = (rotated(0.2, [1.0; 3], [0.0; 3]), rotated(1.2, [3.0, 1.0, 0.5], [1e3; 3]));
        let motion = Motion::new(&open, &close);
        let columns = |map: &Affine| map.columns.map(|column| column.map(f64::from));
        for time in [0.0, -0.0, -1.0, f32::NEG_INFINITY, f32::NAN] {
            assert_eq!(motion.world_from_object(time), columns(&open), "{time}");
        }
        for time in [1.0, 2.0, f32::INFINITY] {
            let off = zip(motion.world_from_object(time), columns(&close), |a, b| (a - b).abs());
            assert!(off.as_flattened().iter().all(|&off| off <= 1e3 * f64::EPSILON), "{time}: {off:?}");
        }
        let [half, full] = [0.5, 1.0].map(|time| motion.world_from_object(time)[3][0]);
        assert_eq!(half, 0.5 * full);
        assert_eq!(motion.object_from_world(0.5), invert(&motion.world_from_object(0.5)));
    }

    #[test]
    fn half_a_turn_is_singular_at_half_time() {
        let motion = Motion::new(&Affine::IDENTITY, &rotated(std::f64::consts::PI, [1.0; 3], [0.0; 3]));
        let (time, norm) = motion.norm_of_inverse(1e6).unwrap_err();
        assert!(time == 0.5 && norm > 1e6, "{time} {norm}");
    }

    /// Halving of intervals finds a singular map at any time, not only at simple fractions.
    #[test]
    fn a_singular_map_at_any_time_is_found() {
        // The norm is one over the scale, which falls at a rate of at least 1; the closing transform is rounded once.
        const LIMIT: f64 = 1e6;
        let bound = 1.0 / LIMIT + 0.5 * f64::from(f32::EPSILON);
        for singular_at in [0.1, 1.0 / 3.0, 0.77, 0.999] {
            let close = ((singular_at - 1.0) / singular_at) as f32;
            let close = Affine { columns: [[close, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] };
            let (time, norm) = Motion::new(&Affine::IDENTITY, &close).norm_of_inverse(LIMIT).unwrap_err();
            assert!((time - singular_at).abs() <= bound && norm > LIMIT, "{time} for {singular_at}: {norm}");
        }
    }

    fn shear(by: f32) -> Affine {
        Affine { columns: [[1.0, 0.0, 0.0], [by, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] }
    }

    /// A shear of condition 2^19 took half a million intervals of the bound by `‖M⁻¹·change‖`; each takes about 0.2 µs.
    #[test]
    fn few_intervals_bound_any_motion() {
        let long = 724.0;
        let flat = rotated(0.0, [1.0, 1.0, 2e-6], [0.0; 3]);
        let thin = rotated(0.3, [1.0, 2e-6, 2e-6], [1e7, 0.0, 0.0]);
        let motions = [
            (shear(long), shear(-long)),
            (shear(long), shear(1.5)),
            (Affine::IDENTITY, flat),
            (flat, rotated(0.9, [1.0, 2e-6, 1.0], [0.0; 3])),
            (thin, rotated(0.5, [1.0, 2e-6, 2e-6], [0.0; 3])),
            (thin, rotated(3.0, [2e-6, 1.0, 2e-6], [0.0; 3])),
            (Affine::IDENTITY, rotated(std::f64::consts::PI - 4e-6, [1.0; 3], [0.0; 3])),
            (rotated(0.0, [1e-15, 1e-15, 2e-21], [0.0; 3]), rotated(0.4, [1e-15; 3], [0.0; 3])),
        ];
        for (open, close) in motions {
            let motion = Motion::new(&open, &close);
            let mut n_intervals = 0;
            let result = motion.norm_of_inverse_in(f64::MAX, &mut n_intervals);
            assert!(n_intervals <= 300, "{n_intervals} intervals: {open:?} {close:?}");
            if let Ok(bound) = result {
                let times = (0..=10_000).map(|i| f64::from(i) / 10_000.0);
                let greatest = times.map(|time| row_sum_norm(&motion.inverse(time))).fold(0.0, f64::max);
                assert!(greatest <= bound, "{greatest} {bound}: {open:?} {close:?}");
            }
        }
    }

    /// The residual of computed inverses is within the bound; where columns are almost parallel it is far above 2^-29.
    #[test]
    fn inverses_are_as_good_as_stated() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from(u32::try_from(state >> 32).expect("32 bits")) / f64::from(u32::MAX) - 0.5
        };
        let mut greatest = 0.0_f64;
        for thin in [1e-1, 1e-3, 1e-5, 1e-5, 1e-5, 1e-5] {
            // Columns along one direction but for `thin`.
            let mut map = || {
                let direction = [(); 3].map(|()| next());
                let column =
                    |length: f64, next: &mut dyn FnMut() -> f64| direction.map(|d| (length * d + thin * next()) as f32);
                Affine { columns: [column(1.0, &mut next), column(-0.7, &mut next), column(0.4, &mut next), [0.0; 3]] }
            };
            let motion = Motion::new(&map(), &map());
            for step in 0..=1000 {
                let time = f64::from(step) / 1000.0;
                let (columns, inverse) = (motion.at(time), motion.inverse(time));
                let by_rows = std::array::from_fn(|k| [columns[0][k], columns[1][k], columns[2][k], 0.0]);
                let condition = row_sum_norm(&by_rows) * row_sum_norm(&inverse);
                let residual: [[f64; 4]; 3] = std::array::from_fn(|k| {
                    std::array::from_fn(|j| {
                        let product: f64 = (0..3).map(|l| columns[l][k] * inverse[l][j]).sum();
                        if j < 3 { product - f64::from(u8::from(j == k)) } else { 0.0 }
                    })
                });
                let residual = row_sum_norm(&residual);
                // Computing the residual adds a few roundings relative to the condition.
                assert!(residual <= Motion::residual(condition) + 8.0 * U64 * condition, "{thin} {time}: {residual:e}");
                greatest = greatest.max(if condition <= 1_048_576.0 { residual } else { 0.0 });
            }
        }
        assert!(greatest > 2.0_f64.powi(-29), "{greatest:e}: worse inverses occur");
    }
}
