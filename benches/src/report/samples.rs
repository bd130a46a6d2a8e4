//! Repetitions of one measurement, and what they say together.

use std::fmt;

use serde::Serialize;

use crate::interleave::median;

/// Every repetition of one measurement, at least one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Samples(Vec<f64>);

impl From<Vec<f64>> for Samples {
    fn from(values: Vec<f64>) -> Self {
        Self(values)
    }
}

impl From<f64> for Samples {
    fn from(value: f64) -> Self {
        Self(vec![value])
    }
}

impl Samples {
    pub(crate) fn values(&self) -> &[f64] {
        &self.0
    }

    pub(crate) fn median(&self) -> f64 {
        median(&self.0)
    }

    pub(crate) fn mean(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "repetitions are few")]
        let n = self.0.len() as f64;
        self.0.iter().sum::<f64>() / n
    }

    /// The least and the greatest.
    pub(crate) fn range(&self) -> [f64; 2] {
        self.0.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| [low.min(x), high.max(x)])
    }

    /// Half the distance between least and greatest, over the median.
    pub(crate) fn spread(&self) -> f64 {
        let [low, high] = self.range();
        0.5 * (high - low) / self.median().abs()
    }

    /// Whether a difference from `other` lies within what repetitions differ by: their ranges meet.
    pub(crate) fn is_noise_beside(&self, other: &Self) -> bool {
        let ([low, high], [other_low, other_high]) = (self.range(), other.range());
        low <= other_high && other_low <= high
    }

    /// Each repetition by `factor`.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        Self(self.0.iter().map(|x| x * factor).collect())
    }

    /// Each repetition of `self` with that of `other` in the same round.
    pub(crate) fn with(&self, other: &Self, join: impl Fn(f64, f64) -> f64) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(&a, &b)| join(a, b)).collect())
    }
}

impl fmt::Display for Samples {
    /// The median in three digits, and the spread in per cent where there are repetitions.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&number(self.median()))?;
        let spread = 100.0 * self.spread();
        match self.0.len() {
            0 | 1 => Ok(()),
            _ if spread.is_finite() => write!(f, " ±{}%", number(spread)),
            _ => Ok(()),
        }
    }
}

/// `x` in three digits; powers of ten where it is very small or very large.
pub(crate) fn number(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".to_owned()
    } else if !x.is_finite() {
        "–".to_owned()
    } else if !(1e-3..1e6).contains(&size) {
        format!("{x:.2e}")
    } else {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a logarithm in -3..=2 of the size"
        )]
        let digits = (2.0 - size.log10().floor()).clamp(0.0, 5.0) as usize;
        format!("{x:.digits$}")
    }
}

/// "`a` is 1.4 times as fast as `b`", or that they do not differ by more than repetitions do: from times, less is faster.
pub(crate) fn faster(a: (&str, &Samples), b: (&str, &Samples)) -> String {
    let ratio = b.1.median() / a.1.median();
    if a.1.is_noise_beside(b.1) {
        format!("{} and {} differ by {}, which is noise", a.0, b.0, percent(ratio))
    } else if ratio >= 1.0 {
        format!("{} is {} times as fast as {}", a.0, number(ratio), b.0)
    } else {
        format!("{} takes {} times as long as {}", a.0, number(1.0 / ratio), b.0)
    }
}

/// Who has the least median, in quotes, and who differs from that by noise alone: from times.
pub(crate) fn first(of: &[(&str, Samples)]) -> String {
    let Some((name, least)) = of.iter().min_by(|a, b| a.1.median().total_cmp(&b.1.median())) else {
        return "nobody".to_owned();
    };
    let is_tied = |(other, samples): &&(&str, Samples)| other != name && samples.is_noise_beside(least);
    let tied: Vec<String> = of.iter().filter(is_tied).map(|(other, _)| format!("'{other}'")).collect();
    if tied.is_empty() { format!("'{name}'") } else { format!("'{name}' (as, but for noise, {})", tied.join(", ")) }
}

/// How far a ratio lies from 1.
pub(crate) fn percent(ratio: f64) -> String {
    format!("{}%", number(100.0 * (ratio - 1.0).abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(values: &[f64]) -> Samples {
        values.to_vec().into()
    }

    #[test]
    fn what_repetitions_say() {
        let some = samples(&[1.0, 4.0, 2.0]);
        assert_eq!((some.median(), some.range(), some.spread()), (2.0, [1.0, 4.0], 0.75));
        assert_eq!(some.to_string(), "2.00 ±75.0%");
        assert_eq!(Samples::from(0.0123).to_string(), "0.0123");
    }

    #[test]
    fn numbers_have_three_digits() {
        for (x, text) in [(0.0, "0"), (1234.5, "1234"), (0.001_234, "0.00123"), (1.5e-9, "1.50e-9"), (12.34, "12.3")] {
            assert_eq!(number(x), text);
        }
        assert_eq!(number(f64::NAN), "–");
    }

    #[test]
    fn differences_within_the_spread_are_noise() {
        let (fast, slow, loose) = (samples(&[1.0, 1.1]), samples(&[2.0, 2.1]), samples(&[1.05, 2.5]));
        assert_eq!(faster(("a", &fast), ("b", &slow)), "a is 1.95 times as fast as b");
        assert_eq!(faster(("b", &slow), ("a", &fast)), "b takes 1.95 times as long as a");
        assert!(faster(("a", &fast), ("c", &loose)).ends_with("which is noise"));
        assert_eq!(first(&[("b", slow.clone()), ("a", fast.clone())]), "'a'");
        assert_eq!(first(&[("c", loose), ("b", slow), ("a", fast)]), "'a' (as, but for noise, 'c')");
    }
}
