use alloc::vec::Vec;

use crate::Hit;

/// The hits of a slice of rays, one ray after another, in memory that is used again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HitLists {
    hits: Vec<Hit>,
    /// Where the hits of each ray end.
    ends: Vec<usize>,
}

impl HitLists {
    /// Lists of no rays.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The hits of all rays: those of the first ray, then those of the second, and so on.
    #[must_use]
    pub fn hits(&self) -> &[Hit] {
        &self.hits
    }

    /// The hits of each ray, in order of the rays.
    pub fn of_rays(&self) -> impl Iterator<Item = &[Hit]> {
        let starts = core::iter::once(&0).chain(&self.ends);
        starts.zip(&self.ends).map(|(&start, &end)| &self.hits[start..end])
    }

    /// Removes all rays, for `n_rays` new ones.
    pub fn clear(&mut self, n_rays: usize) {
        self.hits.clear();
        self.ends.clear();
        self.ends.reserve(n_rays);
    }

    /// Adds a ray: `append` appends its hits to those of the rays before.
    #[inline(always)]
    pub fn add_ray(&mut self, append: impl FnOnce(&mut Vec<Hit>)) {
        append(&mut self.hits);
        self.ends.push(self.hits.len());
    }
}
