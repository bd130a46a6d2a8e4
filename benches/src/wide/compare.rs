//! How often an engine's answers differ from those of testing every triangle.

use canted_trace::Hit;

/// Greatest difference of `t`, relative to the true one, that rounding explains at these distances.
///
/// A Möller-Trumbore test in `f32` accumulates about ten roundings of 6e-8 relative to coordinates; grazing and distant
/// rays multiply them. A difference beyond a hundred times that counts as another hit.
const T_TOLERANCE: f32 = 1e-4;

/// Answers that differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Verdict {
    /// The engine misses an existing hit.
    pub(crate) lost: usize,
    /// The engine reports a hit where there is none.
    pub(crate) invented: usize,
    /// Both hit, at distances that rounding does not explain.
    pub(crate) elsewhere: usize,
}

/// Compares nearest hits.
pub(crate) fn closest(truth: &[Option<Hit>], answers: &[Option<Hit>]) -> Verdict {
    let mut verdict = Verdict::default();
    for (truth, answer) in truth.iter().zip(answers) {
        match (truth, answer) {
            (Some(_), None) => verdict.lost += 1,
            (None, Some(_)) => verdict.invented += 1,
            (Some(truth), Some(answer)) if !is_near(truth.t, answer.t) => verdict.elsewhere += 1,
            _ => {}
        }
    }
    verdict
}

/// Whether rounding explains the difference; it never explains a NaN.
fn is_near(truth: f32, t: f32) -> bool {
    (truth - t).abs() <= T_TOLERANCE * truth
}

/// Compares occlusion.
pub(crate) fn occluded(truth: &[bool], answers: &[bool]) -> Verdict {
    let count = |is: bool| truth.iter().zip(answers).filter(|&(&truth, &answer)| truth == is && answer != is).count();
    Verdict { lost: count(true), invented: count(false), elsewhere: 0 }
}

#[cfg(test)]
mod tests {
    use canted_obb::PrimId;
    use canted_trace::{InstanceId, Side};

    use super::*;

    fn at(t: f32) -> Option<Hit> {
        Some(Hit { t, u: 0.0, v: 0.0, primitive: PrimId(0), instance: InstanceId(0), side: Side::Front })
    }

    #[test]
    fn each_difference_is_counted_once() {
        let truth = [None, None, at(1.0), at(1.0), at(1.0), at(1.0)];
        let answers = [None, at(1.0), None, at(1.000_05), at(1.001), at(f32::NAN)];
        assert_eq!(closest(&truth, &answers), Verdict { lost: 1, invented: 1, elsewhere: 2 });
        assert_eq!(closest(&truth, &truth), Verdict::default());
        let verdict = occluded(&[true, true, false, false], &[true, false, false, true]);
        assert_eq!(verdict, Verdict { lost: 1, invented: 1, elsewhere: 0 });
    }
}
