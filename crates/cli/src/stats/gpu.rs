//! Measurements on a GPU: times of the build passes, and the buffers for a picture by the hybrid integrator.

mod passes;

use std::fmt::Write;

use anyhow::Result;
use canted_renderer::{DevicePicture, Settings, Structure, Surfaces, frame};
use canted_scene::Scene;
use canted_wide::LaneKernel;
use serde_json::{Value, json};

use crate::{
    device::Machine,
    options, process,
};

/// Builds the scene on the GPU, and returns the measurements as JSON and as tables; `None` without a GPU.
pub(super) fn measure<K: LaneKernel>(
    machine: &Machine,
    scene: &Scene,
    structure: &Structure<K>,
) -> Result<Option<(Value, String)>> {
    let Some(gpu) = machine.gpu() else { return Ok(None) };
    let name = &gpu.info().name;
    let passes = passes::measure(gpu, scene)?;
    let mut json = json!({ "name": name, "build": passes.json() });
    let mut text = String::new();
    passes.text(&mut text, name);
    let settings = Settings::default();
    let [width, height] = [settings.width, settings.height].map(f64::from);
    let camera = scene.cameras.first().copied().unwrap_or_else(|| frame(scene, structure, width / height));
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let picture = |gpu| DevicePicture::new(gpu, &surfaces, structure, &camera, &settings);
    if let Some((_, picture)) = machine.ready(&options::Structure::default(), picture)? {
        let buffers = picture.buffers();
        let n_bytes: u64 = buffers.iter().map(|(_, n_bytes)| n_bytes).sum();
        json["buffers"] = buffers.iter().map(|(name, n_bytes)| json!({ "name": name, "bytes": n_bytes })).collect();
        json["bytes"] = n_bytes.into();
        // Writing to a String cannot fail.
        let _ = writeln!(text, "\nBuffers for a picture on {name}: {}, {}", buffers.len(), process::human(n_bytes));
        for (name, n_bytes) in buffers {
            let _ = writeln!(text, "{name:<20}{:>11}", process::human(n_bytes));
        }
    }
    Ok(Some((json, text)))
}
