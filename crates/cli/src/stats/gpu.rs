//! Measurements on a GPU: times of the build passes, and the buffers for a picture by the hybrid integrator.

use std::{fmt::Write, time::Instant};

use anyhow::Result;
use canted_gpu::{
    Gpu, GpuError, block_on,
    build::{BuildConfig, BuildEncoder, Built, Passes, Primitives, STRATEGIES},
};
use canted_lbvh::{self as lbvh, Bits, Corners, Strategy};
use canted_obb::Obb;
use canted_renderer::{DevicePicture, SceneBvh, Settings, Surfaces, frame};
use canted_scene::{Instance, Scene};
use serde_json::{Map, Value, json};

use crate::{device::Machine, options, process};

/// Builds the scene on the GPU, and returns the measurements as JSON and as tables; `None` without a GPU.
pub(super) fn measure(machine: &Machine, scene: &Scene, bvh: &SceneBvh) -> Result<Option<(Value, String)>> {
    let Some(gpu) = machine.gpu() else { return Ok(None) };
    let name = &gpu.info().name;
    let passes = pass_times(gpu, scene)?;
    let mut json = json!({ "name": name, "build": passes.json() });
    let mut text = String::new();
    passes.text(&mut text, name);
    let settings = Settings::default();
    let [width, height] = [settings.width, settings.height].map(f64::from);
    let camera = scene.cameras.first().copied().unwrap_or_else(|| frame(scene, bvh, width / height));
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let picture = |gpu| DevicePicture::new(gpu, &surfaces, bvh, &camera, &settings);
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

/// Measured runs, of which the least time of each pass counts. A first run, in which drivers compile, is not measured.
const RUNS: usize = 3;

/// One level of BVHs.
struct Level {
    /// Triangles, or instances.
    n_items: u32,
    /// Milliseconds to gather and upload the triangles, wall-clock.
    upload: Option<f64>,
    passes: Passes,
}

/// All levels.
struct PassTimes {
    /// Whether the times are GPU timestamps and not wall-clock times.
    by_timestamps: bool,
    /// Each level, or the error why the GPU cannot build it.
    levels: [(&'static str, Result<Level, GpuError>); 3],
    /// Milliseconds to rebuild the top level for other transforms, wall-clock.
    rebuild_top: Option<f64>,
}

/// Builds the scene in one level and in two.
///
/// # Errors
/// Invalid geometry.
fn pass_times(gpu: &Gpu, scene: &Scene) -> Result<PassTimes> {
    let start = Instant::now();
    let (positions, triangles, _) = canted_renderer::flatten(scene)?;
    let (corners, _) = lbvh::triangle_corners(&positions, &triangles)?;
    let one = uploaded(gpu, start, &[corners]).and_then(|(primitives, upload)| level(gpu, &primitives, Some(upload)));
    let start = Instant::now();
    let meshes: Vec<Vec<Corners>> = scene
        .meshes
        .iter()
        .map(|mesh| Ok(lbvh::triangle_corners(&mesh.positions, &mesh.triangles)?.0))
        .collect::<Result<_>>()?;
    let (bottom, top, rebuild_top) = match uploaded(gpu, start, &meshes) {
        Err(error) => (Err(error.clone()), Err(error), None),
        Ok((primitives, upload)) => {
            let bottom = level(gpu, &primitives, Some(upload));
            let (top, rebuild_top) =
                top(gpu, scene, primitives).map_or_else(|error| (Err(error), None), |(top, ms)| (Ok(top), Some(ms)));
            (bottom, top, rebuild_top)
        }
    };
    Ok(PassTimes {
        by_timestamps: gpu.has_timestamps(),
        levels: [("one level", one), ("bottom levels", bottom), ("top level", top)],
        rebuild_top,
    })
}

/// Uploads meshes; also returns the milliseconds since `start`.
fn uploaded(gpu: &Gpu, start: Instant, meshes: &[Vec<Corners>]) -> Result<(Primitives, f64), GpuError> {
    let primitives = Primitives::triangles(gpu, meshes.iter().map(|corners| &corners[..]))?;
    block_on(gpu.finish())?;
    Ok((primitives, start.elapsed().as_secs_f64() * 1e3))
}

/// The top level over bottom levels with oriented volumes, and the milliseconds to rebuild it alone.
fn top(gpu: &Gpu, scene: &Scene, primitives: Primitives) -> Result<(Level, f64), GpuError> {
    let config = BuildConfig { bits: Bits::B63, strategy: Strategy::Combined };
    let mut build = BuildEncoder::new(gpu);
    let roots = block_on(Built::new(&mut build, primitives, config)?.roots(gpu))?;
    let mut over_instances = || {
        let of = |instance: &Instance| Some(roots[instance.mesh.0 as usize]?.transformed(&instance.world_from_object));
        let boxes: Vec<Obb> = scene.instances.iter().filter_map(of).collect();
        if boxes.iter().any(|placed| !placed.aabb().is_finite()) {
            let what = "an instance whose bounds exceed the range of f32".to_owned();
            return Err(GpuError::Unsupported { what });
        }
        Built::new(&mut build, Primitives::boxes(gpu, &boxes)?, config)
    };
    over_instances()?;
    block_on(gpu.finish())?;
    let start = Instant::now();
    let top = over_instances()?;
    block_on(gpu.finish())?;
    let rebuild_ms = start.elapsed().as_secs_f64() * 1e3;
    Ok((level(gpu, &top.primitives, None)?, rebuild_ms))
}

/// Times every pass.
fn level(gpu: &Gpu, primitives: &Primitives, upload: Option<f64>) -> Result<Level, GpuError> {
    let passes = block_on(Passes::measure(gpu, primitives, Bits::B63, RUNS))?;
    Ok(Level { n_items: primitives.len(), upload, passes })
}

impl PassTimes {
    /// Appends the table.
    fn text(&self, out: &mut String, adapter: &str) {
        let clock = if self.by_timestamps { "GPU timestamps" } else { "wall-clock" };
        // Writing to a String cannot fail.
        let _ = write!(
            out,
            "\nBuild times in milliseconds on {adapter} ({clock}, least of {RUNS} runs; upload: wall-clock)\n{:<20}{:>9}",
            "", "upload"
        );
        for title in ["domain", "codes", "sort", "nodes"] {
            let _ = write!(out, "{title:>9}");
        }
        for strategy in STRATEGIES {
            let _ = write!(out, "{:>14}", strategy.name());
        }
        for (title, level) in &self.levels {
            let _ = write!(out, "\n{title:<20}");
            match level {
                Err(error) => {
                    let _ = write!(out, " {error}");
                }
                Ok(level) => {
                    let Passes { domain, codes, sort, tree, boxes, error } = &level.passes;
                    let text = |ms: Option<f64>| ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.2}"));
                    for ms in [level.upload, *domain, *codes, *sort, *tree] {
                        let _ = write!(out, "{:>9}", text(ms));
                    }
                    for ms in boxes {
                        let _ = write!(out, "{:>14}", text(*ms));
                    }
                    if let Some(error) = error {
                        let _ = write!(out, "\n{:<20} {error}", "");
                    }
                }
            }
        }
        out.push('\n');
        if let Some(ms) = self.rebuild_top {
            let _ = writeln!(out, "Rebuild of the top level after instances moved: {ms:.2} ms (wall-clock)");
        }
    }

    /// One JSON object.
    fn json(&self) -> Value {
        let of = |(title, level): &(&str, Result<Level, GpuError>)| {
            let value = match level {
                Ok(level) => level_json(level),
                Err(error) => json!({ "error": error.to_string() }),
            };
            (title.replace(' ', "_"), value)
        };
        let levels: Map<String, Value> = self.levels.iter().map(of).collect();
        let mut all = json!({ "by_timestamps": self.by_timestamps, "runs": RUNS, "levels": levels });
        if let Some(ms) = self.rebuild_top {
            all["rebuild_top_ms"] = ms.into();
        }
        all
    }
}

fn level_json(level: &Level) -> Value {
    let Passes { domain, codes, sort, tree, boxes, error } = &level.passes;
    let boxes: Map<String, Value> =
        STRATEGIES.into_iter().zip(boxes).map(|(strategy, ms)| (strategy.name().to_owned(), (*ms).into())).collect();
    let mut all = json!({
        "items": level.n_items, "domain_ms": domain, "codes_ms": codes, "sort_ms": sort, "tree_ms": tree,
        "volumes_ms": boxes,
    });
    if let Some(ms) = level.upload {
        all["upload_ms"] = ms.into();
    }
    if let Some(error) = error {
        all["error"] = error.to_string().into();
    }
    all
}
