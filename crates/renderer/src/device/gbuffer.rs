//! What a pinhole sees at the centres of pixels, drawn instead of traced.

use std::time::Duration;

use canted_gpu::{Draw, GpuError, RasterOutput, Specialisation};
use canted_obb::PrimId;
use canted_scene::{MaterialId, Scene};
use canted_trace::InstanceId;
use canted_wide::LaneKernel;

use super::{DeviceError, DevicePicture, picture};

/// The first surface at the centre of a pixel. World space; colours linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// The point.
    pub position: [f32; 3],
    /// Its distance from the eye.
    pub distance: f32,
    /// Unit normal of the triangle, on the viewer's side.
    pub normal: [f32; 3],
    /// Unit normal to shade with, on that side too.
    pub shading_normal: [f32; 3],
    /// Base colour, its texture averaged over the pixel as [`crate::Lod`] says.
    pub albedo: [f32; 3],
    /// The material.
    pub material: MaterialId,
    /// The instance.
    pub instance: InstanceId,
    /// The triangle, as its mesh numbers it.
    pub primitive: PrimId,
}

/// The first surfaces of a picture.
pub struct GBuffer {
    /// Row by row; `None` where there is nothing.
    pub pixels: Vec<Option<Seen>>,
    /// How long the device drew.
    pub time: Duration,
}

impl<K: LaneKernel> DevicePicture<'_, K> {
    /// Draws what the camera sees at the centre of each pixel, in one raster pass: what primary rays through the centres find, but
    /// where a centre lies on an edge up to 1/256 of a pixel, the grid on which rasterisers place vertices. Lights with a body
    /// are not in it.
    ///
    /// Samples of a picture are spread over their pixels, each pixel's otherwise, so [`DevicePicture::render`] traces them.
    ///
    /// # Errors
    /// Cameras that are no pinholes, a device whose pixels hold less than 64 bytes, pictures larger than its textures, or its loss.
    pub fn first_surfaces(&self) -> Result<GBuffer, DeviceError> {
        let view = &self.on_cpu.view;
        if !view.is_perspective || view.lens.is_some() {
            return Err(DeviceError::Unknown { what: "a raster pass through a lens or without perspective" });
        }
        let chosen = picture::specialise(Specialisation::none(), view, self.settings);
        let raster = self.gpu.raster("render/gbuffer", &self.packed.specialise(chosen))?;
        let size = [self.settings.width, self.settings.height];
        let drawn = self.gpu.draw(&raster, &self.bound(), size, &draws(self.surfaces.scene())?)?;
        Ok(GBuffer { time: drawn.time, pixels: self.seen(&drawn) })
    }

    fn seen(&self, drawn: &RasterOutput) -> Vec<Option<Seen>> {
        let [points, normals, shading_normals, albedos] = &drawn.targets;
        let pixel = |k: usize| {
            let [.., above] = albedos[k];
            let primitive = PrimId(above.checked_sub(1)?);
            let ([position, normal, shading_normal, albedo], [distance, material, instance, _]) =
                split([points[k], normals[k], shading_normals[k], albedos[k]]);
            Some(Seen {
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

/// Three floats and a word of each target.
fn split(texels: [[u32; 4]; 4]) -> ([[f32; 3]; 4], [u32; 4]) {
    (texels.map(|[x, y, z, _]| [x, y, z].map(f32::from_bits)), texels.map(|[.., word]| word))
}

/// A draw for each run of instances of one mesh.
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
                    remedy: "trace primary rays",
                })?;
                draws.push(Draw { vertices: 0..n_vertices, instances: number..number + 1 });
            }
        }
        last = Some(instance.mesh);
    }
    Ok(draws)
}
