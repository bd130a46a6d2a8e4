//! Camera rays that start with what a raster pass saw.

use std::time::{Duration, Instant};

use canted_gpu::AdapterKind;
use canted_wide::LaneKernel;

use super::dispatcher::SampleDispatcher;
use super::records::{PackedSample, PackedSum, SampleRecord, SampleRun};
use super::{DeviceError, DevicePicture};
use crate::{FirstHit, Integrator, SampleSums};

/// Cells of 8 x 8 pixels that a measurement renders, at most.
const MEASURED_CELLS: u32 = 256;

/// Rounds of a measurement, of which the fastest counts. The driver compiles before the first.
const ROUNDS: usize = 3;

impl<K: LaneKernel> DevicePicture<'_, K> {
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
        let chosen = self.chosen.clone().part("first", "shared/camera/first/raster");
        let light = self.gpu.kernel("render/hybrid", &chosen)?;
        Ok((self.with_kernel(light, first_seen), surfaces.time))
    }

    /// The faster way, measured over a part of the picture.
    fn faster(self) -> Result<(Self, FirstHit), DeviceError> {
        let traced = self.kernels.light.clone();
        let tracing = self.time_of_cells()?;
        let (rasterized, pass) = self.rasterized()?;
        let rasterizing = rasterized.time_of_cells()?;
        let [columns, rows] = rasterized.cells();
        let share = f64::from(columns) * f64::from(rows) * f64::from(rasterized.settings.samples)
            / f64::from((columns * rows).min(MEASURED_CELLS));
        if pass.as_secs_f64() + share * rasterizing.as_secs_f64() < share * tracing.as_secs_f64() {
            return Ok((rasterized, FirstHit::Raster));
        }
        Ok((rasterized.with_kernel(traced, None), FirstHit::Trace))
    }

    /// Columns and rows of cells.
    fn cells(&self) -> [u32; 2] {
        [self.settings.width, self.settings.height].map(|pixels| pixels.div_ceil(8))
    }

    /// The least time of one sample of cells all over the picture.
    fn time_of_cells(&self) -> Result<Duration, DeviceError> {
        match self.settings.sums {
            SampleSums::Host => self.time_with::<PackedSample>(),
            SampleSums::Device => self.time_with::<PackedSum>(),
        }
    }

    fn time_with<R: SampleRecord>(&self) -> Result<Duration, DeviceError> {
        let [columns, rows] = self.cells();
        let all = columns * rows;
        let n = all.min(MEASURED_CELLS);
        // Evenly spread in reading order. The row is in the upper half of a cell.
        let step = (all / n).max(1);
        let cells: Vec<u32> = (0..n).map(|k| k * step).map(|at| ((at / columns) << 16) | (at % columns)).collect();
        let mut dispatcher = SampleDispatcher::<R>::new(self.gpu, self.kernels.clone())?;
        let mut least = Duration::MAX;
        for round in 0..=ROUNDS {
            let start = Instant::now();
            dispatcher.take(&cells, SampleRun { first: 0, n: 1, block: 1 }, &self.bindings(), |_, _| true)?;
            if round > 0 {
                least = least.min(start.elapsed());
            }
        }
        Ok(least)
    }
}
