/// An axis-aligned box (closed), in the space of its points.
///
/// `min` and `max` are copies of input coordinates, so containment is exact. The empty box has `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub struct Aabb {
    /// Least coordinate on each axis.
    pub min: [f32; 3],
    /// Greatest coordinate on each axis.
    pub max: [f32; 3],
}

impl Aabb {
    /// The empty box, the identity of [`Aabb::union`].
    pub const EMPTY: Self = Self { min: [f32::MAX; 3], max: [f32::MIN; 3] };

    /// Smallest box that contains `points`; [`Aabb::EMPTY`] for none.
    #[must_use]
    pub fn from_points(points: impl IntoIterator<Item = impl Into<[f32; 3]>>) -> Self {
        let mut aabb = Self::EMPTY;
        for point in points {
            aabb.grow(point);
        }
        aabb
    }

    /// Extends the box to contain `point`.
    #[inline]
    pub fn grow(&mut self, point: impl Into<[f32; 3]>) {
        let point = point.into();
        self.min = core::array::from_fn(|k| self.min[k].min(point[k]));
        self.max = core::array::from_fn(|k| self.max[k].max(point[k]));
    }

    /// Smallest box that contains both.
    #[inline]
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: core::array::from_fn(|k| self.min[k].min(other.min[k])),
            max: core::array::from_fn(|k| self.max[k].max(other.max[k])),
        }
    }

    /// The union of several boxes after one of them, `old`, has become `new`; `None` where that depends on the others: where `old` reached as
    /// far as the union, and `new` does not reach so far.
    ///
    /// ```
    /// use canted_obb::Aabb;
    ///
    /// let of = |min: f32, max: f32| Aabb { min: [min; 3], max: [max; 3] };
    /// let union = of(0.0, 2.0).union(of(1.0, 5.0));
    /// assert_eq!(union.after_change(&of(1.0, 5.0), &of(2.0, 6.0)), Some(of(0.0, 6.0)));
    /// assert_eq!(union.after_change(&of(1.0, 5.0), &of(1.0, 4.0)), None);
    /// ```
    #[inline]
    #[must_use]
    pub fn after_change(self, old: &Self, new: &Self) -> Option<Self> {
        let is_known = |k: usize| {
            (self.min[k] < old.min[k] || new.min[k] <= old.min[k])
                && (old.max[k] < self.max[k] || old.max[k] <= new.max[k])
        };
        (0..3).all(is_known).then(|| self.union(*new))
    }

    /// Whether the box contains no point.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|k| self.min[k] > self.max[k])
    }

    /// Whether `point` lies inside or on the boundary.
    #[must_use]
    pub fn contains(&self, point: impl Into<[f32; 3]>) -> bool {
        let point = point.into();
        (0..3).all(|k| self.min[k] <= point[k] && point[k] <= self.max[k])
    }

    /// Whether the box contains all of `other`; every box contains the empty box.
    #[must_use]
    pub fn contains_box(&self, other: &Self) -> bool {
        other.is_empty() || (self.contains(other.min) && self.contains(other.max))
    }

    /// Side lengths in `f64`; zero for the empty box.
    #[must_use]
    pub fn extent(&self) -> [f64; 3] {
        core::array::from_fn(|k| (f64::from(self.max[k]) - f64::from(self.min[k])).max(0.0))
    }

    /// The power of two that scales the longest side to the interval `[1, 2)`, so that areas stay in the range of `f32`;
    /// `None` for a box of zero or infinite extent.
    #[must_use]
    pub fn unit_scale(&self) -> Option<f32> {
        let extent = self.extent().into_iter().fold(0.0, f64::max);
        // The biased exponent, kept where both it and its mirror image are exponents of normal `f32` numbers.
        let exponent = (extent.to_bits() >> 52).clamp(1023 - 126, 1023 + 126);
        let scale = f32::from_bits((1023 + 127 - exponent as u32) << 23);
        (extent > 0.0 && extent.is_finite()).then_some(scale)
    }

    /// Center in `f64`.
    #[must_use]
    pub fn center(&self) -> [f64; 3] {
        core::array::from_fn(|k| 0.5 * (f64::from(self.min[k]) + f64::from(self.max[k])))
    }

    /// Surface area in square scene units.
    #[must_use]
    pub fn area(&self) -> f64 {
        let [x, y, z] = self.extent();
        2.0 * (x * y + y * z + z * x)
    }

    /// Volume in cubic scene units.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let [x, y, z] = self.extent();
        x * y * z
    }

    /// The eight corners; bit `k` of the index chooses `max` on axis `k`.
    #[must_use]
    pub fn corners(&self) -> [[f32; 3]; 8] {
        core::array::from_fn(|i| core::array::from_fn(|k| if i >> k & 1 == 1 { self.max[k] } else { self.min[k] }))
    }

    /// Whether every coordinate is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [self.min, self.max].as_flattened().iter().all(|x| x.is_finite())
    }

    /// The *reach* of the box: the greatest absolute coordinate of its points; zero for the empty box.
    ///
    /// Rounding errors of box and triangle tests are relative to the reach of what is tested.
    #[must_use]
    pub fn reach(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        (0..3).map(|k| self.min[k].abs().max(self.max[k].abs())).fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_scale_scales_the_longest_side_to_one_or_two() {
        for length in [1.0, 1.999, 2.0, 1e38, 1e-20, f32::MIN_POSITIVE, 0.75] {
            let aabb = Aabb { min: [0.0; 3], max: [0.0, length, 0.5 * length] };
            let scaled = length * aabb.unit_scale().unwrap();
            assert!((1.0..2.0).contains(&scaled), "{length} is scaled to {scaled}");
        }
        let widest = Aabb { min: [f32::MIN; 3], max: [f32::MAX; 3] };
        assert_eq!(widest.unit_scale(), Some(2.0f32.powi(-126)));
        for nothing in [Aabb::EMPTY, Aabb::from_points([[1.0; 3]]), Aabb { min: [0.0; 3], max: [f32::INFINITY; 3] }] {
            assert_eq!(nothing.unit_scale(), None);
        }
    }
}
