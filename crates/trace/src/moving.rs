//! Points that move while the shutter is open.

/// The position at `time` of a vertex that moves in a straight line from `open` to `close`, as the shutter does.
///
/// `time` is that of [`Ray::time`](crate::Ray::time): 0 as the shutter opens, 1 as it closes; clamped to `[0, 1]`, and NaN is 0.
/// At 0 the result is `open`, at 1 it is `close`. In between, each coordinate is `(1 - time)·open + time·close`, computed in `f64` from
/// left to right, rounded to `f32`, and clamped to the interval between both ends.
///
/// # Error
/// No coordinate leaves the interval between those of both ends. With r the greatest absolute coordinate of both, it is within
/// `(2^-24 + 2^-50)·r + 2^-149` of the exact one: the difference, two products and a sum in `f64` are off by at most
/// `4·2^-53·r`, rounding to `f32` by half a unit in the last place, and the exact coordinate lies in the interval.
///
/// ```
/// use canted_trace::position_at;
///
/// let (open, close) = ([0.0, 1.0, -2.0], [1.0, 1.0, 2.0]);
/// assert_eq!(position_at(&open, &close, 0.25), [0.25, 1.0, -1.0]);
/// assert_eq!([-1.0, f32::NAN, 2.0].map(|time| position_at(&open, &close, time)), [open, open, close]);
/// ```
#[inline]
#[must_use]
pub fn position_at(open: &[f32; 3], close: &[f32; 3], time: f32) -> [f32; 3] {
    numbers_at(open, close, time)
}

/// As [`position_at`], for any numbers, each as a coordinate.
#[doc(hidden)]
#[inline]
#[must_use]
pub fn numbers_at<const N: usize>(open: &[f32; N], close: &[f32; N], time: f32) -> [f32; N] {
    if time.is_nan() || time <= 0.0 {
        return *open;
    }
    if time >= 1.0 {
        return *close;
    }
    let to_close = f64::from(time);
    let to_open = 1.0 - to_close;
    core::array::from_fn(|k| {
        let (a, b) = (open[k], close[k]);
        let between = (to_open * f64::from(a) + to_close * f64::from(b)) as f32;
        between.max(a.min(b)).min(a.max(b))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times at which the factors round, and coordinates of very different size.
    #[test]
    fn positions_stay_between_both_ends_and_within_the_stated_error() {
        let times = [f32::MIN_POSITIVE, 1e-20, 0.1, 0.25, 1.0 / 3.0, 0.5, 0.7, 0.999, 1.0_f32.next_down()];
        let numbers = [0.0, -0.0, 1.0, 1.0_f32.next_up(), -1.0, 3.1e-39, -7.3e20, 1e-10, 123.456, f32::MIN_POSITIVE];
        for &time in &times {
            for &a in &numbers {
                for &b in &numbers {
                    let [at, ..] = position_at(&[a; 3], &[b; 3], time);
                    assert!(a.min(b) <= at && at <= a.max(b), "{a} to {b} at {time}: {at}");
                    let (wide_a, wide_b, wide_time) = (f64::from(a), f64::from(b), f64::from(time));
                    let exact = wide_a + wide_time * (wide_b - wide_a);
                    let reach = f64::from(a.abs().max(b.abs()));
                    // Twice the part of f64, because `exact` is rounded too.
                    let bound = reach / f64::from(1 << 24) + reach / f64::from(1 << 25).powi(2) + 2e-45;
                    assert!((f64::from(at) - exact).abs() <= bound, "{a} to {b} at {time}: {at} instead of {exact}");
                }
            }
        }
        // Between equal ends nothing moves.
        assert_eq!(position_at(&[0.1; 3], &[0.1; 3], 0.3), [0.1; 3]);
    }
}
