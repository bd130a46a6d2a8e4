use canted_scene::TextureRef;

use super::hit_triangle::HitTriangle;
use crate::texture::{Footprint, Plane, Textures};
use crate::vector::Vector;
use crate::{Cone, Lod};

/// The context of texture lookups at a hit.
pub(super) struct TextureLookup<'a> {
    pub(super) textures: &'a Textures<'a>,
    pub(super) lod: Lod,
    pub(super) triangle: &'a HitTriangle<'a>,
    pub(super) plane: Plane,
    /// Direction of the ray, world space, any length.
    pub(super) direction: Vector,
    /// Cone of the ray at the hit.
    pub(super) cone: Cone,
}

impl TextureLookup<'_> {
    /// The value of a texture; ones without a texture or without its UV set.
    pub(super) fn texel(&self, slot: Option<&TextureRef>) -> [f32; 4] {
        slot.and_then(|slot| self.sample(slot)).unwrap_or([1.0; 4])
    }

    /// The value of a texture; `None` if the mesh lacks its UV set.
    pub(super) fn sample(&self, slot: &TextureRef) -> Option<[f32; 4]> {
        let uvs = self.triangle.uvs(slot.uv_set)?;
        let uv = slot.texture_from_mesh.point(self.triangle.interpolate(uvs));
        let mip_map = self.textures.get(slot.texture);
        let footprint = if self.lod == Lod::None || self.cone.is_zero() {
            Footprint::POINT
        } else {
            Footprint::new(self.lod, &self.cone, self.direction, &self.plane, edges(slot, uvs), mip_map.size())
        };
        Some(mip_map.lookup(uv, &footprint))
    }

    /// Differences of texture coordinates along the edges of the triangle.
    pub(super) fn uv_edges(&self, slot: &TextureRef) -> Option<[[f64; 2]; 2]> {
        self.triangle.uvs(slot.uv_set).map(|uvs| edges(slot, uvs))
    }
}

/// Differences of texture coordinates from the first vertex to the second and to the third.
fn edges(slot: &TextureRef, uvs: [[f64; 2]; 3]) -> [[f64; 2]; 2] {
    let [a, b, c] = uvs.map(|uv| slot.texture_from_mesh.point(uv));
    [b, c].map(|uv| std::array::from_fn(|k| uv[k] - a[k]))
}
