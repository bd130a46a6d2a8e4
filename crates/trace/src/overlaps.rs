use alloc::vec::Vec;
use core::ops::ControlFlow;

use canted_obb::Obb;

use crate::{Convex, InvertedBox};

/// What overlaps a convex region of space: an axis-aligned box, an oriented box or a frustum.
///
/// All forms of the question are made of [`Overlaps::each_overlapping`], so they have the same answers. Touching counts. No overlap is missed; a gap
/// below 2^-46 of the coordinates, of spheres below 2^-44, may be reported as an overlap, for instances times the condition number of their map.
///
/// ```
/// use std::ops::ControlFlow;
///
/// use canted_trace::{Convex, Overlaps};
///
/// struct Soup(Vec<[[f32; 3]; 3]>);
///
/// impl Overlaps for Soup {
///     type Found = usize;
///
///     fn each_overlapping(&self, region: &Convex, visit: impl FnMut(usize) -> ControlFlow<()>) {
///         let _ = (0..self.0.len()).filter(|&i| region.overlaps_triangle(&self.0[i])).try_for_each(visit);
///     }
/// }
///
/// let soup = Soup(vec![[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
/// assert_eq!(soup.first_overlapping(&Convex::from_aabb([0.1, 0.1, -1.0], [0.2, 0.2, 1.0])), Some(0));
/// assert!(!soup.overlaps(&Convex::from_aabb([0.1; 3], [0.2; 3])));
/// ```
pub trait Overlaps {
    /// What is found, in the order of lists: a primitive, or an instance with one of its primitives.
    type Found: Copy + Ord;

    /// Calls `visit` with all that overlaps a region, in any order, until it breaks. One may come twice.
    fn each_overlapping(&self, region: &Convex, visit: impl FnMut(Self::Found) -> ControlFlow<()>);

    /// All that overlaps a region, in ascending order. Replaces the contents of `found`.
    fn overlapping(&self, region: &Convex, found: &mut Vec<Self::Found>) {
        forms::all(found, |visit| self.each_overlapping(region, visit));
    }

    /// All that overlaps the axis-aligned box from `min` to `max`; see [`Overlaps::overlapping`].
    ///
    /// # Errors
    /// A least coordinate that exceeds the greatest, unless the box is [`Aabb::EMPTY`](canted_obb::Aabb::EMPTY), which overlaps nothing. Nothing is then found.
    fn overlapping_aabb(
        &self,
        min: impl Into<[f32; 3]>,
        max: impl Into<[f32; 3]>,
        found: &mut Vec<Self::Found>,
    ) -> Result<(), InvertedBox> {
        found.clear();
        Convex::checked_aabb(min, max).map(|region| self.overlapping(&region, found))
    }

    /// All that overlaps an oriented box; see [`Overlaps::overlapping`].
    ///
    /// # Errors
    /// A negative half-extent. Nothing is then found.
    fn overlapping_obb(&self, obb: &Obb, found: &mut Vec<Self::Found>) -> Result<(), InvertedBox> {
        found.clear();
        Convex::checked_obb(obb).map(|region| self.overlapping(&region, found))
    }

    /// Whether anything overlaps a region.
    fn overlaps(&self, region: &Convex) -> bool {
        forms::is_any(|visit| self.each_overlapping(region, visit))
    }

    /// The lowest that overlaps a region.
    fn first_overlapping(&self, region: &Convex) -> Option<Self::Found> {
        forms::first(|visit| self.each_overlapping(region, visit))
    }

    /// How many overlap a region.
    fn count_overlapping(&self, region: &Convex) -> usize {
        forms::count(|visit| self.each_overlapping(region, visit))
    }
}

/// The forms of an answer, of a function that calls another one with each result, in any order, some perhaps twice, until it breaks. Not part of the
/// stable interface.
pub mod forms {
    use alloc::vec;
    use alloc::vec::Vec;
    use core::ops::ControlFlow;

    /// What is called with each result.
    pub type Visit<'a, T> = dyn FnMut(T) -> ControlFlow<()> + 'a;

    /// Each once, in ascending order. Replaces the contents of `found`.
    pub fn all<T: Ord>(found: &mut Vec<T>, each: impl FnOnce(&mut Visit<'_, T>)) {
        found.clear();
        each(&mut |one| {
            found.push(one);
            ControlFlow::Continue(())
        });
        found.sort_unstable();
        found.dedup();
    }

    /// Whether there is one.
    pub fn is_any<T>(each: impl FnOnce(&mut Visit<'_, T>)) -> bool {
        let mut is_any = false;
        each(&mut |_| {
            is_any = true;
            ControlFlow::Break(())
        });
        is_any
    }

    /// The lowest.
    pub fn first<T: Copy + Ord>(each: impl FnOnce(&mut Visit<'_, T>)) -> Option<T> {
        let mut first: Option<T> = None;
        each(&mut |one| {
            first = Some(first.map_or(one, |first| first.min(one)));
            ControlFlow::Continue(())
        });
        first
    }

    /// How many, each counted once.
    pub fn count<T: Ord>(each: impl FnOnce(&mut Visit<'_, T>)) -> usize {
        let mut found = vec![];
        all(&mut found, each);
        found.len()
    }
}

#[cfg(test)]
mod tests {
    use alloc::boxed::Box;
    use alloc::vec;

    use canted_obb::Aabb;

    use super::*;

    /// Finds these in any region.
    struct Fixed(&'static [u32]);

    impl Overlaps for Fixed {
        type Found = u32;

        fn each_overlapping(&self, _: &Convex, visit: impl FnMut(u32) -> ControlFlow<()>) {
            let _ = self.0.iter().copied().try_for_each(visit);
        }
    }

    #[test]
    fn all_forms_have_one_answer() {
        let region = Convex::from_aabb([0.0; 3], [1.0; 3]);
        for (found, sorted) in [(&[7_u32, 2, 7, 5, 2][..], &[2_u32, 5, 7][..]), (&[], &[])] {
            let fixed = Fixed(Box::leak(found.to_vec().into_boxed_slice()));
            let mut all = vec![9];
            fixed.overlapping(&region, &mut all);
            assert_eq!(all, sorted);
            assert_eq!(fixed.first_overlapping(&region), sorted.first().copied());
            assert_eq!((fixed.overlaps(&region), fixed.count_overlapping(&region)), (!sorted.is_empty(), sorted.len()));
        }
    }

    #[test]
    fn one_that_is_enough_ends_the_search() {
        let mut n = 0;
        let is_any = forms::is_any(|visit: &mut forms::Visit<'_, u32>| {
            let _ = (0..10).try_for_each(|i| {
                n += 1;
                visit(i)
            });
        });
        assert_eq!((is_any, n), (true, 1));
    }

    #[test]
    fn inverted_boxes_find_nothing() {
        let mut all = vec![9];
        assert!(Fixed(&[1]).overlapping_aabb([1.0, 0.0, 0.0], [0.0, 1.0, 1.0], &mut all).is_err() && all.is_empty());
        let obb = Obb { half_extents: [1.0, -1.0, 1.0], ..Obb::from_aabb(&Aabb { min: [0.0; 3], max: [1.0; 3] }) };
        all.push(9);
        assert!(Fixed(&[1]).overlapping_obb(&obb, &mut all).is_err() && all.is_empty());
    }
}
