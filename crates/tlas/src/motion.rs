use canted_obb::Affine;

use crate::matrix::{Columns, Rows, invert, row_sum_norm};

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

    /// The inverse at a time, computed in `f64`. Times are clamped to `[0, 1]`; NaN is 0.
    ///
    /// An entry of the transform takes three roundings; a row of their errors sums to less than 2⁻⁵⁰ of the norm of the
    /// greater end. The condition is at most 4/3 of [`crate::MAX_CONDITION`], so the relative error of the inverse is
    /// less than 2⁻²⁹, a thirtieth of a rounding to `f32`.
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
    /// With `B = M(m)⁻¹·change` at the midpoint `m` of an interval of half-width `h`, `M(s) = M(m)·(I + (s - m)·B)`, so
    /// `‖M(s)⁻¹‖ <= ‖M(m)⁻¹‖ / (1 - h·‖B‖)` where `h·‖B‖ < 1`. Intervals are halved until `h·‖B‖ <= 1/4`. Since
    /// `‖B‖ <= ‖M(m)⁻¹‖·‖change‖ <= 2·MAX_CONDITION` while the norm is at most `limit`, they are never narrower than 2⁻²⁵.
    ///
    /// # Errors
    /// A time at which the norm is above `limit` or not finite, and the norm.
    pub(crate) fn norm_of_inverse(&self, limit: f64) -> Result<f64, (f64, f64)> {
        let mut greatest = 0.0_f64;
        for end in [0.0, 1.0] {
            greatest = greatest.max(within(end, row_sum_norm(&self.inverse(end)), limit)?);
        }
        // Midpoints and half-widths, exact in f64.
        let mut waiting = vec![(0.5, 0.5)];
        while let Some((midpoint, half)) = waiting.pop() {
            let inverse = self.inverse(midpoint);
            let at_midpoint = within(midpoint, row_sum_norm(&inverse), limit)?;
            let shrink = half * row_sum_norm(&product(&inverse, &self.change));
            if shrink <= 0.25 {
                greatest = greatest.max(at_midpoint / (1.0 - shrink));
            } else {
                waiting.extend([(midpoint + 0.5 * half, 0.5 * half), (midpoint - 0.5 * half, 0.5 * half)]);
            }
        }
        Ok(greatest)
    }
}

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

/// Rows of the product of the linear parts.
fn product(rows: &Rows, columns: &Columns) -> Rows {
    rows.map(|row| std::array::from_fn(|j| if j < 3 { (0..3).map(|k| row[k] * columns[j][k]).sum() } else { 0.0 }))
}

#[cfg(test)]
mod tests;
