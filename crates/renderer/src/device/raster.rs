//! The first surface of each pixel by rasterization instead of ray tracing, and camera rays that start with it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use canted_gpu::{AdapterKind, Draw, GpuError, RasterOutput, Variant, block_on, choice, wgsl};
use canted_obb::PrimId;
use canted_scene::{MaterialId, Scene};
use canted_trace::InstanceId;

use super::collector::SampleDispatcher;
use super::records::LightKernels;
use super::{DeviceError, DevicePicture, picture};
use crate::{FirstHit, Integrator};

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

impl DevicePicture<'_> {
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
        if self.packed.has_curves() {
            return Err(DeviceError::Raster { what: "curves" });
        }
        let chosen = picture::specialize(Variant::none(), view, self.settings);
        let raster = self.gpu.raster(wgsl::render::GBUFFER, &self.packed.specialize(chosen))?;
        let size = [self.settings.width, self.settings.height];
        let drawn = block_on(self.gpu.draw(&raster, &self.bindings(), size, &draws(self.surfaces.scene())?))?;
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

/// Cells of 8 x 8 pixels that a measurement renders, at most and at least.
const MEASURED_CELLS: [u32; 2] = [256, 16];

/// Rounds of a measurement, of which the fastest counts. The driver compiles before the first.
const ROUNDS: usize = 3;

/// The part of the time of a picture that each of two measurements may take.
const MEASURED_PART: f64 = 0.0125;

/// The part of the time of a picture that a raster pass with its kernel may take.
const TRIAL_PART: f64 = 0.025;

const _: () = assert!(2.0 * MEASURED_PART + TRIAL_PART <= 0.05);

/// What a raster pass and the compilation of its kernel may take that a driver has not compiled before. Drivers took 0.4 to 3 s for the
/// kernels of a whole sample.
const TRIAL: Duration = Duration::from_millis(500);

/// The number of cells that a measurement renders, of a picture with this number of cells and of samples of a pixel; `None` where it
/// would take too large a part of the picture.
fn measured_cells(n_cells: u32, n_samples: u32) -> Option<u32> {
    let affordable = MEASURED_PART * f64::from(n_cells) * f64::from(n_samples) / (ROUNDS + 1) as f64;
    let [most, least] = MEASURED_CELLS;
    let n = (affordable as u32).min(n_cells).min(most);
    (n >= least).then_some(n)
}

impl DevicePicture<'_> {
    /// The same picture with first hits found in this way. Returns what is used for [`FirstHit::Auto`], too.
    ///
    /// # Errors
    /// [`FirstHit::Raster`] with the path integrator or a camera that cannot be rasterized; the loss of the device.
    pub fn with_first_hit(self, wanted: FirstHit) -> Result<(Self, FirstHit), DeviceError> {
        match wanted {
            FirstHit::Trace => Ok((self, FirstHit::Trace)),
            FirstHit::Raster => Ok((self.rasterized()?.0, FirstHit::Raster)),
            FirstHit::Auto if self.may_gain() => self.faster(),
            FirstHit::Auto => Ok((self, FirstHit::Trace)),
        }
    }

    /// Whether a raster pass is possible and not known to be slow.
    fn may_gain(&self) -> bool {
        let view = &self.cpu.view;
        self.settings.integrator == Integrator::Hybrid
            && view.is_perspective
            && view.lens.is_none()
            && !self.packed.has_curves()
            && self.gpu.info().kind != AdapterKind::Software
    }

    /// The picture with rays that start from a raster pass, and the time of the pass.
    fn rasterized(self) -> Result<(Self, Duration), DeviceError> {
        if self.settings.integrator != Integrator::Hybrid {
            return Err(DeviceError::Raster { what: "the path integrator" });
        }
        let surfaces = self.first_surfaces()?;
        let nothing = [u32::MAX; 2];
        let seen: Vec<[u32; 2]> = surfaces
            .pixels
            .iter()
            .map(|seen| seen.as_ref().map_or(nothing, |at| [at.instance.0, at.primitive.0]))
            .collect();
        let first_seen = Some(self.gpu.buffer("first hits", &seen)?);
        let chosen = self.chosen.clone().with(choice::First::Raster);
        let light = self.gpu.kernel(wgsl::render::HYBRID, &chosen)?;
        Ok((self.with_kernels(LightKernels::Whole(light, "a raster pass"), first_seen), surfaces.time))
    }

    /// The faster way, measured over a part of the picture. Small and fast pictures are traced: they gain less than the measurement takes.
    fn faster(self) -> Result<(Self, FirstHit), DeviceError> {
        let [columns, rows] = self.cells();
        let n_samples = self.settings.range().len() as u32;
        let Some(n) = measured_cells(columns * rows, n_samples) else { return Ok((self, FirstHit::Trace)) };
        let share = f64::from(columns * rows) * f64::from(n_samples) / f64::from(n);
        let tracing = share * self.time_of_cells(n)?.as_secs_f64();
        if TRIAL_PART * tracing < TRIAL.as_secs_f64() {
            return Ok((self, FirstHit::Trace));
        }
        let traced = self.kernels.light.clone();
        let (rasterized, pass) = self.rasterized()?;
        let rasterizing = pass.as_secs_f64() + share * rasterized.time_of_cells(n)?.as_secs_f64();
        if rasterizing < tracing {
            return Ok((rasterized, FirstHit::Raster));
        }
        Ok((rasterized.with_kernels(traced, None), FirstHit::Trace))
    }

    /// Columns and rows of cells.
    fn cells(&self) -> [u32; 2] {
        [self.settings.width, self.settings.height].map(|pixels| pixels.div_ceil(8))
    }

    /// The least time of one sample of each pixel of `n` cells all over the picture.
    fn time_of_cells(&self, n: u32) -> Result<Duration, DeviceError> {
        let [columns, rows] = self.cells();
        let all = columns * rows;
        // Evenly spread in reading order. The row is in the upper half of a cell.
        let step = (all / n).max(1);
        let cells: Vec<u32> = (0..n).map(|k| k * step).map(|at| ((at / columns) << 16) | (at % columns)).collect();
        let (kernels, aovs) = ((&self.kernels, &Arc::default()), self.settings.aovs);
        let mut dispatcher = SampleDispatcher::new(self.gpu, &self.traced, kernels, aovs, (n, 1))?;
        let mut least = Duration::MAX;
        for round in 0..=ROUNDS {
            let start = Instant::now();
            for cells in cells.chunks(dispatcher.max_cells()) {
                dispatcher.take(cells, &(0..1), &self.bindings(), &|| false, |_, _, _, _| {})?;
            }
            if round > 0 {
                least = least.min(start.elapsed());
            }
        }
        Ok(least)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measurements_take_a_small_part_of_a_picture() {
        for (n_cells, n_samples) in
            [(920, 16), (32_400, 64), (1, 1), (16, 1_000_000), (32_400, 1), (u32::MAX >> 6, u32::MAX)]
        {
            let all = f64::from(n_cells) * f64::from(n_samples);
            match measured_cells(n_cells, n_samples) {
                Some(n) => {
                    assert!(f64::from(n) * (ROUNDS + 1) as f64 <= MEASURED_PART * all, "{n_cells} {n_samples}: {n}");
                    assert!((16..=256).contains(&n) && n <= n_cells, "{n_cells} {n_samples}: {n}");
                }
                None => assert!(n_cells < 16 || MEASURED_PART * all < 64.0, "{n_cells} {n_samples}"),
            }
        }
        assert_eq!(
            (measured_cells(920, 16), measured_cells(920, 1), measured_cells(32_400, 64)),
            (Some(46), None, Some(256))
        );
    }
}
