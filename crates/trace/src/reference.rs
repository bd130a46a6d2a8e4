//! The point of a space that boxes and the origins of rays are relative to.

use canted_obb::{Aabb, Obb};

use crate::ScaledRay;

/// A point of a space, near its content: boxes are relative to it, and so are the origins of rays that are tested against boxes.
///
/// The pads of boxes are relative to coordinates (see the module `slab`). Where a mesh is far from the origin of its space,
/// coordinates are large and details are small; relative to a point near the mesh, both are of one scale. Hits do not depend on the
/// point: triangles are tested in the coordinates in which they are given.
///
/// # What moved coordinates cost
/// Let u = 2^-24, and `c` the reference point. A point `x` becomes `x' = fl(x - c)`, within `u·|x'|` of `x - c` in each coordinate. Let a
/// hit lie within `ERROR·M` of a triangle, with `M` the greatest `|v - o|∞` of its vertices `v` and the ray's origin `o`: all kernels
/// keep that ([`HIT_ERROR`](crate::HIT_ERROR)). Let `S' = |o'|∞ + ρ'∞`, ρ'∞ the greatest coordinate of moved vertices. Then
/// `M <= (1 + u)·S'`. The moved hit `o' + t·d` lies within `u·|o'|∞` of the true hit less `c`, and each point of the true triangle less
/// `c` lies within `u·ρ'∞` of the triangle of moved vertices. So the moved ray hits that triangle with an error of
/// `(ERROR·(1 + u) + u)·S'`: what is proven of rays, triangles and pads of one space holds for the moved ones, with
/// [`ReferencePoint::ROUNDING`] added to `ERROR`. The second-order term is less than `u·S'/8` for an `ERROR` of at most 1/8.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferencePoint([f32; 3]);

/// Most boxes that a choice reads.
const SAMPLE: usize = 256;

/// By how much the pads of a box grow it, relative to its size, for a unit of its distance: pads on both sides, of the box and of
/// a ray from nearby, of up to 14 u each; a power of two, so that scaling a space by one changes no choice.
const GROWTH: f64 = 1.0 / (1 << 19) as f64;

/// By how much the mean growth of boxes must fall to move the reference point away from the origin.
const WORTH_IT: f64 = 1.0 / 64.0;

/// What a choice needs to know of a box: center and size.
type Sampled = ([f64; 3], f64);

impl ReferencePoint {
    /// The origin of the space: moves nothing.
    pub const ORIGIN: Self = Self([0.0; 3]);

    /// Error that moving a ray and a triangle adds to that of hits, relative to moved coordinates.
    pub const ROUNDING: f32 = crate::rounding::UNIT_ROUNDOFF;

    /// Greatest coordinate of a reference point: differences of coordinates up to 2^62 then stay below 1.25·2^62, and no product of
    /// a box test overflows.
    pub const MAX: f32 = (1_u64 << 60) as f32;

    /// The point, unless a coordinate exceeds [`ReferencePoint::MAX`] or is NaN.
    #[must_use]
    pub fn new(point: [f32; 3]) -> Option<Self> {
        // Adding zero makes -0.0 positive.
        point.iter().all(|x| x.abs() <= Self::MAX).then_some(Self(point.map(|x| x + 0.0)))
    }

    /// A point near `n` boxes, which must be finite: the origin unless pads relative to another point are noticeably smaller than
    /// those relative to the origin, compared with the boxes.
    ///
    /// Reads at most 256 of the boxes. Candidates are the median of their centers in each coordinate, and some of the centers, for
    /// content in several places.
    #[must_use]
    pub fn near(n: usize, box_of: impl Fn(usize) -> Aabb) -> Self {
        let step = n.div_ceil(SAMPLE).max(1);
        let mut sample: [Sampled; SAMPLE] = [([0.0; 3], 0.0); SAMPLE];
        let mut n_sampled = 0;
        for (sampled, i) in sample.iter_mut().zip((0..n).step_by(step)) {
            let aabb = box_of(i);
            *sampled = (aabb.center(), aabb.extent().into_iter().fold(0.0, f64::max));
            n_sampled += 1;
        }
        let sample = &sample[..n_sampled];
        let at_origin = growth(sample, [0.0; 3]);
        if at_origin < WORTH_IT {
            return Self::ORIGIN;
        }
        let centers = [1, 3, 5, 7].map(|eighth| sample[eighth * n_sampled / 8].0);
        let candidates =
            centers.into_iter().chain([median(sample)]).filter_map(|center| Self::new(center.map(nearest)));
        let best = candidates
            .map(|candidate| (growth(sample, candidate.0.map(f64::from)), candidate))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        best.filter(|best| best.0 <= at_origin - WORTH_IT).map_or(Self::ORIGIN, |best| best.1)
    }

    /// Coordinates of the point.
    #[must_use]
    pub fn point(self) -> [f32; 3] {
        self.0
    }

    /// Whether nothing is moved.
    #[inline]
    #[must_use]
    pub fn is_origin(self) -> bool {
        self.0 == [0.0; 3]
    }

    /// A point relative to this one, each coordinate rounded once.
    #[inline(always)]
    #[must_use]
    pub fn moved(self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        [x - self.0[0], y - self.0[1], z - self.0[2]]
    }

    /// A box relative to this point, each plane rounded once; an empty one stays empty.
    #[inline]
    #[must_use]
    pub fn moved_box(self, aabb: &Aabb) -> Aabb {
        Aabb { min: self.moved(aabb.min), max: self.moved(aabb.max) }
    }

    /// A box that is relative to this point, in the coordinates of the space; its center is rounded once.
    #[must_use]
    pub fn given_box(self, obb: Obb) -> Obb {
        Obb { center: core::array::from_fn(|k| obb.center[k] + self.0[k]), ..obb }
    }

    /// The ray with its origin relative to this point.
    #[inline(always)]
    #[must_use]
    pub fn moved_ray(self, ray: &ScaledRay) -> ScaledRay {
        let mut moved = *ray;
        moved.origin = self.moved(ray.origin);
        moved
    }
}

/// The nearest f32; infinite where there is none, and no candidate then.
fn nearest(x: f64) -> f32 {
    x as f32
}

/// The mean growth of boxes by pads relative to `point`, at most 1 for each.
fn growth(sample: &[Sampled], point: [f64; 3]) -> f64 {
    let of_box = |(center, size): &Sampled| {
        let distance = (0..3).map(|k| (center[k] - point[k]).abs()).fold(0.0, f64::max) * GROWTH;
        if distance < *size { distance / size } else { 1.0 }
    };
    let n = sample.len().max(1) as f64;
    sample.iter().map(of_box).sum::<f64>() / n
}

/// The median of each coordinate of the centers.
fn median(sample: &[Sampled]) -> [f64; 3] {
    core::array::from_fn(|k| {
        let mut coordinates = [0.0; SAMPLE];
        let coordinates = &mut coordinates[..sample.len()];
        coordinates.iter_mut().zip(sample).for_each(|(x, (center, _))| *x = center[k]);
        coordinates.sort_unstable_by(f64::total_cmp);
        coordinates[coordinates.len() / 2]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `n` boxes of this size in a cube of side 1 at `center`.
    fn cube(n: usize, size: f64, center: [f64; 3]) -> impl Fn(usize) -> Aabb {
        move |i| {
            let at = |k: usize| (i as f64 * [0.618, 0.414, 0.732][k]).fract() + center[k] - 0.5;
            assert!(i < n);
            Aabb { min: [0, 1, 2].map(|k| at(k) as f32), max: [0, 1, 2].map(|k| (at(k) + size) as f32) }
        }
    }

    #[test]
    fn content_near_the_origin_keeps_it() {
        for size in [1e-2, 1e-3] {
            assert_eq!(ReferencePoint::near(5000, cube(5000, size, [0.5, -1.0, 2.0])), ReferencePoint::ORIGIN);
        }
        assert_eq!(ReferencePoint::near(0, cube(0, 1.0, [0.0; 3])), ReferencePoint::ORIGIN);
        // A single point: no reference makes its box better.
        assert_eq!(ReferencePoint::near(1, |_| Aabb { min: [0.0; 3], max: [0.0; 3] }), ReferencePoint::ORIGIN);
    }

    #[test]
    fn far_content_has_a_reference_inside() {
        for distance in [1e4, 1e6, -1e6] {
            let reference = ReferencePoint::near(5000, cube(5000, 1e-2, [distance, 0.3, -distance]));
            let [x, y, z] = reference.point().map(f64::from);
            assert!((x - distance).abs() < 1.0 && y.abs() < 1.0 && (z + distance).abs() < 1.0, "{reference:?}");
        }
    }

    /// Most boxes, or the small ones, decide: a few large and distant ones do not.
    #[test]
    fn one_distant_box_changes_nothing() {
        let small = cube(1000, 1e-3, [0.0; 3]);
        let with_sky = |i: usize| if i.is_multiple_of(10) { Aabb { min: [1e6; 3], max: [2e6; 3] } } else { small(i) };
        assert_eq!(ReferencePoint::near(1000, with_sky), ReferencePoint::ORIGIN);
        let far = cube(1000, 1e-2, [1e5, 0.0, 0.0]);
        let with_floor = |i: usize| if i.is_multiple_of(10) { Aabb { min: [-1e6; 3], max: [1e6; 3] } } else { far(i) };
        assert!((ReferencePoint::near(1000, with_floor).point()[0] - 1e5).abs() < 1.0);
    }

    #[test]
    fn a_power_of_two_scales_the_choice() {
        let boxes = cube(700, 1e-2, [1e5, -3e5, 0.0]);
        let of = |scale: f32| {
            ReferencePoint::near(700, |i| {
                let aabb = boxes(i);
                Aabb { min: aabb.min.map(|x| scale * x), max: aabb.max.map(|x| scale * x) }
            })
        };
        let one = of(1.0).point();
        for scale in [2.0_f32.powi(-60), 0.5, 2.0_f32.powi(30)] {
            assert_eq!(of(scale).point(), one.map(|x| scale * x));
        }
        // Beyond the greatest coordinate there is none.
        assert_eq!(of(2.0_f32.powi(44)), ReferencePoint::ORIGIN);
    }

    #[test]
    fn points_that_are_no_reference() {
        for x in [f32::NAN, f32::INFINITY, 2.0 * ReferencePoint::MAX] {
            assert_eq!(ReferencePoint::new([0.0, x, 0.0]), None);
        }
        assert_eq!(ReferencePoint::new([-0.0; 3]), Some(ReferencePoint::ORIGIN));
    }
}
