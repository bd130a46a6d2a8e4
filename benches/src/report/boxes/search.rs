//! The least box of a set of points that a search over rotations finds: what fits and merges are compared with.
//!
//! No closed form gives the least area; of the rotations tried, the fits' own among them, the best is improved by ever smaller
//! turns. So a ratio to it is at least one by construction.

use canted_fixtures::SplitMix64;
use canted_obb::{Frame, Obb, Quaternion, bound};
use canted_tests::clouds::random_rotation;

/// Rotations tried before the best are improved.
const N_TRIED: usize = 400;

/// Of these many each is improved.
const N_IMPROVED: usize = 4;

/// First and last angle of the turns that improve one, and by how much they shrink.
const TURNS_RAD: [f64; 2] = [0.2, 1e-4];
const SHRINK: f64 = 0.6;

/// What was found of one size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Least {
    pub(super) size: f64,
    /// The second least of what the improved rotations came to over the least of them: how far the search may be from its aim.
    pub(super) second: f64,
}

/// Least area and least volume around `points`, of everything that is tried, `known` boxes included.
pub(super) fn least(points: &[[f32; 3]], known: &[Obb], seed: u64) -> [Least; 2] {
    [Obb::area, Obb::volume].map(|size| {
        let [searched, second] = least_of(points, size, seed);
        Least { size: known.iter().map(size).fold(searched, f64::min), second: second / searched }
    })
}

/// The two least sizes that the best rotations come to.
fn least_of(points: &[[f32; 3]], size: fn(&Obb) -> f64, seed: u64) -> [f64; 2] {
    let of = |q: Quaternion| size(&along(q.frame(), points));
    let mut rng = SplitMix64::new(seed);
    let mut tried: Vec<(f64, Quaternion)> =
        (0..N_TRIED).map(|_| random_rotation(&mut rng)).map(|q| (of(q), q)).collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut improved: Vec<f64> = tried.into_iter().take(N_IMPROVED).map(|start| improved(start, &of)).collect();
    improved.sort_by(f64::total_cmp);
    [improved[0], improved[1]]
}

fn along(frame: Frame, points: &[[f32; 3]]) -> Obb {
    bound(frame, points.iter().copied())
}

/// The least size on a way down by turns about the three axes.
fn improved(start: (f64, Quaternion), of: &impl Fn(Quaternion) -> f64) -> f64 {
    let mut best = start;
    let [mut angle, last] = TURNS_RAD;
    while angle > last {
        let turned = |i: usize| {
            let mut axis = [0.0; 3];
            axis[i / 2] = 1.0;
            let q =
                Quaternion::about(axis, if i.is_multiple_of(2) { angle } else { -angle }).times(best.1).normalised();
            (of(q), q)
        };
        match (0..6).map(turned).min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some(next) if next.0 < best.0 => best = next,
            _ => angle *= SHRINK,
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use canted_tests::clouds::placed;

    use super::*;

    #[test]
    fn a_turned_box_is_found() {
        let mut rng = SplitMix64::new(8);
        for seed in 0..5 {
            let turn = random_rotation(&mut rng);
            let sign = |i: usize, k: usize| if i >> k & 1 == 1 { 1.0 } else { -1.0 };
            let corners: Vec<[f32; 3]> =
                (0..8).map(|i| placed(&turn, [3.0, 1.0, 0.5], [0.0; 3], [0, 1, 2].map(|k| sign(i, k)))).collect();
            let found = least(&corners, &[], seed);
            let [area, volume] = found.map(|least| least.size);
            // 8·(3·1 + 3·0.5 + 1·0.5), 8·3·1·0.5, and what the last turns leave.
            assert!((40.0 - 1e-4..40.1).contains(&area) && (12.0 - 1e-4..12.1).contains(&volume), "{area} {volume}");
            // A smaller box that is known is the least, whatever the search found; the search's own gap stays.
            let known = Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half: [1.0; 3] };
            let beside = least(&corners, &[known], seed)[0];
            assert!(beside.size == 24.0 && beside.second == found[0].second && beside.second >= 1.0, "{beside:?}");
        }
    }
}
