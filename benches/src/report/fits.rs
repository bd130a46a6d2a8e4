//! Line fits, correlations and confidence intervals.

use std::fmt;

use canted_fixtures::SplitMix64;

use super::samples::Samples;

/// The exponent of a power law, by least squares of logarithms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) slope: f64,
    /// Standard error of the slope, from the residuals.
    pub(crate) error: f64,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} ±{:.2}", self.slope, self.error)
    }
}

/// Why no exponent can be fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unfit {
    /// Two points give no standard error, one gives no slope.
    Few,
    /// Repetitions of a point scatter as much as the points.
    Noise,
    /// A value is not positive, because more was subtracted from it than measured.
    Subtracted,
}

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Few => "– (fewer than three points)",
            Self::Noise => "– (noise)",
            Self::Subtracted => "– (below what is subtracted)",
        })
    }
}

/// A table cell: the exponent with its error, or why there is none.
pub(crate) fn formatted(fit: Result<Line, Unfit>) -> String {
    fit.map_or_else(|why| why.to_string(), |line| line.to_string())
}

/// Errors of x flatten a least-squares slope by their share of the variance of x (Fuller 1987, section 1.1). Beyond
/// this share no exponent is reported.
const MOST_FLATTENED: f64 = 0.05;

/// The exponent of the power law through `points`: the repetitions of x, and y.
pub(crate) fn exponent(points: &[(Samples, f64)]) -> Result<Line, Unfit> {
    if points.len() < 3 {
        return Err(Unfit::Few);
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.median().ln(), y.ln())).collect();
    let is_positive = points.iter().all(|(x, _)| x.values().iter().all(|x| *x > 0.0));
    if !is_positive || logs.iter().any(|(x, y)| !x.is_finite() || !y.is_finite()) {
        return Err(Unfit::Subtracted);
    }
    let [mean_x, mean_y] = [mean(logs.iter().map(|p| p.0)), mean(logs.iter().map(|p| p.1))];
    let squares: f64 = logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    let of_errors: f64 = points.iter().map(|(x, _)| squared_error(x)).sum();
    // Points with equal x have no slope.
    if of_errors >= MOST_FLATTENED * squares {
        return Err(Unfit::Noise);
    }
    let slope = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>() / squares;
    let residual: f64 = logs.iter().map(|(x, y)| (y - mean_y - slope * (x - mean_x)).powi(2)).sum();
    #[expect(clippy::cast_precision_loss, reason = "points are few")]
    let freedom = logs.len() as f64 - 2.0;
    Ok(Line { slope, error: (residual / freedom / squares).sqrt() })
}

/// The non-negative intercept `a` of `y = a + b·x`, by least squares of relative errors so that large values do not
/// dominate. Zero if all `x` are equal.
pub(crate) fn intercept(points: &[(f64, f64)]) -> f64 {
    // Each equation divided by its y: a·(1/y) + b·(x/y) = 1.
    let sum = |of: fn(f64, f64) -> f64| points.iter().map(|&(x, y)| of(x, y) / (y * y)).sum::<f64>();
    let [ones, xs, squares] = [sum(|_, _| 1.0), sum(|x, _| x), sum(|x, _| x * x)];
    let [ys, products] = [sum(|_, y| y), sum(|x, y| x * y)];
    let found = (squares * ys - xs * products) / (ones * squares - xs * xs);
    if found.is_finite() { found.max(0.0) } else { 0.0 }
}

/// Squared standard error of the mean logarithm of repetitions; zero for a single one.
fn squared_error(samples: &Samples) -> f64 {
    let logs = || samples.values().iter().map(|x| x.ln());
    #[expect(clippy::cast_precision_loss, reason = "repetitions are few")]
    let n = samples.values().len() as f64;
    let center = mean(logs());
    if n > 1.0 { logs().map(|x| (x - center).powi(2)).sum::<f64>() / (n * (n - 1.0)) } else { 0.0 }
}

/// Pearson's correlation; `None` if one of the two is constant or there are fewer than three points.
pub(crate) fn correlation(points: &[(f64, f64)]) -> Option<f64> {
    let [mean_x, mean_y] = [mean(points.iter().map(|p| p.0)), mean(points.iter().map(|p| p.1))];
    let sum = |of: fn(f64, f64) -> f64| points.iter().map(|(x, y)| of(x - mean_x, y - mean_y)).sum::<f64>();
    let found = sum(|x, y| x * y) / (sum(|x, _| x * x) * sum(|_, y| y * y)).sqrt();
    (points.len() > 2 && found.is_finite()).then_some(found)
}

/// Bootstrap resamplings: the ends of a 95 % interval are then the 50th from either end.
const RESAMPLINGS: usize = 2000;

/// The interval that contains a statistic of `n` observations in 95 of 100 resamplings (Efron 1979); `statistic` gets
/// the drawn indices.
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

/// Mean of the drawn `samples`.
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

    /// Points with a single x each.
    fn once(points: &[(f64, f64)]) -> Vec<(Samples, f64)> {
        points.iter().map(|&(x, y)| (x.into(), y)).collect()
    }

    #[test]
    fn exponents_are_found_with_their_error() {
        let line = exponent(&once(&[(1.0, 2.0), (2.0, 1.0), (4.0, 0.5), (8.0, 0.25)])).unwrap();
        assert!((line.slope + 1.0).abs() < 1e-12 && line.error < 1e-12, "{line:?}");
        assert!(exponent(&once(&[(1.0, 2.0), (2.0, 1.0), (4.0, 1.0)])).unwrap().error > 0.1);
    }

    #[test]
    fn intercepts_are_found_and_never_negative() {
        let line = |a: f64, b: f64| (0..5).map(|k| f64::from(1 << k)).map(|x| (x, a + b * x)).collect::<Vec<_>>();
        assert!((intercept(&line(0.5, 2.0)) - 0.5).abs() < 1e-12);
        assert_eq!(intercept(&line(-0.5, 2.0)), 0.0);
        assert_eq!(intercept(&[(1.0, 3.0)]), 0.0);
        // 5 % more at the far end is one relative error of five; unweighted, it would dominate.
        let mut points = line(0.5, 2.0);
        points[4].1 *= 1.05;
        assert!((intercept(&points) - 0.5).abs() < 0.1, "{}", intercept(&points));
    }

    #[test]
    fn missing_exponents_have_a_reason() {
        let few = once(&[(1.0, 2.0), (2.0, 1.0)]);
        let none = once(&[(1.0, 2.0), (2.0, 1.0), (4.0, -0.1)]);
        let same = once(&[(1.0, 2.0), (1.0, 1.0), (1.0, 0.5)]);
        // Medians 1, 1.01 and 1.02, whose repetitions reach from 0.5 to 1.6.
        let noisy: Vec<(Samples, f64)> =
            (0..3).map(|i| (vec![0.5, 1.0 + 0.01 * f64::from(i), 1.6].into(), 0.5f64.powi(i))).collect();
        for (points, why) in [(few, Unfit::Few), (none, Unfit::Subtracted), (same, Unfit::Noise), (noisy, Unfit::Noise)]
        {
            assert_eq!(exponent(&points).unwrap_err(), why);
        }
    }

    #[test]
    fn correlation_has_a_sign_and_a_limit() {
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
