//! The first surface of each pixel, by rasterization instead of ray tracing.

use std::time::Duration;

use canted_gpu::{Draw, GpuError, RasterOutput, Variant};
use canted_obb::PrimId;
use canted_scene::{MaterialId, Scene};
use canted_trace::InstanceId;
use canted_wide::LaneKernel;

use super::{DeviceError, DevicePicture, picture};

/// The first surface at the center of a pixel, in world space; colors are linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceInfo {
    /// Position.
    pub position: [f32; 3],
    /// Distance from the eye.
    pub distance: f32,
    /// Unit normal of the triangle, towards the viewer.
    pub normal: [f32; 3],
    /// Unit shading normal, towards the viewer.
    pub shading_normal: [f32; 3],
    /// Base color, filtered by [`crate::Lod`].
    pub albedo: [f32; 3],
    /// The material.
    pub material: MaterialId,
    /// The instance.
    pub instance: InstanceId,
    /// The triangle in its mesh.
    pub primitive: PrimId,
}

/// The first surfaces of a picture.
pub struct GBuffer {
    /// Row by row; `None` for the background.
    pub pixels: Vec<Option<SurfaceInfo>>,
    /// Time of the pass.
    pub time: Duration,
}

impl<K: LaneKernel> DevicePicture<'_, K> {
    /// Rasterizes the first surface at the center of each pixel.
    ///
    /// The result is that of primary rays, except where an edge passes within 1/256 of a pixel of a center, which is the
    /// resolution of rasterized vertices. Sphere and disk lights are not drawn. [`DevicePicture::render`] distributes its samples
    /// over each pixel, so for its rays the result is a guess that shortens them: [`FirstHit::Raster`](crate::FirstHit::Raster).
    ///
    /// # Errors
    /// A camera with a lens or without perspective, a picture larger than the textures of the device, or its loss.
    pub fn first_surfaces(&self) -> Result<GBuffer, DeviceError> {
        let view = &self.cpu.view;
        if !view.is_perspective || view.lens.is_some() {
            return Err(DeviceError::Raster { what: "a lens or an orthographic camera" });
        }
        let chosen = picture::specialize(Variant::none(), view, self.settings);
        let raster = self.gpu.raster("render/gbuffer", &self.packed.specialize(chosen))?;
        let size = [self.settings.width, self.settings.height];
        let drawn = self.gpu.draw(&raster, &self.bindings(), size, &draws(self.surfaces.scene())?)?;
        Ok(GBuffer { time: drawn.time, pixels: self.surfaces_of(&drawn) })
    }

    fn surfaces_of(&self, drawn: &RasterOutput) -> Vec<Option<SurfaceInfo>> {
        let [points, normals, shading_normals, albedos] = &drawn.targets;
        let pixel = |k: usize| {
            let [.., above] = albedos[k];
            let primitive = PrimId(above.checked_sub(1)?);
            let ([position, normal, shading_normal, albedo], [distance, material, instance, _]) =
                split([points[k], normals[k], shading_normals[k], albedos[k]]);
            Some(SurfaceInfo {
                position,
                distance: f32::from_bits(distance),
                normal,
                shading_normal,
                albedo,
                material: self.packed.material(material),
                instance: InstanceId(instance),
                primitive,
            })
        };
        (0..points.len()).map(pixel).collect()
    }
}

/// Splits each texel into three floats and a word.
fn split(texels: [[u32; 4]; 4]) -> ([[f32; 3]; 4], [u32; 4]) {
    (texels.map(|[x, y, z, _]| [x, y, z].map(f32::from_bits)), texels.map(|[.., word]| word))
}

/// One draw for each run of instances of the same mesh.
fn draws(scene: &Scene) -> Result<Vec<Draw>, GpuError> {
    let mut draws: Vec<Draw> = vec![];
    let mut last = None;
    for (number, instance) in (0..).zip(&scene.instances) {
        match draws.last_mut() {
            Some(run) if last == Some(instance.mesh) => run.instances.end = number + 1,
            _ => {
                let n_vertices = 3 * scene.meshes[instance.mesh.0 as usize].triangles.len() as u64;
                let n_vertices = u32::try_from(n_vertices).map_err(|_| GpuError::Limit {
                    what: "a raster pass over a mesh".to_owned(),
                    need: n_vertices,
                    limit: "vertices of a draw",
                    most: u32::MAX.into(),
                    remedy: "trace first hits",
                })?;
                draws.push(Draw { vertices: 0..n_vertices, instances: number..number + 1 });
            }
        }
        last = Some(instance.mesh);
    }
    Ok(draws)
}
