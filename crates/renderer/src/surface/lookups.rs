use canted_scene::TextureRef;

use super::placed::Corners;
use crate::texture::{Footprint, Plane, Textures};
use crate::vector::Vector;
use crate::{Cone, Lod};

/// What a hit asks textures with.
pub(super) struct Lookups<'a> {
    pub(super) textures: &'a Textures<'a>,
    pub(super) lod: Lod,
    pub(super) corners: &'a Corners<'a>,
    pub(super) plane: Plane,
    /// Of the ray, world space, any length.
    pub(super) direction: Vector,
    /// Of the ray, where it hits.
    pub(super) cone: Cone,
}

impl Lookups<'_> {
    /// What a texture says; ones where there is none, or no coordinates for it.
    pub(super) fn texel(&self, slot: Option<&TextureRef>) -> [f32; 4] {
        slot.and_then(|slot| self.found(slot)).unwrap_or([1.0; 4])
    }

    /// What a texture says; `None` where the mesh has no coordinates for it.
    pub(super) fn found(&self, slot: &TextureRef) -> Option<[f32; 4]> {
        let uvs = self.corners.uvs(slot.uv_set)?;
        let uv = slot.texture_from_mesh.point(self.corners.between(uvs));
        let mip_map = self.textures.get(slot.texture);
        let footprint = if self.lod == Lod::None || self.cone.is_zero() {
            Footprint::POINT
        } else {
            Footprint::new(self.lod, &self.cone, self.direction, &self.plane, edges(slot, uvs), mip_map.size())
        };
        Some(mip_map.lookup(uv, &footprint))
    }

    /// Changes of texture coordinates along the edges of the triangle.
    pub(super) fn uv_edges(&self, slot: &TextureRef) -> Option<[[f64; 2]; 2]> {
        self.corners.uvs(slot.uv_set).map(|uvs| edges(slot, uvs))
    }
}

/// Changes of a texture's coordinates from the first vertex to the second and to the third.
fn edges(slot: &TextureRef, uvs: [[f64; 2]; 3]) -> [[f64; 2]; 2] {
    let [a, b, c] = uvs.map(|uv| slot.texture_from_mesh.point(uv));
    [b, c].map(|uv| std::array::from_fn(|k| uv[k] - a[k]))
}
