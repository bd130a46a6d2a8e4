//! What a device needs for a picture of the scene by the hybrid integrator: the buffers that its kernel binds, and no others.

use std::fmt::Write;

use anyhow::{Result, anyhow};
use canted_renderer::{DevicePicture, Prepared, Settings, StructureConfig, Surfaces, frame, prepare};
use canted_scene::Scene;
use canted_trace::Watertight;
use serde_json::{Value, json};

use crate::{device::Machine, memory};

/// What was found on a device.
pub(super) struct Measured {
    name: String,
    buffers: Vec<(String, u64)>,
}

/// Takes the scene to the machine's device; `None` where it has none, or where `--device auto` meets what kernels do not know.
pub(super) fn measure(machine: &Machine, scene: &Scene, scene_name: &str) -> Result<Option<Measured>> {
    let Some(gpu) = machine.gpu() else { return Ok(None) };
    let Prepared { structure, .. } =
        prepare::<Watertight>(scene, &StructureConfig::default()).map_err(|error| anyhow!("{scene_name}: {error}"))?;
    let settings = Settings::default();
    let [width, height] = [settings.width, settings.height].map(f64::from);
    let camera = scene.cameras.first().copied().unwrap_or_else(|| frame(scene, &structure, width / height));
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let picture = machine.ready(|gpu| DevicePicture::new(gpu, &surfaces, &structure, &camera, &settings))?;
    Ok(picture.map(|picture| Measured {
        name: gpu.facts().name.clone(),
        buffers: picture.buffers().into_iter().map(|(name, n_bytes)| (name.to_owned(), n_bytes)).collect(),
    }))
}

impl Measured {
    fn n_bytes(&self) -> u64 {
        self.buffers.iter().map(|(_, n_bytes)| n_bytes).sum()
    }

    /// All of it as JSON.
    pub(super) fn json(&self) -> Value {
        let buffers: Vec<Value> =
            self.buffers.iter().map(|(name, n_bytes)| json!({ "name": name, "bytes": n_bytes })).collect();
        json!({ "name": self.name, "buffers": buffers, "bytes": self.n_bytes() })
    }

    /// Adds all of it for people.
    pub(super) fn text(&self, out: &mut String) {
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "\nBuffers of a picture on {}: {}, {}",
            self.name,
            self.buffers.len(),
            memory::human(self.n_bytes())
        );
        for (name, n_bytes) in &self.buffers {
            let _ = writeln!(out, "{name:<20}{:>11}", memory::human(*n_bytes));
        }
    }
}
