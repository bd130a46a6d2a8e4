//! The scale of an axis: positions of values, and tick labels.

use crate::report::samples::number;

/// Smallest value on a logarithmic axis: smaller ones come from underflow.
const LEAST: f64 = 1e-300;

/// Whether a value can be shown on an axis.
pub(super) fn is_shown(value: f64, is_log: bool) -> bool {
    value.is_finite() && (!is_log || value >= LEAST)
}

/// The ends of an axis, slightly beyond its values.
pub(super) struct Scale {
    low: f64,
    high: f64,
    is_log: bool,
}

impl Scale {
    /// The axis for `values`, ignoring those that cannot be shown.
    pub(super) fn over(values: impl Iterator<Item = f64>, is_log: bool) -> Self {
        let shown = values.filter(|x| is_shown(*x, is_log)).map(|x| if is_log { x.log10() } else { x });
        let (low, high) = shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let margin = if high > low { 0.05 * (high - low) } else { 0.5 * low.abs().max(0.2) };
        Self { low: low - margin, high: high + margin, is_log }
    }

    /// 0 at the low end, 1 at the high end; clamped for values outside.
    pub(super) fn position(&self, value: f64) -> f64 {
        let along = if self.is_log { value.max(LEAST).log10() } else { value };
        ((along - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    /// The minimum and maximum value.
    pub(super) fn ends(&self) -> [f64; 2] {
        [self.low, self.high].map(|x| if self.is_log { 10f64.powf(x) } else { x })
    }

    /// Round tick values, about `n` at most.
    pub(super) fn ticks(&self, n: u32) -> Vec<f64> {
        let n = f64::from(n.max(2));
        let span = self.high - self.low;
        if self.is_log && span >= 1.5 {
            let step = (span / n).ceil();
            return steps(self.low, self.high, step).map(|exponent| 10f64.powf(exponent)).collect();
        }
        let [low, high] = self.ends();
        if self.is_log {
            // Within two powers of ten: 1, 2 and 5 of each.
            let decades = steps(self.low.floor(), self.high, 1.0);
            let all = decades.flat_map(|exponent| [1.0, 2.0, 5.0].map(|digit| digit * 10f64.powf(exponent)));
            let all: Vec<f64> = all.filter(|x| (low..=high).contains(x)).collect();
            if all.len() >= 2 {
                return all;
            }
        }
        let rough = (high - low) / n;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * power).into_iter().find(|step| *step >= rough);
        steps(low, high, step.unwrap_or(rough)).collect()
    }
}

/// Multiples of `step` from `low` to `high`.
fn steps(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (low / step).ceil();
    (0..100).map(move |i| (first + f64::from(i)) * step).take_while(move |x| *x <= high)
}

/// A short tick label.
pub(super) fn label(value: f64) -> String {
    let text = number(value);
    if let Some((digits, exponent)) = text.split_once('e') {
        return format!("{}e{exponent}", short(digits));
    }
    if value.abs() >= 100.0 { text } else { short(&text).to_owned() }
}

/// Removes trailing zeros after the decimal point.
fn short(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_in_range() {
        let scale = Scale::over([1e-5, 3.0].into_iter(), true);
        assert_eq!(
            scale.ticks(7).iter().map(|x| label(*x)).collect::<Vec<_>>(),
            ["1e-5", "1e-4", "0.001", "0.01", "0.1", "1"]
        );
        let scale = Scale::over([0.0, 97.0].into_iter(), false);
        assert_eq!(scale.ticks(5), [0.0, 50.0, 100.0]);
        let scale = Scale::over([2.0, 3.0].into_iter(), true);
        assert!(scale.ticks(5).len() >= 2);
    }

    #[test]
    fn single_values_and_none_have_an_axis() {
        for values in [vec![], vec![0.0], vec![5.0]] {
            for is_log in [false, true] {
                let scale = Scale::over(values.iter().copied(), is_log);
                assert!(scale.position(1.0).is_finite() && !scale.ticks(4).is_empty(), "{values:?}");
            }
        }
    }

    #[test]
    fn values_off_the_axis_are_hidden_and_clamped() {
        for (value, is_log, shown) in [
            (1e-308, true, false),
            (-1.0, true, false),
            (0.0, true, false),
            (-1.0, false, true),
            (f64::NAN, false, false),
        ] {
            assert_eq!(is_shown(value, is_log), shown, "{value}");
        }
        let scale = Scale::over([1e-308, -2.0, 1.0, 100.0].into_iter(), true);
        assert!(scale.ends()[0] > 0.5, "{:?}", scale.ends());
        assert_eq!([1e-308, -2.0, 1e9].map(|x| scale.position(x)), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn labels_are_short() {
        for (value, text) in [(0.5, "0.5"), (20.0, "20"), (1e-7, "1e-7"), (2e6, "2e6"), (1000.0, "1000")] {
            assert_eq!(label(value), text);
        }
    }
}
