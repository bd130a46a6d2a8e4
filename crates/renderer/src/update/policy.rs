//! Refit or rebuild a BVH whose triangles have moved.
//!
//! Let `B` be the cost of a build, and `c_i` that of frame `i` after it: a refit, and the extra time of rays through boxes that have
//! grown. If these costs never fall, the mean cost of a frame is least if the BVH is rebuilt at the first frame `n` whose `c_n`
//! exceeds the mean so far, `(B + c_1 + ... + c_(n-1)) / n`: a smaller `c_n` lowers the mean, a greater one raises it.
//! The costs are measured, except for the extra time, which is predicted: a drift of `d` makes rays through the BVH `d` times as
//! slow, as measured for drifts up to 2.2 (`benches/TRIED.md`). All time of a frame's rays counts as traversal, so the extra time is
//! an upper bound.

/// How [`Prepared::update`](crate::Prepared::update) updates BVHs whose triangles have moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum UpdatePolicy {
    /// Refits until a rebuild pays for itself over the rays of the following frames.
    #[default]
    Auto,
    /// Always refits, where the kind of BVH supports it.
    Refit,
    /// Always rebuilds.
    Rebuild,
}

/// Costs of one BVH since it was built, in seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BvhCosts {
    /// The last refit; zero before the first one.
    refit: f64,
    /// The build, and refits and extra time since.
    sum: f64,
    /// Frames since the build, that of the build included.
    n_frames: u32,
    /// Drift at the last frame and at the one before; 1 after a build.
    drift: [f64; 2],
    /// Drift one frame after a build, as last measured.
    first_drift: f64,
}

impl BvhCosts {
    /// The costs of a new BVH.
    pub(crate) fn built_in(seconds: f64) -> Self {
        Self { refit: 0.0, sum: seconds, n_frames: 1, drift: [1.0; 2], first_drift: 1.0 }
    }

    /// Adds a build.
    pub(crate) fn rebuilt_in(&mut self, seconds: f64) {
        // Without a refit, the drift after a build is not measured: it is trusted less and less, until one refit tries again.
        const TRUST: f64 = 0.97;
        let first_drift = 1.0 + TRUST * (self.first_drift - 1.0);
        *self = Self { refit: self.refit, first_drift, ..Self::built_in(seconds) };
    }

    /// Whether to rebuild at once, by the drift that the last frames predict; rays through the BVH took `trace` seconds in the
    /// last frame.
    pub(crate) fn predicts_rebuild(&self, trace: f64) -> bool {
        let [last, before] = self.drift;
        let next = if self.n_frames == 1 { self.first_drift } else { (2.0 * last - before).max(1.0) };
        self.exceeds_mean(self.refit + self.extra(next, trace))
    }

    /// Adds a refit. Returns whether to rebuild after all.
    pub(crate) fn refitted_in(&mut self, seconds: f64, drift: f64, trace: f64) -> bool {
        if self.n_frames == 1 {
            self.first_drift = drift;
        }
        let cost = seconds + self.extra(drift, trace);
        let is_old = self.exceeds_mean(cost);
        self.refit = seconds;
        self.sum += cost;
        self.n_frames += 1;
        self.drift = [drift, self.drift[0]];
        is_old
    }

    /// Extra seconds of a frame's rays at a drift, if those of the last frame took `trace` seconds at its drift.
    fn extra(&self, drift: f64, trace: f64) -> f64 {
        trace * (drift - 1.0).max(0.0) / self.drift[0].max(1.0)
    }

    fn exceeds_mean(&self, cost: f64) -> bool {
        cost > self.sum / f64::from(self.n_frames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rebuilds in 1000 frames, and all costs, where frame `i` after a build has the drift `1 + rate * i`.
    fn run(build: f64, refit: f64, trace: f64, rate: f64, period: Option<u32>) -> (u32, f64) {
        let mut costs = BvhCosts::built_in(build);
        let (mut n_rebuilds, mut all, mut age, mut drift) = (0, build, 0, 1.0);
        for _ in 0..1000 {
            // The time of the last frame's rays, at its drift.
            let measured = trace * drift;
            age += 1;
            let mut rebuilds = period.map_or_else(|| costs.predicts_rebuild(measured), |period| age == period);
            if !rebuilds {
                drift = 1.0 + rate * f64::from(age);
                all += refit;
                rebuilds = costs.refitted_in(refit, drift, measured) && period.is_none();
            }
            if rebuilds {
                (age, drift) = (0, 1.0);
                costs.rebuilt_in(build);
                all += build;
                n_rebuilds += 1;
            }
            all += trace * (drift - 1.0);
        }
        (n_rebuilds, all)
    }

    /// Costs at most 5 % more than the best of all fixed periods, from rebuilds in every frame to none.
    #[test]
    fn the_policy_is_close_to_the_best_period() {
        for build in [0.01, 0.1, 1.0] {
            for refit in [0.05, 0.2].map(|part| part * build) {
                for rate in [0.0, 1e-4, 0.01, 0.1, 2.0] {
                    for trace in [0.01, 0.3, 10.0] {
                        let (n_rebuilds, ours) = run(build, refit, trace, rate, None);
                        let best = (1..=1001).map(|period| run(build, refit, trace, rate, Some(period)).1);
                        let best = best.fold(f64::INFINITY, f64::min);
                        let what = format!("build {build}, refit {refit}, drift {rate} a frame, trace {trace}");
                        assert!(ours <= 1.05 * best, "{what}: {ours} of {best} with {n_rebuilds} rebuilds");
                        assert!(rate > 0.0 || n_rebuilds == 0, "{what}: {n_rebuilds} rebuilds without drift");
                    }
                }
            }
        }
    }
}
