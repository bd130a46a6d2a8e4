//! Least-squares fit of traversal costs.

/// Visit kinds, and a constant cost per ray.
pub(super) const TERMS: [&str; N] = ["aligned node", "oriented node", "leaf", "block", "ray"];

/// Number of terms.
pub(super) const N: usize = 5;

/// One BVH and one set of rays: visit counts and time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) counts: [f64; N],
    pub(super) seconds: f64,
}

/// Costs in seconds per visit, and relative errors of the predicted times.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// For a group of average speed.
    pub(super) costs: [f64; N],
    /// Root mean square error.
    pub(super) residual: f64,
    /// The greatest error.
    pub(super) worst: f64,
}

/// Smallest accepted pivot of unit-length columns. Sums round by 1e-16 each, and a count that explains less than a
/// millionth of the time is noise.
const LEAST_PIVOT: f64 = 1e-12;

/// Alternating iterations over costs and speeds; after ten the first four digits no longer change.
const ITERATIONS: usize = 50;

/// The costs with the least relative error; `None` if the samples do not determine them.
///
/// A group is one set of rays through several BVHs of one scene. Groups differ in cache and branch behavior, which is
/// modeled as one speed factor per group: costs only need to rank the BVHs of one scene. Costs and factors are fitted
/// alternately.
pub(super) fn fit(groups: &[Vec<Sample>]) -> Option<Fit> {
    let mut slowness = vec![1.0; groups.len()];
    let mut costs = [0.0; N];
    for _ in 0..ITERATIONS {
        costs = non_negative(&rows(groups, &slowness))?;
        for (slowness, group) in slowness.iter_mut().zip(groups) {
            let predicted: Vec<f64> =
                group.iter().map(|sample| predicted_seconds(sample, &costs) / sample.seconds).collect();
            *slowness = predicted.iter().sum::<f64>() / predicted.iter().map(|x| x * x).sum::<f64>();
        }
        #[expect(clippy::cast_precision_loss, reason = "few groups")]
        let mean = (slowness.iter().map(|x: &f64| x.ln()).sum::<f64>() / groups.len() as f64).exp();
        slowness.iter_mut().for_each(|x| *x /= mean);
    }
    let errors: Vec<f64> = rows(groups, &slowness)
        .iter()
        .map(|row| row.iter().zip(costs).map(|(n, cost)| n * cost).sum::<f64>() - 1.0)
        .collect();
    #[expect(clippy::cast_precision_loss, reason = "few samples")]
    let residual = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    Some(Fit { costs, residual, worst: errors.iter().fold(0.0, |worst, e| e.abs().max(worst)) })
}

fn predicted_seconds(sample: &Sample, costs: &[f64; N]) -> f64 {
    sample.counts.iter().zip(costs).map(|(n, cost)| n * cost).sum()
}

/// Counts of each sample, scaled by its group's factor and divided by its time.
fn rows(groups: &[Vec<Sample>], slowness: &[f64]) -> Vec<[f64; N]> {
    let row = |sample: &Sample, slowness: f64| sample.counts.map(|n| n * slowness / sample.seconds);
    groups.iter().zip(slowness).flat_map(|(group, &s)| group.iter().map(move |sample| row(sample, s))).collect()
}

/// The non-negative costs whose weighted row sums are closest to 1; `None` if the rows do not determine them.
///
/// Terms with a negative cost are fixed at zero, the most negative first.
fn non_negative(rows: &[[f64; N]]) -> Option<[f64; N]> {
    let mut kept = [true; N];
    loop {
        let costs = least_squares(rows, &kept)?;
        let least = (0..N).min_by(|&a, &b| costs[a].total_cmp(&costs[b]))?;
        if costs[least] >= 0.0 {
            return Some(costs);
        }
        kept[least] = false;
    }
}

/// The costs of the kept terms whose weighted row sums are closest to 1; the other costs are zero.
fn least_squares(rows: &[[f64; N]], kept: &[bool; N]) -> Option<[f64; N]> {
    // Unit-length columns, so that a pivot measures a column's independence.
    let lengths: [f64; N] = std::array::from_fn(|k| rows.iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt());
    if lengths.contains(&0.0) {
        return None;
    }
    let mut matrix = [[0.0; N]; N];
    let mut right = [0.0; N];
    for row in rows {
        let row: [f64; N] = std::array::from_fn(|k| row[k] / lengths[k]);
        for i in 0..N {
            right[i] += row[i];
            for k in 0..N {
                matrix[i][k] += row[i] * row[k];
            }
        }
    }
    for k in (0..N).filter(|&k| !kept[k]) {
        right[k] = 0.0;
        matrix[k] = [0.0; N];
        matrix.iter_mut().for_each(|row| row[k] = 0.0);
        matrix[k][k] = 1.0;
    }
    let solution = solve(matrix, right)?;
    Some(std::array::from_fn(|k| solution[k] / lengths[k]))
}

/// Solves a symmetric positive system by elimination; `None` where a pivot vanishes.
fn solve(mut matrix: [[f64; N]; N], mut right: [f64; N]) -> Option<[f64; N]> {
    for i in 0..N {
        if matrix[i][i] < LEAST_PIVOT {
            return None;
        }
        for k in i + 1..N {
            let factor = matrix[k][i] / matrix[i][i];
            let above = matrix[i];
            for (x, y) in matrix[k].iter_mut().zip(above) {
                *x -= factor * y;
            }
            right[k] -= factor * right[i];
        }
    }
    let mut solution = [0.0; N];
    for i in (0..N).rev() {
        let known: f64 = (i + 1..N).map(|k| matrix[i][k] * solution[k]).sum();
        solution[i] = (right[i] - known) / matrix[i][i];
    }
    Some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [f64; N] = [10e-9, 17e-9, 13e-9, 5e-9, 30e-9];

    /// Pseudo-random counts as different from each other as those of real BVHs.
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    fn groups(n: usize, noise: f64) -> Vec<Vec<Sample>> {
        let mut state = 1u64;
        let mut next = |most: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % most
        };
        // Speeds whose geometric mean is one.
        let slowness = [0.5, 0.8, 1.0, 1.25, 2.0];
        let mut sample = |i: usize| {
            let leaves = 500 + next(4000);
            let nodes = [next(9000), next(6000)];
            let counts = [nodes[0], nodes[1], leaves, leaves + next(leaves), 1000].map(|n| n as f64);
            let exact: f64 = counts.iter().zip(KNOWN).map(|(n, cost)| n * cost).sum();
            let seconds = exact * slowness[i / n] * if i.is_multiple_of(2) { 1.0 + noise } else { 1.0 - noise };
            Sample { counts, seconds }
        };
        (0..5).map(|group| (0..n).map(|i| sample(group * n + i)).collect()).collect()
    }

    #[test]
    fn known_costs_are_recovered() {
        let fit = fit(&groups(8, 0.0)).expect("they are independent");
        for (cost, known) in fit.costs.iter().zip(KNOWN) {
            assert!((cost / known - 1.0).abs() < 1e-6, "{cost} for {known}");
        }
        assert!(fit.worst < 1e-9, "{fit:?}");
    }

    #[test]
    fn noise_appears_in_the_residual() {
        let fit = fit(&groups(40, 0.05)).expect("they are independent");
        assert!(fit.residual > 0.04 && fit.residual < 0.06 && fit.worst >= fit.residual, "{fit:?}");
        assert!(fit.costs.iter().zip(KNOWN).all(|(cost, known)| (cost / known - 1.0).abs() < 0.25), "{fit:?}");
    }

    #[test]
    fn negative_costs_become_zero() {
        // Time that falls with the number of blocks, in the group whose speed is one.
        let mut all = vec![groups(20, 0.0).swap_remove(2)];
        all.iter_mut().flatten().for_each(|sample| sample.seconds -= 6e-9 * sample.counts[3]);
        let fit = fit(&all).expect("they are independent");
        assert!(fit.costs[3] == 0.0 && fit.costs.iter().all(|&cost| cost >= 0.0), "{fit:?}");
        assert!(fit.worst > 1e-6, "{fit:?}");
    }

    #[test]
    fn dependent_counts_are_rejected() {
        let mut all = groups(8, 0.0);
        // Every leaf has one block.
        all.iter_mut().flatten().for_each(|sample| sample.counts[3] = sample.counts[2]);
        assert!(fit(&all).is_none());
        all.iter_mut().flatten().for_each(|sample| sample.counts[1] = 0.0);
        assert!(fit(&all).is_none() && fit(&[]).is_none());
    }
}
