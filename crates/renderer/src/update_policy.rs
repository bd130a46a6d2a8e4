//! Refit or rebuild a BVH whose triangles have moved.
//!
//! Let `B` be the cost of a build, and `c_i` that of frame `i` after it: a refit, and the extra time of rays through boxes that have
//! grown. If these costs never fall, the mean cost of a frame is least if the BVH is rebuilt at the first frame `n` whose `c_n`
//! exceeds the mean so far, `(B + c_1 + ... + c_(n-1)) / n`: a smaller `c_n` lowers the mean, a greater one raises it.
//! With the cost of a refit `r`, the time of a frame's rays `T` and drifts `1 + d_i`, `c_i = r + T·d_i`, and the rule is to rebuild where
//!
//! ```text
//! r + T·(n·d_n - (d_1 + ... + d_(n-1))) > B
//! ```
//!
//! Without drift that is `r > B`. A refit is part of what a build does, so a longer one was measured while the machine was busy:
//! `r` is at most `B`, and noise alone never causes a rebuild. The extra time `T·d` is predicted: a drift of `1 + d` makes rays through the
//! BVH `1 + d` times as slow, as measured for drifts up to 2.2 (`benches/TRIED.md`). All time of a frame's rays counts as traversal, so
//! the extra time is an upper bound.
//!
//! A machine that does other work makes single measurements too long, never too short. So each cost is a floor, [`Floor`]: the
//! least that was measured, which grows slowly where all measurements are greater. A build that was measured once may be far too
//! long: until the second one it counts as at most [`BvhCosts::MOST_REFITS`] refits.

/// How [`SceneBvh::update`](crate::SceneBvh::update) updates BVHs whose triangles have moved.
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

impl UpdatePolicy {
    /// All policies.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Refit, Self::Rebuild];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Refit => "refit",
            Self::Rebuild => "rebuild",
        }
    }
}

/// A time in seconds, measured again and again.
#[derive(Clone, Copy, Debug)]
struct Floor(f64);

impl Floor {
    /// Growth a measurement where all are greater.
    const GROWTH: f64 = 1.1;

    /// Takes a measurement in.
    fn add(&mut self, seconds: f64) {
        self.0 = seconds.min(Self::GROWTH * self.0);
    }
}

/// Costs of one BVH since it was built, in seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BvhCosts {
    build: Floor,
    /// Builds that were measured.
    n_builds: u32,
    refit: Floor,
    /// Rays of a frame through the BVH as it was built.
    trace: Floor,
    /// Sum of the drifts above 1 of all frames since the build.
    excess: f64,
    /// Frames since the build, that of the build included.
    n_frames: u32,
    /// Drift at the last frame and at the one before; 1 after a build.
    drift: [f64; 2],
    /// Drift one frame after a build, as last measured.
    first_drift: f64,
}

impl BvhCosts {
    /// Most refits that a build takes as long as, if it was measured only once. A scaffold of 105,000 triangles needs about ten.
    const MOST_REFITS: f64 = 64.0;

    /// The costs of a new BVH.
    pub(crate) fn built_in(seconds: f64) -> Self {
        let unknown = Floor(f64::INFINITY);
        let (build, refit, trace) = (Floor(seconds), unknown, unknown);
        Self { build, n_builds: 1, refit, trace, excess: 0.0, n_frames: 1, drift: [1.0; 2], first_drift: 1.0 }
    }

    /// Adds a build.
    pub(crate) fn rebuilt_in(&mut self, seconds: f64) {
        // Without a refit, the drift after a build is not measured: it is trusted less and less, until one refit tries again.
        const TRUST: f64 = 0.97;
        let first_drift = 1.0 + TRUST * (self.first_drift - 1.0);
        self.build.add(seconds);
        let n_builds = self.n_builds.saturating_add(1);
        *self = Self { n_builds, excess: 0.0, n_frames: 1, drift: [1.0; 2], first_drift, ..*self };
    }

    /// Forgets what was measured: the triangles are others.
    pub(crate) fn replaced_in(&mut self, seconds: f64) {
        *self = Self::built_in(seconds);
    }

    /// Whether to rebuild at once, by the drift that the last frames predict; rays through the BVH took `trace` seconds in the
    /// last frame.
    pub(crate) fn predicts_rebuild(&mut self, trace: f64) -> bool {
        let [last, before] = self.drift;
        self.trace.add(trace / last.max(1.0));
        let next = if self.n_frames == 1 { self.first_drift } else { (2.0 * last - before).max(1.0) };
        self.is_worth_a_build(next)
    }

    /// Adds a refit. Returns whether to rebuild after all.
    pub(crate) fn refitted_in(&mut self, seconds: f64, drift: f64) -> bool {
        if self.n_frames == 1 {
            self.first_drift = drift;
        }
        self.refit.add(seconds);
        let is_old = self.is_worth_a_build(drift);
        self.excess += (drift - 1.0).max(0.0);
        self.n_frames = self.n_frames.saturating_add(1);
        self.drift = [drift, self.drift[0]];
        is_old
    }

    /// The rule, for a next frame of this drift.
    fn is_worth_a_build(&self, drift: f64) -> bool {
        // What was not measured yet costs nothing: it is tried.
        let known = |floor: Floor| if floor.0.is_finite() { floor.0 } else { 0.0 };
        let most = if self.n_builds == 1 { Self::MOST_REFITS * self.refit.0 } else { f64::INFINITY };
        let build = self.build.0.min(most);
        let extra = known(self.trace) * (f64::from(self.n_frames) * (drift - 1.0).max(0.0) - self.excess);
        known(self.refit).min(build) + extra > build
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A machine on which nothing else runs.
    fn idle() -> f64 {
        1.0
    }

    /// Rebuilds in 1000 frames, and all costs, where frame `i` after a build has the drift `1 + rate * i`. Measurements are too
    /// long by the factors `noise`; the costs that are returned are not.
    fn run([build, refit, trace, rate]: [f64; 4], period: Option<u32>, mut noise: impl FnMut() -> f64) -> (u32, f64) {
        let mut costs = BvhCosts::built_in(build * noise());
        let (mut n_rebuilds, mut all, mut age, mut drift) = (0, build, 0, 1.0);
        for _ in 0..1000 {
            // The time of the last frame's rays, at its drift.
            let measured = trace * drift * noise();
            age += 1;
            let mut rebuilds = period.map_or_else(|| costs.predicts_rebuild(measured), |period| age == period);
            if !rebuilds {
                drift = 1.0 + rate * f64::from(age);
                all += refit;
                rebuilds = costs.refitted_in(refit * noise(), drift) && period.is_none();
            }
            if rebuilds {
                (age, drift) = (0, 1.0);
                costs.rebuilt_in(build * noise());
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
                        let times = [build, refit, trace, rate];
                        let (n_rebuilds, ours) = run(times, None, idle);
                        let best = (1..=1001).map(|period| run(times, Some(period), idle).1);
                        let best = best.fold(f64::INFINITY, f64::min);
                        let what = format!("build {build}, refit {refit}, drift {rate} a frame, trace {trace}");
                        assert!(ours <= 1.05 * best, "{what}: {ours} of {best} with {n_rebuilds} rebuilds");
                        // On a busy machine, a third of the measurements take up to a hundred times as long.
                        for seed in 1..=4_u32 {
                            let mut state = seed;
                            let busy = || {
                                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                                let [low, high] = [state >> 8 & 0xff, state >> 16 & 0xff].map(f64::from);
                                if high < 85.0 { 1.0 + low / 2.56 } else { 1.0 + low / 2560.0 }
                            };
                            let (n_rebuilds, ours) = run(times, None, busy);
                            assert!(
                                rate > 0.0 || n_rebuilds == 0,
                                "{what}: {n_rebuilds} rebuilds by noise, seed {seed}"
                            );
                            assert!(ours <= 1.1 * best, "{what}: {ours} of {best} on a busy machine, seed {seed}");
                        }
                        assert!(rate > 0.0 || n_rebuilds == 0, "{what}: {n_rebuilds} rebuilds without drift");
                    }
                }
            }
        }
    }
}
