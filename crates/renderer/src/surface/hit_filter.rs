//! Which hits count for a ray: alpha, and the faces that it passes.
//!
//! # Back faces
//!
//! glTF culls the back faces of single-sided materials. Files rely on it for outlines, which are an inverted hull, and for rooms that are
//! seen from outside. A path tracer that culls for camera rays only shows both in the dark, as faces that nobody sees still block the
//! light. So a face of a single-sided material that does not transmit light
//!
//! * is not hit from behind by camera rays, and by what mirrors and clear glass make of them,
//! * lets light through from behind where it is *hidden*: where the eye is behind it. A shadow ray passes hidden faces that it reaches from
//!   the front. A scattered ray passes them if it then leaves the scene; else it ends at the first of them.
//!
//! A closed solid looks and shadows as without culling: a ray that passes a hidden face of it is blocked by another face on its way
//! out. Floors, and rooms with the camera inside, let no light through, as the eye is in front of them.

use canted_scene::{Material, Scene};
use canted_trace::{Counts, Hit, Query, Side};
use glam::DVec3;

use crate::sampler::mix;
use crate::{Cull, Surfaces, View};

/// A query that ignores hits where alpha makes the surface transparent, and the faces that a ray passes.
///
/// Stochastic alpha is random by key and sample. If a ray is traced twice, both queries must have the same.
#[derive(Clone, Copy, Debug)]
pub struct HitFilter<'a> {
    surfaces: &'a Surfaces<'a>,
    uses_alpha: bool,
    /// Whether any material is hair. Rays that start in one leave it without a hit: its BSDF is that of the whole tube.
    has_hair: bool,
    key: u32,
    sample: u32,
    /// `None` where no face is culled.
    culling: Option<Culling>,
    rays: Rays,
}

/// What is culled.
#[derive(Clone, Copy, Debug)]
struct Culling {
    /// Whether all materials are single-sided.
    all: bool,
    /// The eye: a point, or a direction towards it where `is_near` is 0.
    eye: DVec3,
    is_near: f64,
}

/// What a ray is for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rays {
    /// What the camera sees, by mirrors and clear glass, too.
    Seen,
    /// What a surface scatters.
    Scattered,
    /// Whether light arrives, at a time.
    Light(f32),
}

impl<'a> HitFilter<'a> {
    /// The alpha test of these surfaces, which are seen from both sides.
    #[must_use]
    pub fn new(surfaces: &'a Surfaces<'a>) -> Self {
        let uses_alpha = uses_alpha(surfaces.scene());
        let has_hair = surfaces.scene().materials.iter().any(|material| material.hair.is_some());
        Self { surfaces, uses_alpha, has_hair, key: 0, sample: 0, culling: None, rays: Rays::Seen }
    }

    /// The same for rays from the eye of a view, which pass the faces that `cull` says.
    #[must_use]
    pub fn culling(self, cull: Cull, view: &View) -> Self {
        let (eye, is_near) = if view.is_perspective { (view.eye, 1.0) } else { (-view.forward, 0.0) };
        let culling = Culling { all: cull == Cull::Back, eye, is_near };
        Self { culling: culls(self.surfaces.scene(), cull).then_some(culling), ..self }
    }

    /// The query for the ray with this number; stochastic alpha is independent for each number.
    ///
    /// Numbers nest: a path, its vertices, the shadow rays of each vertex.
    #[must_use]
    pub fn keyed(self, number: u32) -> Self {
        Self { key: mix(self.key ^ number), ..self }
    }

    /// The query for this sample of a pixel.
    ///
    /// Rays of the same key are stratified over aligned blocks of `2^m` samples: a triangle of alpha `a` is present in the nearest count to
    /// `a 2^m` of them. So camera rays through glass of a file converge as fast as other samples of a pixel.
    #[must_use]
    pub fn sampled(self, sample: u32) -> Self {
        Self { sample, ..self }
    }

    /// The query for a scattered ray. It may go on where it ends at a [hidden](Self::hides) face.
    #[must_use]
    pub(crate) fn scattered(self) -> Self {
        Self { rays: Rays::Scattered, ..self }
    }

    /// The query for a ray at this time that asks whether light arrives along it.
    #[must_use]
    pub(crate) fn lighting(self, time: f32) -> Self {
        Self { rays: Rays::Light(time), ..self }
    }

    /// Whether light passes the face at a hit: it is hit from the front, and the eye is behind it.
    pub(crate) fn hides(&self, hit: &Hit, time: f32) -> bool {
        self.culling.is_some_and(|Culling { all, eye, is_near }| {
            hit.side == Side::Front && self.surfaces.is_single_sided(hit, all) && {
                let (point, normal) = self.surfaces.face(hit, time);
                normal.dot(eye - is_near * point) < 0.0
            }
        })
    }

    /// Whether the ray ends at a hit.
    pub(crate) fn shows(&self, hit: &Hit) -> bool {
        let leaves_hair = self.has_hair && hit.side == Side::Back && self.surfaces.is_hair(hit);
        !leaves_hair && !self.passes(hit) && (!self.uses_alpha || self.surfaces.is_present(hit, self.key, self.sample))
    }

    /// Whether a ray passes the face at a hit.
    fn passes(&self, hit: &Hit) -> bool {
        match (self.culling, self.rays) {
            (None, _) | (_, Rays::Scattered) => false,
            (Some(culling), Rays::Seen) => hit.side == Side::Back && self.surfaces.is_single_sided(hit, culling.all),
            (Some(_), Rays::Light(time)) => self.hides(hit, time),
        }
    }
}

impl Query for HitFilter<'_> {
    fn may_reject(&self) -> bool {
        self.uses_alpha || self.has_hair || self.culling.is_some() && self.rays != Rays::Scattered
    }

    fn counts(&self) -> bool {
        false
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        self.shows(hit)
    }
}

/// A hit filter that counts ray-box and ray-triangle tests.
#[derive(Clone, Copy, Debug)]
pub struct CountedHitFilter<'a> {
    /// Accepts hits.
    pub filter: HitFilter<'a>,
    /// The tests so far.
    pub counts: Counts,
}

impl Query for CountedHitFilter<'_> {
    fn may_reject(&self) -> bool {
        self.filter.may_reject()
    }

    fn boxes(&mut self, n: u32) {
        self.counts.boxes(n);
    }

    fn triangles(&mut self, n: u32) {
        self.counts.triangles(n);
    }

    fn accepts(&mut self, hit: &Hit) -> bool {
        self.filter.accepts(hit)
    }
}

/// Whether any material of the scene uses alpha; if not, no ray is tested for it.
pub(crate) fn uses_alpha(scene: &Scene) -> bool {
    scene.materials.iter().any(Material::uses_alpha)
}

/// Whether rays pass faces of any material; if not, no ray is tested for it.
pub(crate) fn culls(scene: &Scene, cull: Cull) -> bool {
    cull != Cull::Off && scene.materials.iter().any(|material| is_single_sided(material, cull == Cull::Back))
}

/// Whether rays pass faces of a material, if `all` materials that do not transmit light are single-sided or only those that say so.
pub(crate) fn is_single_sided(material: &Material, all: bool) -> bool {
    (all || !material.double_sided) && material.transmission == 0.0
}
