use canted_obb::Affine;

/// Columns of an affine map in `f64`.
type Columns = [[f64; 3]; 4];

/// Rows of the inverse of an affine map, each with its translation last.
type Rows = [[f64; 4]; 3];

/// The way of a moving instance: `M(s) = open + s·change`, for times `s` in `[0, 1]`.
///
/// Each number of the transform changes in a straight line.
#[derive(Clone, Debug)]
pub struct Motion {
    open: Columns,
    change: Columns,
}

impl Motion {
    /// The way between where an instance is as the shutter opens and where it is as it closes, `world_from_object` both.
    #[must_use]
    pub fn new(open: &Affine, close: &Affine) -> Self {
        let [open, close] = [open, close].map(|map| map.columns.map(|column| column.map(f64::from)));
        Self { open, change: zip(open, close, |open, close| close - open) }
    }

    /// Columns of the map at a time, as rays meet it, computed in `f64`; a time that is not a number counts as 0.
    #[inline]
    #[must_use]
    pub fn world_from_object(&self, time: f32) -> [[f64; 3]; 4] {
        self.at(within_shutter(time))
    }

    /// The inverse at a time, computed in `f64`; a time that is not a number counts as 0.
    ///
    /// Three roundings stand between an entry and its value; rows of them sum to less than 2⁻⁵⁰ of the greater end's norm.
    /// As the condition is at most 4/3 of [`crate::MAX_CONDITION`], the inverse is off by less than 2⁻²⁹ of itself, a
    /// thirtieth of a rounding to `f32`.
    #[inline]
    pub(crate) fn object_from_world(&self, time: f32) -> Rows {
        self.inverse(within_shutter(time))
    }

    #[inline]
    fn inverse(&self, time: f64) -> Rows {
        invert(&self.at(time))
    }

    #[inline]
    fn at(&self, time: f64) -> Columns {
        zip(self.open, self.change, |open, change| open + time * change)
    }

    /// A bound of `‖M(s)⁻¹‖` over all times, the greatest row sum, at most 4/3 of the greatest value.
    ///
    /// With `B = M(m)⁻¹·change` at the middle `m` of an interval of half-width `h`, `M(s) = M(m)·(I + (s - m)·B)`, so
    /// `‖M(s)⁻¹‖ <= ‖M(m)⁻¹‖ / (1 - h·‖B‖)` where `h·‖B‖ < 1`. Intervals are halved until `h·‖B‖ <= 1/4`. Since
    /// `‖B‖ <= ‖M(m)⁻¹‖·‖change‖ <= 2·MAX_CONDITION` wherever `limit` is kept, they are never narrower than 2⁻²⁵.
    ///
    /// # Errors
    /// A time at which the norm is above `limit` or not finite, and the norm.
    pub(crate) fn norm_of_inverse(&self, limit: f64) -> Result<f64, (f64, f64)> {
        let mut greatest = 0.0_f64;
        for end in [0.0, 1.0] {
            greatest = greatest.max(within(end, row_sum_norm(&self.inverse(end)), limit)?);
        }
        // Middles and half-widths, exact in f64.
        let mut waiting = vec![(0.5, 0.5)];
        while let Some((middle, half)) = waiting.pop() {
            let inverse = self.inverse(middle);
            let at_middle = within(middle, row_sum_norm(&inverse), limit)?;
            let shrink = half * row_sum_norm(&product(&inverse, &self.change));
            if shrink <= 0.25 {
                greatest = greatest.max(at_middle / (1.0 - shrink));
            } else {
                waiting.extend([(middle + 0.5 * half, 0.5 * half), (middle - 0.5 * half, 0.5 * half)]);
            }
        }
        Ok(greatest)
    }
}

/// The time of a ray in `[0, 1]`, in which order a NaN becomes 0.
#[inline]
#[expect(clippy::manual_clamp, reason = "clamp keeps a NaN")]
fn within_shutter(time: f32) -> f64 {
    f64::from(time.max(0.0).min(1.0))
}

/// `norm`, or both where it is above `limit` or infinite.
fn within(time: f64, norm: f64, limit: f64) -> Result<f64, (f64, f64)> {
    if norm <= limit && norm.is_finite() { Ok(norm) } else { Err((time, norm)) }
}

fn zip(a: Columns, b: Columns, f: impl Fn(f64, f64) -> f64) -> Columns {
    std::array::from_fn(|i| std::array::from_fn(|k| f(a[i][k], b[i][k])))
}

/// Rows of the linear part of a product.
fn product(rows: &Rows, columns: &Columns) -> Rows {
    rows.map(|row| std::array::from_fn(|j| if j < 3 { (0..3).map(|k| row[k] * columns[j][k]).sum() } else { 0.0 }))
}

/// Greatest row sum of absolute values of the linear part of a map by its rows, each with its translation last; infinite where
/// a number of the map is not finite.
#[must_use]
pub fn row_sum_norm(rows: &[[f64; 4]; 3]) -> f64 {
    // A singular matrix of rank one has an inverse of NaNs, which a maximum passes over.
    if !rows.iter().flatten().all(|x| x.is_finite()) {
        return f64::INFINITY;
    }
    rows.iter().map(|row| row[..3].iter().map(|x| x.abs()).sum()).fold(0.0, f64::max)
}

/// Rows of the inverse map, by cofactors in `f64`; not finite where the matrix is singular.
#[inline]
pub(crate) fn invert(columns: &Columns) -> Rows {
    let [a, b, c, origin] = *columns;
    let cross =
        |p: [f64; 3], q: [f64; 3]| [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let reciprocal = 1.0 / dot(a, cross(b, c));
    [cross(b, c), cross(c, a), cross(a, b)].map(|row| {
        let row = row.map(|x| x * reciprocal);
        [row[0], row[1], row[2], -dot(row, origin)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(angle: f64, scale: [f64; 3], shift: [f32; 3]) -> Affine {
        #[expect(clippy::cast_possible_truncation, reason = "any numbers near these will do")]
        let column = |c: [f64; 3], s: f64| c.map(|x| (x * s) as f32);
        let (sine, cosine) = angle.sin_cos();
        let columns = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]];
        let [x, y, z] = std::array::from_fn(|i| column(columns[i], scale[i]));
        Affine { columns: [x, y, z, shift] }
    }

    /// Sampled a hundred thousand times, the norm never exceeds the bound, and reaches three quarters of it.
    #[test]
    fn inverses_are_bounded_at_all_times() {
        for angle in [0.0, 0.3, 1.0, 1.57, 2.5] {
            for scale in [[1.0; 3], [1.0, 2.0, 0.1], [-1.0, 1.0, 1e3], [1e-3, 1e-3, 1e-3], [1.0, 1.0, 1e-5]] {
                // Between a mirror and none the map is flat at some time: both ends are of one kind.
                let open = turned(0.2, scale.map(f64::signum), [0.0; 3]);
                let motion = Motion::new(&open, &turned(0.2 + angle, scale, [1e7; 3]));
                let bound = motion.norm_of_inverse(1e12).unwrap();
                let times = (0..=100_000).map(|i| f64::from(i) / 100_000.0);
                let greatest = times.map(|time| row_sum_norm(&motion.inverse(time))).fold(0.0, f64::max);
                assert!(greatest <= bound && bound <= 1.34 * greatest, "{angle} {scale:?}: {greatest} {bound}");
            }
        }
    }

    #[test]
    fn ways_begin_and_end_where_they_are_told_to_at_any_time() {
        let (open, close) = (turned(0.2, [1.0; 3], [0.0; 3]), turned(1.2, [3.0, 1.0, 0.5], [1e3; 3]));
        let motion = Motion::new(&open, &close);
        let columns = |map: &Affine| map.columns.map(|column| column.map(f64::from));
        for time in [0.0, -0.0, -1.0, f32::NEG_INFINITY, f32::NAN] {
            assert_eq!(motion.world_from_object(time), columns(&open), "{time}");
        }
        for time in [1.0, 2.0, f32::INFINITY] {
            let off = zip(motion.world_from_object(time), columns(&close), |a, b| (a - b).abs());
            assert!(off.as_flattened().iter().all(|&off| off <= 1e3 * f64::EPSILON), "{time}: {off:?}");
        }
        let [half, whole] = [0.5, 1.0].map(|time| motion.world_from_object(time)[3][0]);
        assert_eq!(half, 0.5 * whole);
        assert_eq!(motion.object_from_world(0.5), invert(&motion.world_from_object(0.5)));
    }

    #[test]
    fn a_half_turn_is_flat_half_way() {
        let motion = Motion::new(&Affine::IDENTITY, &turned(std::f64::consts::PI, [1.0; 3], [0.0; 3]));
        let (time, norm) = motion.norm_of_inverse(1e6).unwrap_err();
        assert!(time == 0.5 && norm > 1e6, "{time} {norm}");
    }

    /// The bound comes from halving, not from the few times that a person would look at.
    #[test]
    fn a_map_that_is_flat_at_an_odd_time_is_found() {
        // The limit of the norm is that of one over the scale, which falls by one a time or faster; the end is rounded once.
        const LIMIT: f64 = 1e6;
        let bound = 1.0 / LIMIT + 0.5 * f64::from(f32::EPSILON);
        for flat_at in [0.1, 1.0 / 3.0, 0.77, 0.999] {
            #[expect(clippy::cast_possible_truncation, reason = "near is near enough")]
            let close = ((flat_at - 1.0) / flat_at) as f32;
            let close = Affine { columns: [[close, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] };
            let (time, norm) = Motion::new(&Affine::IDENTITY, &close).norm_of_inverse(LIMIT).unwrap_err();
            assert!((time - flat_at).abs() <= bound && norm > LIMIT, "{time} for {flat_at}: {norm}");
        }
    }
}
