use canted_scene::{Material, Scene};
use canted_trace::{Hit, Query};

use crate::Surfaces;

/// A query that sees through what alpha masks cut out, and passes its counts on to `inner`.
#[derive(Clone, Copy, Debug)]
pub struct Masked<'a, Q> {
    surfaces: &'a Surfaces<'a>,
    /// Receives the counts, and is asked about the hits that the masks let stand.
    pub inner: Q,
}

impl<'a, Q> Masked<'a, Q> {
    /// Puts the masks of `surfaces` before `inner`.
    #[must_use]
    pub fn new(surfaces: &'a Surfaces<'a>, inner: Q) -> Self {
        Self { surfaces, inner }
    }
}

/// Whether any material of the scene has a mask; without one, masks are left out of the render code altogether.
pub(crate) fn is_needed(scene: &Scene) -> bool {
    scene.materials.iter().any(Material::is_cut_out)
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
        self.surfaces.is_present(hit) && self.inner.accepts(hit)
    }
}
