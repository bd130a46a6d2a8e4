use canted_scene::{Material, Scene};
use canted_trace::{Counts, Hit, Query};

use crate::Surfaces;
use crate::sampler::mix;

/// A query with alpha testing: ignores hits where alpha makes the surface transparent.
///
/// Stochastic alpha is random by the key of the ray. If a ray is traced twice, both queries must have the same key.
#[derive(Clone, Copy, Debug)]
pub struct AlphaTest<'a> {
    /// `None` where no material uses alpha.
    surfaces: Option<&'a Surfaces<'a>>,
    key: u32,
}

impl<'a> AlphaTest<'a> {
    /// The alpha test of these surfaces; accepts every hit where no material uses alpha.
    #[must_use]
    pub fn new(surfaces: &'a Surfaces<'a>) -> Self {
        Self { surfaces: is_needed(surfaces.scene()).then_some(surfaces), key: 0 }
    }

    /// The query for the ray with this number; stochastic alpha is independent for each number.
    ///
    /// Numbers nest: a path, its vertices, the shadow rays of each vertex.
    #[must_use]
    pub fn keyed(self, number: u32) -> Self {
        Self { key: derived_key(self.key, number), ..self }
    }
}

impl Query for AlphaTest<'_> {
    fn may_reject(&self) -> bool {
        self.surfaces.is_some()
    }

    fn counts(&self) -> bool {
        false
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        self.surfaces.is_none_or(|surfaces| surfaces.is_present(hit, self.key))
    }
}

/// An alpha test that counts ray-box and ray-triangle tests.
#[derive(Clone, Copy, Debug)]
pub struct CountedAlphaTest<'a> {
    /// Accepts hits.
    pub test: AlphaTest<'a>,
    /// The tests so far.
    pub counts: Counts,
}

impl Query for CountedAlphaTest<'_> {
    fn may_reject(&self) -> bool {
        self.test.may_reject()
    }

    fn boxes(&mut self, n: u32) {
        self.counts.boxes(n);
    }

    fn triangles(&mut self, n: u32) {
        self.counts.triangles(n);
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        self.test.accepts(hit)
    }
}

/// The key of the ray with this number, below the ray or path with `key`.
fn derived_key(key: u32, number: u32) -> u32 {
    mix(key ^ number)
}

/// Whether any material of the scene uses alpha; if not, no ray is tested for it.
pub(crate) fn is_needed(scene: &Scene) -> bool {
    scene.materials.iter().any(Material::uses_alpha)
}
