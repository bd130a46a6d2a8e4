//! Which of eight primitives a ray may reach, and where at the earliest.

use canted_trace::ScaledRay;
use canted_trace::lanes::UNIT_ROUNDOFF as U;

use super::ray::splat3;
use crate::simd::Simd;

/// The line of a ray, in every lane.
pub(crate) struct RayLine<S: Simd> {
    pub(super) origin: [S::F; 3],
    pub(super) direction: [S::F; 3],
    pub(super) direction_squared: f32,
    /// At least the length of the direction.
    pub(super) length: S::F,
    /// Where the ray starts, times the square of the direction.
    pub(super) start: S::F,
    /// Those of the filter that the line is for.
    pub(super) errors: [S::F; 4],
}

impl<S: Simd> RayLine<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, ray: &ScaledRay, [a, b, c, d]: [f32; 4]) -> Self {
        let [x, y, z] = ray.direction;
        let direction_squared = x * x + y * y + z * z;
        Self {
            origin: splat3(simd, ray.origin),
            direction: splat3(simd, ray.direction),
            direction_squared,
            length: simd.splat(direction_squared.sqrt() * (1.0 + 4.0 * U)),
            start: simd.splat(ray.t_min * direction_squared),
            errors: [simd.splat(a), simd.splat(b), simd.splat(c), simd.splat(d)],
        }
    }
}

/// Primitives that a ray may hit. What is NaN is among them.
#[derive(Clone, Copy)]
pub(crate) struct Reached<S: Simd> {
    pub(crate) lanes: u32,
    /// Those of them that it certainly enters in its interval, if they are what is around them.
    pub(crate) certain: u32,
    /// Lower bounds of the `t` of their hits, times the square of the direction.
    pub(crate) from: S::F,
    /// The square of the direction.
    pub(crate) squared: f32,
}

impl<S: Simd> Reached<S> {
    /// No lanes.
    #[inline(always)]
    pub(super) fn none(simd: S) -> Self {
        Self { lanes: 0, certain: 0, from: simd.splat(0.0), squared: 0.0 }
    }

    /// All lanes that the ray may reach at `t <= t_max`. The product rounds as bounds allow, or overflows and keeps all.
    #[inline(always)]
    pub(crate) fn until(&self, simd: S, t_max: f32) -> u32 {
        !simd.lt(simd.splat(t_max * self.squared), self.from) & 0xff
    }

    /// Calls `visit` with the lanes in the order in which the ray may reach them, and with the `t` that is still searched, which it
    /// returns; a negative number ends it.
    /// Lanes beyond that are skipped.
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

/// The scalar product.
#[inline(always)]
pub(super) fn dot<S: Simd>(simd: S, a: [S::F; 3], b: [S::F; 3]) -> S::F {
    simd.mul_add(a[0], b[0], simd.mul_add(a[1], b[1], simd.mul(a[2], b[2])))
}

/// What is done with a lane. A trait instead of a closure, which is not always compiled for the instructions of a path.
pub(crate) trait VisitLane {
    /// Returns the new `t_max`.
    fn lane(&mut self, lane: usize, t_max: f32) -> f32;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SimdPath;
    use crate::simd::Task;

    /// Remembers the lanes, and finds a hit at its bound in each lane of `hits`.
    struct Remembered<'a> {
        from: &'a [f32; 8],
        hits: u32,
        lanes: Vec<usize>,
    }

    impl VisitLane for Remembered<'_> {
        fn lane(&mut self, lane: usize, t_max: f32) -> f32 {
            self.lanes.push(lane);
            if self.hits >> lane & 1 != 0 { t_max.min(self.from[lane]) } else { t_max }
        }
    }

    struct Each<'a>(u32, &'a [f32; 8], u32);

    impl Task for Each<'_> {
        type Output = (Vec<usize>, f32);

        #[inline(always)]
        fn on<S: Simd>(self, simd: S) -> Self::Output {
            let Self(lanes, from, hits) = self;
            let reached = Reached { lanes, certain: 0, from: simd.load(from), squared: 1.0 };
            let mut visit = Remembered { from, hits, lanes: vec![] };
            let t_max = reached.each(simd, 10.0, &mut visit);
            (visit.lanes, t_max)
        }
    }

    #[test]
    fn lanes_are_visited_nearest_first_up_to_the_hit() {
        let from = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0];
        for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
            let each = |lanes, hits| path.available().run(Each(lanes, &from, hits));
            assert_eq!(each(0, 0), (vec![], 10.0));
            assert_eq!(each(0b1000_0000, 0), (vec![7], 10.0));
            assert_eq!(each(0xff, 0), (vec![1, 3, 6, 0, 2, 4, 7, 5], 10.0));
            // Equal bounds are visited, greater ones are not.
            assert_eq!(each(0xff, 0b10), (vec![1, 3], 1.0));
            assert_eq!(each(0b1111_0101, 0b1), (vec![6, 0], 3.0));
            // What is not a number is visited, whatever was found.
            let from = [f32::NAN, 7.0, 2.0, f32::NAN, 1.0, 8.0, 8.0, 8.0];
            let (mut lanes, t_max) = path.available().run(Each(0xff, &from, 0b1_0000));
            lanes.sort_unstable();
            assert_eq!((lanes, t_max), (vec![0, 3, 4], 1.0), "{}", path.name());
        }
    }
}
