//! Which of eight primitives a ray may reach, and where at the earliest.

use crate::simd::Simd;

/// Primitives that a ray may hit. What is NaN is among them.
#[derive(Clone, Copy)]
pub(crate) struct Reached<S: Simd> {
    pub(crate) lanes: u32,
    /// Lower bounds of the `t` of their hits, times the square of the direction.
    pub(crate) from: S::F,
    /// The square of the direction.
    pub(crate) squared: f32,
}

impl<S: Simd> Reached<S> {
    /// All lanes that the ray may reach at `t <= t_max`. The product rounds as bounds allow, or overflows and keeps all.
    #[inline(always)]
    pub(crate) fn until(&self, simd: S, t_max: f32) -> u32 {
        !simd.lt(simd.splat(t_max * self.squared), self.from) & 0xff
    }

    /// Calls `visit` with the lanes in the order in which the ray may reach them, and with the `t` that is still searched, which it returns; a negative number ends it.
    /// Lanes beyond that are passed over.
    #[inline(always)]
    pub(crate) fn each(self, simd: S, mut t_max: f32, visit: &mut impl VisitLane) -> f32 {
        let mut lanes = self.lanes;
        if lanes & lanes.wrapping_sub(1) == 0 {
            return if lanes == 0 { t_max } else { visit.lane(lanes.trailing_zeros() as usize, t_max) };
        }
        let from = simd.store(self.from);
        while lanes != 0 {
            let (mut rest, mut best) = (lanes & (lanes - 1), lanes.trailing_zeros() as usize & 7);
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize & 7;
                rest &= rest - 1;
                best = if from[lane] < from[best] { lane } else { best };
            }
            lanes &= !(1 << best);
            t_max = visit.lane(best, t_max);
            if t_max < 0.0 {
                break;
            }
            lanes &= self.until(simd, t_max);
        }
        t_max
    }
}

/// What is done with a lane. A trait instead of a closure, which is not always compiled for the instructions of a path.
pub(crate) trait VisitLane {
    /// Returns the new `t_max`.
    fn lane(&mut self, lane: usize, t_max: f32) -> f32;
}
