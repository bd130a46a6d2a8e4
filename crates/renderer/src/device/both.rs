//! Pictures by a device and the CPU together.

use canted_film::{Film, Sums, Tile, Tiling};
use canted_gpu::GpuError;
use canted_wide::LaneKernel;

use super::division::{Division, Side};
use super::film::{self, Taker};
use super::slices::Slicer;
use super::{DeviceError, DevicePicture};
use crate::render::{TileMaker, in_place};
use crate::{Monitor, RenderError};

/// A picture that a device and the CPU made together.
pub struct SharedFilm {
    /// The film.
    pub film: Film,
    /// Tiles that the device made in this call.
    pub n_tiles_of_device: usize,
    /// Why the device stopped before the picture was done, if it did: the CPU has made the rest.
    pub stopped: Option<GpuError>,
}

impl<K: LaneKernel> DevicePicture<'_, K> {
    /// Renders as [`DevicePicture::render`] does, with the caller's thread pool beside the device: each makes as many tiles as
    /// its speed allows. A tile has the bits of whichever made it, so the picture's depend on how they were shared out.
    ///
    /// # Errors
    /// A tile that cannot be of this picture, or [`RenderError::Cancelled`]; the loss of the device is none.
    pub fn render_with_cpu(&self, done: Vec<Tile>, monitor: &Monitor) -> Result<SharedFilm, DeviceError> {
        let tiling = self.settings.tiling();
        let division = Division::new(in_place(&tiling, done)?, monitor);
        let by_device = self.on_cpu.with_tiles(|make| {
            rayon::in_place_scope(|scope| {
                for _ in 0..rayon::current_num_threads() {
                    scope.spawn(|_| by_cpu(make, &division));
                }
                self.by_device(&tiling, &division)
            })
        });
        let (tiles, n_tiles_of_device) = division.into_tiles().ok_or(RenderError::Cancelled)?;
        let film = tiling.film(&tiles);
        Ok(SharedFilm { film, n_tiles_of_device, stopped: by_device.err() })
    }

    fn by_device(&self, tiling: &Tiling, division: &Division) -> Result<(), GpuError> {
        let slicer = Slicer::new(self.gpu, self.stages.clone())?;
        let weight = self.on_cpu.weights();
        let on_cpu = |at, sample, sums: &mut Sums| self.on_cpu.take(at, sample, sums);
        let mut taker =
            Taker { slicer, bound: self.bound(), settings: self.settings, weight: &weight, on_cpu: &on_cpu };
        loop {
            let numbers = division.next_of_device(|shown| film::next_run(&taker.slicer, tiling, self.settings, shown));
            if numbers.is_empty() || division.is_over(&numbers) {
                return Ok(());
            }
            let made = film::tiles(&mut taker, tiling, &numbers, &|| division.is_over(&numbers))?;
            for tile in made.into_iter().flatten() {
                division.finish(tile, Side::Device);
            }
        }
    }
}

fn by_cpu(make: &TileMaker, division: &Division) {
    while let Some(number) = division.next_of_cpu() {
        let stop = || division.is_over(&[number]);
        match make(number, &stop) {
            Some(tile) => division.finish(tile, Side::Cpu),
            None if division.is_cancelled() => return,
            // The device was first.
            None => {}
        }
    }
}
