use canted_scene::{Material, Scene};
use canted_trace::{Hit, Query};

use crate::Surfaces;
use crate::query::{RayKeyed, derived_key, forward};

/// A query with alpha testing: ignores hits where alpha makes the surface transparent, and passes everything else on to
/// `inner`.
#[derive(Clone, Copy, Debug)]
pub struct Masked<'a, Q> {
    surfaces: &'a Surfaces<'a>,
    /// Random seed of the ray, for stochastic alpha.
    key: u32,
    /// Receives the counts, and filters the remaining hits.
    pub inner: Q,
}

impl<'a, Q> Masked<'a, Q> {
    /// Adds the alpha test of `surfaces` to `inner`.
    #[must_use]
    pub fn new(surfaces: &'a Surfaces<'a>, inner: Q) -> Self {
        Self { surfaces, key: 0, inner }
    }
}

impl<Q: Query + Clone> RayKeyed for Masked<'_, Q> {
    fn keyed(&self, number: u32) -> Self {
        Masked::keyed(self, number)
    }
}

impl<Q: Clone> Masked<'_, Q> {
    /// The query for the ray with this number; stochastic alpha is independent for each number.
    #[must_use]
    pub fn keyed(&self, number: u32) -> Self {
        Self { key: derived_key(self.key, number), ..self.clone() }
    }
}

/// Whether any material of the scene uses alpha; if not, the alpha test is not compiled into the renderer.
pub(crate) fn is_needed(scene: &Scene) -> bool {
    scene.materials.iter().any(Material::uses_alpha)
}

impl<Q: Query> Query for Masked<'_, Q> {
    forward!(counters: inner, mask: inner);

    fn time(&self) -> f32 {
        self.inner.time()
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        self.surfaces.is_present(hit, self.key) && self.inner.accepts(hit)
    }
}
