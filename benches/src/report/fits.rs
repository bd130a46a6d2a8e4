//! Lines, correlations and intervals.

use canted_fixtures::SplitMix64;

use super::samples::Samples;

/// A straight line by least squares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) slope: f64,
    /// Standard error of the slope, from what the line leaves unexplained; not a number for two points.
    pub(crate) error: f64,
}

/// The line through the logarithms of `points`: its slope is the exponent of a power law. `None` below two points.
pub(crate) fn power(points: &[(f64, f64)]) -> Option<Line> {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    if logs.len() < 2 || logs.iter().any(|(x, y)| !x.is_finite() || !y.is_finite()) {
        return None;
    }
    let [mean_x, mean_y] = [mean(logs.iter().map(|p| p.0)), mean(logs.iter().map(|p| p.1))];
    let variance: f64 = logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    let slope = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>() / variance;
    let residual: f64 = logs.iter().map(|(x, y)| (y - mean_y - slope * (x - mean_x)).powi(2)).sum();
    #[expect(clippy::cast_precision_loss, reason = "points are few")]
    let freedom = logs.len() as f64 - 2.0;
    Some(Line { slope, error: (residual / freedom / variance).sqrt() })
}

/// Pearson's correlation; `None` where one of the two does not vary, or there are fewer than three.
pub(crate) fn correlation(points: &[(f64, f64)]) -> Option<f64> {
    let [mean_x, mean_y] = [mean(points.iter().map(|p| p.0)), mean(points.iter().map(|p| p.1))];
    let sum = |of: fn(f64, f64) -> f64| points.iter().map(|(x, y)| of(x - mean_x, y - mean_y)).sum::<f64>();
    let found = sum(|x, y| x * y) / (sum(|x, _| x * x) * sum(|_, y| y * y)).sqrt();
    (points.len() > 2 && found.is_finite()).then_some(found)
}

/// Resamplings of a bootstrap: the ends of a 95 % interval are then the 50th from either end.
const RESAMPLINGS: usize = 2000;

/// The interval that holds a statistic of `n` observations in 95 of 100 resamplings (Efron 1979); `statistic` gets the numbers of
/// the observations drawn.
pub(crate) fn interval(n: usize, statistic: impl Fn(&[usize]) -> f64) -> [f64; 2] {
    let mut rng = SplitMix64::new(0x5eed_0bad_cafe_0001);
    let mut drawn = vec![0; n];
    let mut values: Vec<f64> = (0..RESAMPLINGS)
        .map(|_| {
            drawn.fill_with(|| rng.below(n));
            statistic(&drawn)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    [values[RESAMPLINGS / 40], values[RESAMPLINGS - 1 - RESAMPLINGS / 40]]
}

/// Mean of the drawn of `samples`.
pub(crate) fn drawn_mean(samples: &Samples, drawn: &[usize]) -> f64 {
    mean(drawn.iter().map(|&i| samples.values()[i]))
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
    sum / n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_found_with_their_error() {
        let line = power(&[(1.0, 2.0), (2.0, 1.0), (4.0, 0.5), (8.0, 0.25)]).unwrap();
        assert!((line.slope + 1.0).abs() < 1e-12 && line.error < 1e-12, "{line:?}");
        assert!(power(&[(1.0, 2.0), (2.0, 1.0), (4.0, 1.0)]).unwrap().error > 0.1);
        assert!(power(&[(1.0, 2.0)]).is_none() && power(&[(0.0, 1.0), (1.0, 1.0)]).is_none());
    }

    #[test]
    fn correlation_has_a_sign_and_an_end() {
        assert_eq!(correlation(&[(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]), Some(1.0));
        assert!(correlation(&[(1.0, 3.0), (2.0, 1.0), (3.0, 0.0)]).unwrap() < -0.9);
        assert!(correlation(&[(1.0, 1.0), (2.0, 1.0), (3.0, 1.0)]).is_none());
    }

    #[test]
    fn the_interval_of_a_mean_is_as_wide_as_theory_says() {
        // Sixteen values 0 and 1, half each: the mean's standard error is 1/8, so 95 % lie within 0.245 of the mean.
        let samples: Samples = (0..16).map(|i| f64::from(i % 2)).collect::<Vec<_>>().into();
        let [low, high] = interval(16, |drawn| drawn_mean(&samples, drawn));
        assert!((0.2..0.3).contains(&(0.5 - low)) && (0.2..0.3).contains(&(high - 0.5)), "{low} {high}");
    }
}
