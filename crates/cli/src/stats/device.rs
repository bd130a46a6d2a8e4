//! What a device does for the scene: the passes of a build, and the buffers that the kernel of a picture by the hybrid integrator
//! binds.

use std::fmt::Write;

use anyhow::{Result, anyhow};
use canted_renderer::{DevicePicture, Settings, Structure, Surfaces, frame};
use canted_scene::Scene;
use canted_wide::LaneKernel;
use serde_json::{Value, json};

use super::passes;
use crate::{device::Machine, memory};

/// What was found on a device.
pub(super) struct Measured {
    name: String,
    passes: passes::Measured,
    /// `None` where `--device auto` meets what kernels do not know.
    buffers: Option<Vec<(String, u64)>>,
}

/// Takes the scene to the machine's device; `None` where it has none.
pub(super) fn measure<K: LaneKernel>(
    machine: &Machine,
    scene: &Scene,
    structure: &Structure<K>,
    scene_name: &str,
) -> Result<Option<Measured>> {
    let Some(gpu) = machine.gpu() else { return Ok(None) };
    let passes = passes::measure(gpu, scene).map_err(|error| anyhow!("{scene_name}: {error}"))?;
    let settings = Settings::default();
    let [width, height] = [settings.width, settings.height].map(f64::from);
    let camera = scene.cameras.first().copied().unwrap_or_else(|| frame(scene, structure, width / height));
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let picture = machine.ready(|gpu| DevicePicture::new(gpu, &surfaces, structure, &camera, &settings))?;
    let buffers = picture
        .map(|picture| picture.buffers().into_iter().map(|(name, n_bytes)| (name.to_owned(), n_bytes)).collect());
    Ok(Some(Measured { name: gpu.info().name.clone(), passes, buffers }))
}

fn sum(buffers: &[(String, u64)]) -> u64 {
    buffers.iter().map(|(_, n_bytes)| n_bytes).sum()
}

impl Measured {
    /// All of it as JSON.
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

    /// Adds all of it for people.
    pub(super) fn text(&self, out: &mut String) {
        self.passes.text(out, &self.name);
        let Some(buffers) = &self.buffers else { return };
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "\nBuffers of a picture on {}: {}, {}",
            self.name,
            buffers.len(),
            memory::human(sum(buffers))
        );
        for (name, n_bytes) in buffers {
            let _ = writeln!(out, "{name:<20}{:>11}", memory::human(*n_bytes));
        }
    }
}
