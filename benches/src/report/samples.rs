//! Repetitions of one measurement and their statistics.
//!
//! Compared items are measured in turn, round by round, so that drift of the machine affects both; the ratios within
//! rounds decide whether they differ. A difference is noise if the interval of the median ratio contains 1.
//! Source: the interval uses order statistics, which assume nothing about the distribution (David, Nagaraja, Order
//! Statistics, 2003, section 7.1).

use std::fmt;

use serde::Serialize;

use crate::timing::{median, range, spread};

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
        let n = self.0.len() as f64;
        self.0.iter().sum::<f64>() / n
    }

    /// The least and the greatest.
    pub(crate) fn range(&self) -> [f64; 2] {
        range(&self.0)
    }

    /// Half the distance between least and greatest, over the median.
    pub(crate) fn spread(&self) -> f64 {
        spread(&self.0)
    }

    /// The confidence interval of the median, with a level of at least [`CERTAINTY`]: from one order statistic to its
    /// mirror image. For five rounds it is the full range; `None` for fewer, which reach no such level.
    pub(crate) fn interval_of_median(&self) -> Option<[f64; 2]> {
        let n = self.0.len();
        let rank = (0..n / 2).take_while(|&rank| certainty(n, rank) >= CERTAINTY).last()?;
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        Some([sorted[rank], sorted[n - 1 - rank]])
    }

    /// `self` over `other`: per round if both have the same, sufficient number of rounds, otherwise of the medians,
    /// with the interval from both ranges.
    pub(crate) fn over(&self, other: &Self) -> Ratio {
        let ratios = self.with(other, |a, b| a / b);
        match ratios.interval_of_median().filter(|_| self.0.len() == other.0.len()) {
            Some(interval) => Ratio { median: ratios.median(), interval },
            None => {
                let ([low, high], [other_low, other_high]) = (self.range(), other.range());
                Ratio { median: self.median() / other.median(), interval: [low / other_high, high / other_low] }
            }
        }
    }

    /// Whether the difference from `other` is noise.
    pub(crate) fn differs_by_noise(&self, other: &Self) -> bool {
        self.over(other).is_noise()
    }

    /// Each repetition times `factor`.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        Self(self.0.iter().map(|x| x * factor).collect())
    }

    /// Each repetition of `self` with that of `other` in the same round.
    pub(crate) fn with(&self, other: &Self, join: impl Fn(f64, f64) -> f64) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(&a, &b)| join(a, b)).collect())
    }
}

/// How two measurements compare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ratio {
    pub(crate) median: f64,
    /// The confidence interval of the median.
    pub(crate) interval: [f64; 2],
}

impl Ratio {
    /// Whether the interval contains 1, or the ratio is NaN.
    pub(crate) fn is_noise(&self) -> bool {
        let [low, high] = self.interval;
        let is_apart = low > 1.0 || high < 1.0;
        !is_apart
    }
}

/// Minimum confidence level of intervals of medians.
const CERTAINTY: f64 = 0.93;

/// The probability that the median lies between the value of this rank, counted from 0, and its mirror image: more than
/// `rank` of `n` coin tosses fall on either side.
fn certainty(n: usize, rank: usize) -> f64 {
    let ways = (1..=rank).scan(1.0, |ways, k| {
        *ways *= (n - k + 1) as f64 / k as f64;
        Some(*ways)
    });
    let tails: f64 = 1.0 + ways.sum::<f64>();
    1.0 - 2.0 * tails * (0..n).fold(1.0, |half, _| 0.5 * half)
}

impl fmt::Display for Samples {
    /// The median in three digits, and the spread in percent if there are repetitions.
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

/// `x` in three digits, with powers of ten if very small or very large.
pub(crate) fn number(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".to_owned()
    } else if !x.is_finite() {
        "–".to_owned()
    } else if !(1e-3..1e6).contains(&size) {
        format!("{x:.2e}")
    } else {
        let digits = (2.0 - size.log10().floor()).clamp(0.0, 5.0) as usize;
        format!("{x:.digits$}")
    }
}

/// "`a` is 1.4 times as fast as `b`", or that they differ by noise; from times, less is faster.
pub(crate) fn faster(a: (&str, &Samples), b: (&str, &Samples)) -> String {
    let found = b.1.over(a.1);
    let ratio = found.median;
    if found.is_noise() {
        format!("{} and {} differ by {}, which is noise", a.0, b.0, percent(ratio))
    } else if ratio >= 1.0 {
        format!("{} is {} times as fast as {}", a.0, number(ratio), b.0)
    } else {
        format!("{} takes {} times as long as {}", a.0, number(1.0 / ratio), b.0)
    }
}

/// The name with the least median in quotes, and the names that differ from it only by noise; from times.
pub(crate) fn first(of: &[(&str, Samples)]) -> String {
    let Some((name, least)) = of.iter().min_by(|a, b| a.1.median().total_cmp(&b.1.median())) else {
        return "nobody".to_owned();
    };
    let is_tied = |(other, samples): &&(&str, Samples)| other != name && samples.differs_by_noise(least);
    let tied: Vec<String> = of.iter().filter(is_tied).map(|(other, _)| format!("'{other}'")).collect();
    if tied.is_empty() { format!("'{name}'") } else { format!("'{name}' (equal within noise: {})", tied.join(", ")) }
}

/// The difference of a ratio from 1.
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
    fn repetitions_have_median_and_spread() {
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
    fn intervals_of_medians_reach_their_confidence_level() {
        // Five tosses all fall on one side once in sixteen times; of nine, eight or more in 20 of 512.
        assert_eq!((certainty(5, 0), certainty(9, 1)), (1.0 - 2.0 / 32.0, 1.0 - 20.0 / 512.0));
        assert_eq!(samples(&[4.0, 1.0, 3.0, 9.0, 2.0]).interval_of_median(), Some([1.0, 9.0]));
        let nine: Vec<f64> = (1..=9).map(f64::from).collect();
        assert_eq!(samples(&nine).interval_of_median(), Some([2.0, 8.0]));
        assert_eq!(samples(&nine[..4]).interval_of_median(), None);
    }

    #[test]
    fn rounds_are_compared_in_pairs() {
        // The machine slows down by half, and in every round the second is slower by 5 %.
        let a = samples(&[1.0, 1.1, 1.2, 1.3, 1.5]);
        let b = a.scaled(1.05);
        assert!(!b.differs_by_noise(&a) && (b.over(&a).median - 1.05).abs() < 1e-12);
        // In another order only noise remains, and an additional round has no pair.
        assert!(samples(&[1.575, 1.365, 1.26, 1.155, 1.05]).differs_by_noise(&a));
        assert!(b.differs_by_noise(&samples(&[1.0, 1.1, 1.2, 1.3, 1.5, 1.5])));
        assert!(samples(&[f64::NAN; 5]).differs_by_noise(&a));
    }

    #[test]
    fn more_rounds_make_no_more_noise() {
        // 10 % apart, each round off by up to 25 %, every eighth pair reversed.
        let pair = |i: u32| {
            let drift = 1.0 + 0.05 * f64::from(i * 7 % 5);
            if i % 8 == 3 { (1.1 * drift, drift) } else { (drift, 1.1 * drift) }
        };
        let of = |n: u32| -> (Samples, Samples) {
            let (a, b): (Vec<f64>, Vec<f64>) = (0..n).map(pair).unzip();
            (a.into(), b.into())
        };
        let is_noise = |n: u32| of(n).0.differs_by_noise(&of(n).1);
        assert!(is_noise(5) && !is_noise(11) && !is_noise(40));
    }

    #[test]
    fn differences_within_the_spread_are_noise() {
        let (fast, slow, loose) = (samples(&[1.0, 1.1]), samples(&[2.0, 2.1]), samples(&[1.05, 2.5]));
        assert_eq!(faster(("a", &fast), ("b", &slow)), "a is 1.95 times as fast as b");
        assert_eq!(faster(("b", &slow), ("a", &fast)), "b takes 1.95 times as long as a");
        assert!(faster(("a", &fast), ("c", &loose)).ends_with("which is noise"));
        assert_eq!(first(&[("b", slow.clone()), ("a", fast.clone())]), "'a'");
        assert_eq!(first(&[("c", loose), ("b", slow), ("a", fast)]), "'a' (equal within noise: 'c')");
    }
}
