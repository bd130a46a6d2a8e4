//! Memory that surfaces are read from, asked for ahead of time.

use std::hint::black_box;

use canted_trace::Hit;

use super::Surfaces;
use super::placed::Corners;
use crate::Lod;
use crate::texture::averaged;

impl Surfaces<'_> {
    /// Reads what [`Surfaces::at_time`] will ask memory for, so that the processor's caches have it.
    ///
    /// Each loop reads one thing of every hit, at a place that the loop before has made known. Its turns are short and do not
    /// depend on each other: a processor that executes out of order waits for many of them at once, where a whole surface
    /// would keep it waiting for one place after another. Texels are read where lookups are at full size; smaller copies
    /// mostly are in caches.
    pub(crate) fn prefetch<'h>(&self, hits: impl Iterator<Item = &'h Hit>) {
        let met: Vec<(Corners, u32)> = hits.map(|hit| (self.corners(hit), hit.primitive.0)).collect();
        for (corners, _) in &met {
            corners.read();
        }
        if self.lod != Lod::None {
            return;
        }
        let mut texels = Vec::with_capacity(met.len());
        for (corners, primitive) in &met {
            let id = corners.mesh.material_of(*primitive);
            if !self.is_textured[id.0 as usize] {
                continue;
            }
            for slot in averaged(self.material(id)) {
                if let Some(uv) = corners.uv(slot.uv_set) {
                    texels.extend(self.textures.get(slot.texture).texels(slot.texture_from_mesh.point(uv)));
                }
            }
        }
        for four in texels {
            black_box(four.map(|row| row.map(|texel| texel[0])));
        }
    }

    fn corners(&self, hit: &Hit) -> Corners<'_> {
        Corners::of(&self.scene.meshes[self.scene.instances[hit.instance.0 as usize].mesh.0 as usize], hit)
    }
}
