//! The in-place partition of a node's primitives by a plane.

use canted_obb::{Aabb, PrimId};
use glam::{Vec3, Vec4};

/// A primitive during the build: its box, number and reach, moved together.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Item {
    /// Least coordinates, and the bits of the primitive's number.
    min: Vec4,
    /// Greatest coordinates, and the greatest absolute one.
    max: Vec4,
}

impl Item {
    #[inline(always)]
    pub(crate) fn new(primitive: u32, Aabb { min, max }: &Aabb) -> Self {
        Self::of_corners(primitive, Vec3::from(*min), Vec3::from(*max))
    }

    /// Of a triangle. Where a coordinate is not finite, neither is the reach.
    #[inline(always)]
    pub(crate) fn of_triangle(primitive: u32, corners: [[f32; 3]; 3]) -> Self {
        let [a, b, c] = corners.map(Vec3::from);
        let item = Self::of_corners(primitive, a.min(b).min(c), a.max(b).max(c));
        // Zero, or NaN, which a minimum may drop.
        let flaw = (a * 0.0 + b * 0.0 + c * 0.0).element_sum();
        if flaw == 0.0 { item } else { Self { max: item.max.with_w(f32::INFINITY), ..item } }
    }

    #[inline(always)]
    fn of_corners(primitive: u32, min: Vec3, max: Vec3) -> Self {
        let reach = min.abs().max(max.abs()).max_element();
        Self { min: min.extend(f32::from_bits(primitive)), max: max.extend(reach) }
    }

    #[inline(always)]
    pub(crate) fn primitive(&self) -> PrimId {
        PrimId(self.min.w.to_bits())
    }

    /// Twice the center of the box along an axis: one addition.
    #[inline(always)]
    pub(crate) fn twice_center(&self, axis: usize) -> f32 {
        self.min[axis] + self.max[axis]
    }
}

/// What some items occupy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Content {
    pub(crate) bounds: Aabb,
    /// Greatest absolute coordinate.
    pub(crate) reach: f32,
}

impl Content {
    pub(crate) const EMPTY: Self = Self { bounds: Aabb::EMPTY, reach: 0.0 };

    pub(crate) fn union(self, other: Self) -> Self {
        Self { bounds: self.bounds.union(other.bounds), reach: self.reach.max(other.reach) }
    }

    /// Of at least one item.
    pub(crate) fn of(items: &[Item]) -> Self {
        // Two accumulators each, as a minimum has to wait for the one before.
        let mut bounds = [(items[0].min, items[0].max); 2];
        let mut pairs = items.chunks_exact(2);
        for pair in &mut pairs {
            for ((min, max), item) in bounds.iter_mut().zip(pair) {
                (*min, *max) = (min.min(item.min), max.max(item.max));
            }
        }
        for item in pairs.remainder() {
            bounds[0] = (bounds[0].0.min(item.min), bounds[0].1.max(item.max));
        }
        let [(a_min, a_max), (b_min, b_max)] = bounds;
        let (min, max) = (a_min.min(b_min), a_max.max(b_max));
        let bounds = Aabb { min: min.truncate().to_array(), max: max.truncate().to_array() };
        Self { bounds, reach: max.w }
    }
}

/// Moves the items whose doubled center is less than `twice_split` to the front; returns their number.
pub(crate) fn partition(items: &mut [Item], axis: usize, twice_split: f32) -> usize {
    match axis {
        0 => along::<0>(items, twice_split),
        1 => along::<1>(items, twice_split),
        _ => along::<2>(items, twice_split),
    }
}

/// Every item is exchanged with the first one that may belong to the right: without branches, since sides are random.
#[inline(always)]
fn along<const AXIS: usize>(items: &mut [Item], twice_split: f32) -> usize {
    let mut n_left = 0;
    for i in 0..items.len() {
        let is_left = items[i].twice_center(AXIS) < twice_split;
        // A swap moves whole vectors. Copies of an item are split into numbers, whose stores the next load waits for.
        items.swap(i, n_left);
        n_left += usize::from(is_left);
    }
    n_left
}

/// The minimum in one instruction.
#[inline(always)]
pub(crate) fn least(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// The maximum in one instruction.
#[inline(always)]
pub(crate) fn greatest(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

/// Least and greatest doubled center on each axis.
pub(crate) fn twice_centers(items: &[Item]) -> [[f32; 2]; 3] {
    let mut bounds = [[f32::INFINITY, f32::NEG_INFINITY]; 3];
    for item in items {
        for (k, [min, max]) in bounds.iter_mut().enumerate() {
            let center = item.twice_center(k);
            *min = least(*min, center);
            *max = greatest(*max, center);
        }
    }
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use canted_fixtures::SplitMix64;

    fn numbers<'a>(items: impl IntoIterator<Item = &'a Item>) -> Vec<u32> {
        let mut numbers: Vec<u32> = items.into_iter().map(|item| item.primitive().0).collect();
        numbers.sort_unstable();
        numbers
    }

    /// Against two filters of a copy, and unions of boxes.
    #[test]
    fn both_sides_are_those_of_a_filter() {
        let mut rng = SplitMix64::new(3);
        for n in (1..40).chain([1000]) {
            let boxes: Vec<Aabb> = (0..n)
                .map(|_| {
                    // Whole coordinates, so that centers fall on the split.
                    let min: [f32; 3] = std::array::from_fn(|_| rng.below(9) as f32 - 4.0);
                    Aabb { min, max: min.map(|x| x + rng.below(3) as f32) }
                })
                .collect();
            let mut items: Vec<Item> = (0..).zip(&boxes).map(|(i, aabb)| Item::new(i, aabb)).collect();
            for axis in 0..3 {
                let split = rng.signed() as f32 * 6.0;
                let split = if axis == 0 { split.round() } else { split };
                let side =
                    |is_left: bool| numbers(items.iter().filter(|item| (item.twice_center(axis) < split) == is_left));
                let want = [side(true), side(false)];
                let n_left = partition(&mut items, axis, split);
                let (left, right) = items.split_at(n_left);
                assert_eq!([numbers(left), numbers(right)], want);
                for side in [left, right].into_iter().filter(|side| !side.is_empty()) {
                    let of_side = side.iter().map(|item| boxes[item.primitive().index()]);
                    let bounds = of_side.fold(Aabb::EMPTY, Aabb::union);
                    assert_eq!(Content::of(side), Content { bounds, reach: bounds.reach() });
                }
            }
        }
    }
}
