//! Which metrics of a BVH correlate with the time of its rays.

use super::Measured;
use super::metrics::{METRICS, N_KNOWN};
use crate::report::{
    fits,
    model::{Cell, Chapter, Table},
};

/// The correlation of a metric with time over BVHs.
#[derive(Clone, Copy, Debug)]
struct Correlation {
    metric: &'static str,
    r: f64,
    /// The interval of 95 in 100 resamplings of the BVHs.
    interval: [f64; 2],
}

impl Correlation {
    /// From logarithms of the metric and of time, a pair per BVH; `None` if undefined.
    fn of(metric: &'static str, pairs: &[(f64, f64)]) -> Option<Self> {
        let drawn = |drawn: &[usize]| {
            let pairs: Vec<(f64, f64)> = drawn.iter().map(|&i| pairs[i]).collect();
            // A resampling without variation says nothing.
            fits::correlation(&pairs).unwrap_or(0.0)
        };
        let r = fits::correlation(pairs)?;
        Some(Self { metric, r, interval: fits::interval(pairs.len(), drawn) })
    }
}

/// Adds the correlation of each metric with time over our binary BVHs, which share one traversal; returns a sentence on
/// the best metric that needs no tracing.
pub(super) fn add(chapter: &mut Chapter, scene: &str, measured: &[Measured]) -> String {
    let head = ["metric", "correlation", "95% interval", "BVHs"];
    let mut table = Table::new(format!("{scene}: which metric predicts time"), &head);
    let mut known = vec![];
    for (i, (metric, of)) in METRICS.into_iter().enumerate() {
        let pairs: Vec<(f64, f64)> = measured
            .iter()
            .filter(|tree| tree.family.is_binary_of_ours())
            .filter_map(|tree| Some((of(tree.metrics.as_ref()?).ln(), -tree.rate.median().ln())))
            .filter(|(metric, _)| metric.is_finite())
            .collect();
        let found = Correlation::of(metric, &pairs);
        let [r, interval] = found
            .map_or(["–".to_owned(), "–".to_owned()], |Correlation { r, interval, .. }| {
                [format!("{r:.3}"), format!("{:.3} to {:.3}", interval[0], interval[1])]
            });
        table.rows.push([metric.to_owned(), r, interval, pairs.len().to_string()].map(Cell::text).to_vec());
        known.extend(found.filter(|_| i < N_KNOWN));
    }
    chapter.tables.push(table);
    stands_out(known)
}

/// The metric with the highest correlation with time, if its interval overlaps no other.
fn stands_out(mut known: Vec<Correlation>) -> String {
    known.sort_by(|a, b| b.r.total_cmp(&a.r));
    match &known[..] {
        [] => "no metric can be compared with time".to_owned(),
        [best, rest @ ..] if rest.iter().all(|other| best.interval[0] > other.interval[1]) => {
            let [low, high] = best.interval;
            format!(
                "of the metrics known without tracing, {} correlates best with the time of binary BVHs (r = {:.2}, {low:.2} to {high:.2})",
                best.metric, best.r
            )
        }
        _ => "no metric known without tracing stands out".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metric_stands_out_if_intervals_do_not_overlap() {
        let of = |metric, r: f64, half: f64| Correlation { metric, r, interval: [r - half, r + half] };
        let text = stands_out(vec![of("b", 0.5, 0.1), of("a", 0.9, 0.05), of("c", 0.2, 0.6)]);
        assert!(text.contains("tracing, a correlates best") && text.contains("0.85 to 0.95"), "{text}");
        for rest in [vec![of("b", 0.5, 0.4)], vec![of("b", 0.5, 0.1), of("c", 0.2, 0.9)]] {
            let text = stands_out([rest, vec![of("a", 0.9, 0.05)]].concat());
            assert_eq!(text, "no metric known without tracing stands out");
        }
    }

    #[test]
    fn few_scattered_bvhs_give_wide_intervals() {
        // A line with a scatter of alternating sign nearly as large as its height.
        let tree = |i: u32| (f64::from(i), f64::from(i) + if i.is_multiple_of(2) { 6.0 } else { -6.0 });
        let of = |n: u32| Correlation::of("a", &(0..n).map(tree).collect::<Vec<_>>()).unwrap();
        let [few, many] = [of(8), of(64)].map(|found| found.interval[1] - found.interval[0]);
        assert!(few > 0.5 && many < 0.2, "{few} {many}");
        assert!(Correlation::of("a", &[(1.0, 1.0), (1.0, 2.0), (1.0, 3.0)]).is_none());
    }
}
