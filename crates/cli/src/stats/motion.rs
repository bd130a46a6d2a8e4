//! What updates between the frames of an animation cost, and when `--update auto` rebuilds.

use std::path::Path;

use anyhow::{Result, anyhow};
use canted_renderer::{SceneBvh, SceneBvhConfig, UpdateOptions, UpdatePolicy};
use canted_scene::{AnimatedScene, ReadOptions};
use serde_json::{Value, json};

use crate::load;

/// Frames after the first one, at [`FPS`].
const N_FRAMES: u8 = 8;

const FPS: f32 = 24.0;

/// Measurements of consecutive frames.
pub(super) struct Motion {
    /// Seconds to prepare the first frame.
    build: f64,
    /// For each frame, the seconds of the refit and the greatest drift.
    refits: Vec<(f64, f64)>,
    /// BVHs over triangles that change from frame to frame, and all.
    n_changing: usize,
    n_bvhs: usize,
}

/// Refits the structure of an animated file through some frames; `None` for other scenes.
pub(super) fn measure(
    path: Option<&Path>,
    first: f32,
    options: &ReadOptions,
    config: &SceneBvhConfig,
) -> Result<Option<Motion>> {
    let Some(path) = path.filter(|path| !load::is_scene_file(path)) else { return Ok(None) };
    let (mut animated, mut scene) = AnimatedScene::open(path, options)?;
    if !animated.is_animated() {
        return Ok(None);
    }
    let mut bvh = SceneBvh::build(&scene, config)?;
    let build = bvh.build_time.as_secs_f64();
    let options = UpdateOptions { policy: UpdatePolicy::Refit, ..UpdateOptions::default() };
    let (mut refits, mut n_changing) = (Vec::new(), 0);
    for frame in 1..=N_FRAMES {
        animated.pose(first + f32::from(frame) / FPS, &mut scene)?;
        let updates = bvh.update(&scene, &options).map_err(|error| anyhow!("frame {frame}: {error}"))?;
        n_changing = n_changing.max(updates.refits + updates.rebuilds);
        refits.push((updates.time.as_secs_f64(), f64::from(updates.max_drift).max(1.0)));
    }
    Ok(Some(Motion { build, refits, n_changing, n_bvhs: bvh.bottom().len() }))
}

impl Motion {
    /// The least seconds of rays in a frame for which `--update auto` rebuilds within these frames, if any do.
    ///
    /// Solves the rule of `canted_renderer::UpdatePolicy` for the time of the rays, which is linear in it.
    fn crossing(&self) -> Option<f64> {
        let (mut refits, mut extra, mut least) = (0.0, 0.0, None);
        for (n, &(refit, drift)) in (1_u32..).zip(&self.refits) {
            let n = f64::from(n);
            let (numerator, slope) = (self.build + refits - n * refit, n * (drift - 1.0) - extra);
            if slope > 0.0 {
                let crossing = (numerator / slope).max(0.0);
                least = Some(least.map_or(crossing, |known: f64| known.min(crossing)));
            }
            refits += refit;
            extra += drift - 1.0;
        }
        least
    }

    /// The median time of the refits in milliseconds, and the last drift.
    fn typical(&self) -> (f64, f64) {
        let mut times: Vec<f64> = self.refits.iter().map(|&(time, _)| 1e3 * time).collect();
        times.sort_by(f64::total_cmp);
        (times[times.len() / 2], self.refits.last().map_or(1.0, |&(_, drift)| drift))
    }

    /// One JSON object.
    pub(super) fn json(&self) -> Value {
        let (update_ms, drift) = self.typical();
        json!({
            "frames": self.refits.len(),
            "fps": FPS,
            "bvhs": self.n_bvhs,
            "changing_bvhs": self.n_changing,
            "build_ms": 1e3 * self.build,
            "update_ms": update_ms,
            "drift": drift,
            "rebuild_above_seconds": self.crossing(),
        })
    }

    /// Sentences.
    pub(super) fn text(&self) -> String {
        let (update_ms, drift) = self.typical();
        let decision = match self.crossing() {
            Some(seconds) => {
                format!("rebuilds within them if the rays of a frame take more than {seconds:.3} s, else refits")
            }
            None => "refits in all of them".to_owned(),
        };
        format!(
            "\nMotion, {} frames at {FPS} per second: {} of {} BVHs over triangles change. A build takes {:.2} ms, a refit {update_ms:.2} \
             ms; the last frame has drift {drift:.2}.\n--update auto {decision}.\n",
            self.refits.len(),
            self.n_changing,
            self.n_bvhs,
            1e3 * self.build
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The crossing separates times for which the rule, applied frame by frame, rebuilds.
    #[test]
    fn the_crossing_is_where_the_rule_rebuilds() {
        let rebuilds = |motion: &Motion, trace: f64| {
            let (mut sum, mut n) = (motion.build, 1.0);
            motion.refits.iter().any(|&(refit, drift)| {
                let cost = refit + trace * (drift - 1.0);
                let is_old = cost > sum / n;
                (sum, n) = (sum + cost, n + 1.0);
                is_old
            })
        };
        for (build, rate) in [(0.1, 0.01), (1.0, 0.3), (0.02, 2.0)] {
            let refits = (1..=8).map(|n| (0.05 * build, 1.0 + rate * f64::from(n))).collect();
            let motion = Motion { build, refits, n_changing: 1, n_bvhs: 1 };
            let crossing = motion.crossing().unwrap();
            assert!(rebuilds(&motion, 1.001 * crossing) && !rebuilds(&motion, 0.999 * crossing), "{build}, {rate}");
        }
        let still = Motion { build: 1.0, refits: vec![(0.1, 1.0); 8], n_changing: 0, n_bvhs: 1 };
        assert_eq!(still.crossing(), None);
    }
}
