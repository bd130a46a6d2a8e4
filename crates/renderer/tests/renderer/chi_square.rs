//! Pearson's chi-squared test.

/// Deviation of Pearson's statistic from its mean, in standard deviations.
///
/// Cells with an expected count below ten are merged.
pub(crate) fn deviation(counts: &[f64], probabilities: &[f64]) -> f64 {
    let n: f64 = counts.iter().sum();
    let (mut statistic, mut freedom, mut rare) = (0.0, -1.0, (0.0, 0.0));
    let mut add = |count: f64, expected: f64| {
        statistic += (count - expected).powi(2) / expected;
        freedom += 1.0;
    };
    for (&count, &probability) in counts.iter().zip(probabilities) {
        let expected = probability * n;
        if expected < 10.0 { rare = (rare.0 + count, rare.1 + expected) } else { add(count, expected) }
    }
    if rare.1 >= 10.0 {
        add(rare.0, rare.1);
    } else {
        // Too few for the statistic; the count must still match the expectation.
        assert!(rare.0 <= rare.1.max(0.0) + 6.0 * (rare.1.max(0.0) + 1.0).sqrt(), "{rare:?}");
    }
    let freedom: f64 = freedom;
    (statistic - freedom) / (2.0 * freedom.max(1.0)).sqrt()
}
