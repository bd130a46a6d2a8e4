//! Measurements on a GPU: times of the build passes, and the buffers for a picture by the hybrid integrator.

use std::fmt::Write;

use anyhow::Result;
use canted_renderer::{DevicePicture, Settings, Structure, Surfaces, frame};
use canted_scene::Scene;
use canted_wide::LaneKernel;
use serde_json::{Value, json};

use super::gpu_passes::{self, PassTimes};
use crate::{device::Machine, memory};

/// The measurements.
pub(super) struct GpuStats {
    name: String,
    passes: PassTimes,
    /// `None` where `--device auto` falls back to the CPU.
    buffers: Option<Vec<(String, u64)>>,
}

/// Builds the scene on the GPU; `None` without a GPU.
pub(super) fn measure<K: LaneKernel>(
    machine: &Machine,
    scene: &Scene,
    structure: &Structure<K>,
) -> Result<Option<GpuStats>> {
    let Some(gpu) = machine.gpu() else { return Ok(None) };
    let passes = gpu_passes::measure(gpu, scene)?;
    let settings = Settings::default();
    let [width, height] = [settings.width, settings.height].map(f64::from);
    let camera = scene.cameras.first().copied().unwrap_or_else(|| frame(scene, structure, width / height));
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let picture = machine.ready(|gpu| DevicePicture::new(gpu, &surfaces, structure, &camera, &settings))?;
    let buffers = picture
        .map(|picture| picture.buffers().into_iter().map(|(name, n_bytes)| (name.to_owned(), n_bytes)).collect());
    Ok(Some(GpuStats { name: gpu.info().name.clone(), passes, buffers }))
}

fn sum(buffers: &[(String, u64)]) -> u64 {
    buffers.iter().map(|(_, n_bytes)| n_bytes).sum()
}

impl GpuStats {
    /// One JSON object.
    pub(super) fn json(&self) -> Value {
        let mut all = json!({ "name": self.name, "build": self.passes.json() });
        if let Some(buffers) = &self.buffers {
            let each: Vec<Value> =
                buffers.iter().map(|(name, n_bytes)| json!({ "name": name, "bytes": n_bytes })).collect();
            all["buffers"] = each.into();
            all["bytes"] = sum(buffers).into();
        }
        all
    }

    /// Appends tables.
    pub(super) fn text(&self, out: &mut String) {
        self.passes.text(out, &self.name);
        let Some(buffers) = &self.buffers else { return };
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "\nBuffers for a picture on {}: {}, {}",
            self.name,
            buffers.len(),
            memory::human(sum(buffers))
        );
        for (name, n_bytes) in buffers {
            let _ = writeln!(out, "{name:<20}{:>11}", memory::human(*n_bytes));
        }
    }
}
