//! Prefetching of the memory that shading reads.

use std::hint::black_box;

use canted_trace::Hit;

use super::Surfaces;
use super::hit_triangle::HitTriangle;
use crate::Lod;
use crate::texture::filtered_textures;

impl Surfaces<'_> {
    /// Reads what [`Surfaces::at_time`] needs for these hits, so that it is in the cache.
    ///
    /// Each loop reads one thing for every hit, at an address that the previous loop determined. Its iterations are
    /// short and independent, so that an out-of-order processor overlaps many cache misses; a full shading evaluation
    /// would wait for them one by one. Texels are read only for lookups in level 0: smaller mip levels are mostly in
    /// the cache.
    pub(crate) fn prefetch<'h>(&self, hits: impl Iterator<Item = &'h Hit>) {
        let triangles: Vec<(HitTriangle, u32)> = hits.map(|hit| (self.hit_triangle(hit), hit.primitive.0)).collect();
        for (triangle, _) in &triangles {
            triangle.prefetch();
        }
        if self.lod != Lod::None {
            return;
        }
        let mut texels = Vec::with_capacity(triangles.len());
        for (triangle, primitive) in &triangles {
            let id = triangle.mesh.material_of(*primitive);
            if !self.is_textured[id.0 as usize] {
                continue;
            }
            for slot in filtered_textures(self.material(id)) {
                if let Some(uv) = triangle.uv(slot.uv_set) {
                    texels.extend(self.textures.get(slot.texture).texels(slot.texture_from_mesh.point(uv)));
                }
            }
        }
        for four in texels {
            black_box(four.map(|row| row.map(|texel| texel[0])));
        }
    }

    fn hit_triangle(&self, hit: &Hit) -> HitTriangle<'_> {
        HitTriangle::new(&self.scene.meshes[self.scene.instances[hit.instance.0 as usize].mesh.0 as usize], hit, 0.0)
    }
}
