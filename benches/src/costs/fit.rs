//! Costs by least squares.

/// Kinds of visits, and the ray itself.
pub(super) const TERMS: [&str; N] = ["aligned node", "oriented node", "leaf", "block", "ray"];

/// Number of terms.
pub(super) const N: usize = 5;

/// One tree and one set of rays: how often what was visited, and the time it took.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) counts: [f64; N],
    pub(super) seconds: f64,
}

/// Costs in seconds a visit, and relative errors of times foretold by them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// As a group of middling speed pays them.
    pub(super) costs: [f64; N],
    /// Root of the mean square.
    pub(super) residual: f64,
    /// The greatest.
    pub(super) worst: f64,
}

/// A pivot below this says that columns of length one depend on each other: rounding of the sums is 1e-16 each, and
/// counts that say less than a millionth of a time are noise.
const LEAST_PIVOT: f64 = 1e-12;

/// Turns of fitting costs and speeds, each by the other; after ten nothing changes in the fourth digit.
const TURNS: usize = 50;

/// The costs whose sums over counts err least, each relative to its time; `None` where samples do not determine them.
///
/// A group is one set of rays through several trees of one scene. Groups differ by what the cache holds and which
/// branches are foreseen; that is taken for a speed of the group, which all of its visits share, for trees of one scene
/// are all that costs are there to choose among. Costs and speeds are fitted in turn.
pub(super) fn fit(groups: &[Vec<Sample>]) -> Option<Fit> {
    let mut slowness = vec![1.0; groups.len()];
    let mut costs = [0.0; N];
    for _ in 0..TURNS {
        costs = non_negative(&rows(groups, &slowness))?;
        for (slowness, group) in slowness.iter_mut().zip(groups) {
            let told: Vec<f64> = group.iter().map(|sample| foretold(sample, &costs) / sample.seconds).collect();
            *slowness = told.iter().sum::<f64>() / told.iter().map(|x| x * x).sum::<f64>();
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

fn foretold(sample: &Sample, costs: &[f64; N]) -> f64 {
    sample.counts.iter().zip(costs).map(|(n, cost)| n * cost).sum()
}

/// Counts of each sample as its group weighs them, a second of its time.
fn rows(groups: &[Vec<Sample>], slowness: &[f64]) -> Vec<[f64; N]> {
    let row = |sample: &Sample, slowness: f64| sample.counts.map(|n| n * slowness / sample.seconds);
    groups.iter().zip(slowness).flat_map(|(group, &s)| group.iter().map(move |sample| row(sample, s))).collect()
}

/// The costs by which all rows come nearest to 1, none below zero; `None` where rows do not determine them.
///
/// A visit that seems to save time takes none: such terms are left out, the one furthest below zero first.
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

/// The costs of the terms that are kept, by which all rows come nearest to 1; the others cost nothing.
fn least_squares(rows: &[[f64; N]], kept: &[bool; N]) -> Option<[f64; N]> {
    // Columns of length one, so that a pivot says how much of its own a column has left.
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

    /// Counts as different from each other as those of trees are, by a generator of whole numbers.
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
    fn known_costs_come_back() {
        let fit = fit(&groups(8, 0.0)).expect("they are independent");
        for (cost, known) in fit.costs.iter().zip(KNOWN) {
            assert!((cost / known - 1.0).abs() < 1e-6, "{cost} for {known}");
        }
        assert!(fit.worst < 1e-9, "{fit:?}");
    }

    #[test]
    fn noise_shows_in_the_residual() {
        let fit = fit(&groups(40, 0.05)).expect("they are independent");
        assert!(fit.residual > 0.04 && fit.residual < 0.06 && fit.worst >= fit.residual, "{fit:?}");
        assert!(fit.costs.iter().zip(KNOWN).all(|(cost, known)| (cost / known - 1.0).abs() < 0.25), "{fit:?}");
    }

    #[test]
    fn a_visit_that_seems_to_save_time_takes_none() {
        // Time that falls with the number of blocks, in the group whose speed is one.
        let mut all = vec![groups(20, 0.0).swap_remove(2)];
        all.iter_mut().flatten().for_each(|sample| sample.seconds -= 6e-9 * sample.counts[3]);
        let fit = fit(&all).expect("they are independent");
        assert!(fit.costs[3] == 0.0 && fit.costs.iter().all(|&cost| cost >= 0.0), "{fit:?}");
        assert!(fit.worst > 1e-6, "{fit:?}");
    }

    #[test]
    fn kinds_that_cannot_be_told_apart_are_refused() {
        let mut all = groups(8, 0.0);
        // Every leaf of one block.
        all.iter_mut().flatten().for_each(|sample| sample.counts[3] = sample.counts[2]);
        assert!(fit(&all).is_none());
        all.iter_mut().flatten().for_each(|sample| sample.counts[1] = 0.0);
        assert!(fit(&all).is_none() && fit(&[]).is_none());
    }
}
