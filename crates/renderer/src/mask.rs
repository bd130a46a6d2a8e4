use canted_scene::{Material, Scene};
use canted_trace::{Hit, Query};

use crate::Surfaces;
use crate::query::{RayKeyed, derived_key};

/// A query that sees through what alpha cuts out, and passes its counts on to `inner`.
#[derive(Clone, Copy, Debug)]
pub struct Masked<'a, Q> {
    surfaces: &'a Surfaces<'a>,
    /// Tells rays apart, for surfaces that stop some and let others pass.
    key: u32,
    /// Receives the counts, and is asked about the hits that alpha lets stand.
    pub inner: Q,
}

impl<'a, Q> Masked<'a, Q> {
    /// Puts the alpha of `surfaces` before `inner`.
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
    /// The same query for a ray with this number, of those that `self` stands for: blended surfaces let other rays pass.
    #[must_use]
    pub fn keyed(&self, number: u32) -> Self {
        Self { key: derived_key(self.key, number), ..self.clone() }
    }
}

/// Whether alpha matters to any material of the scene; else it is left out of the render code altogether.
pub(crate) fn is_needed(scene: &Scene) -> bool {
    scene.materials.iter().any(Material::uses_alpha)
}

impl<Q: Query> Query for Masked<'_, Q> {
    fn boxes(&mut self, n: u32) {
        self.inner.boxes(n);
    }

    fn triangles(&mut self, n: u32) {
        self.inner.triangles(n);
    }

    fn time(&self) -> f32 {
        self.inner.time()
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        self.surfaces.is_present(hit, self.key) && self.inner.accepts(hit)
    }
}
