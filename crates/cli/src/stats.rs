//! `canted stats`: what each volume strategy costs and buys, in the layout of the dissertation's tables 3 to 5, and what
//! wide trees are made of.

mod device;
mod measure;
mod passes;
mod tables;
mod wide;
mod wide_tables;

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_renderer::prepare;
use canted_scene::Scene;
use canted_trace::Watertight;

use crate::{
    Outcome,
    device::DeviceArg,
    left_out,
    light::LightArgs,
    load,
    options::{self, PresetArg, StructureArgs},
    output,
};

/// Options of `canted stats`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The scene: OBJ, PLY, glTF, GLB, or a scene file in TOML; the built-in one without it.
    scene: Option<PathBuf>,
    /// Seconds into the file's first animation; the pose that the file has without it.
    #[arg(long, value_parser = options::number, value_name = "SECONDS", requires = "scene", allow_hyphen_values = true)]
    time: Option<f32>,
    /// Presets of wide trees to build, separated by commas: `fast`, `balanced`, `quality`, which takes the longest.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "balanced", value_name = "PRESETS")]
    presets: Vec<PresetArg>,
    /// Tell what a device needs for the scene, too: `gpu`, or a part of an adapter's name; `auto` does where there is a GPU,
    /// `cpu` does not.
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    device: DeviceArg,
    /// Number of threads; all processors without it.
    #[arg(long, value_parser = options::threads, value_name = "N")]
    threads: Option<usize>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Builds the scene with every strategy and with presets, in one level and in two, and prints the tables.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    options::use_threads(args.threads)?;
    if matches!(args.device, DeviceArg::Both(_)) {
        return Err(anyhow!("--device both shares out tiles of pictures: use cpu, gpu or an adapter's name"));
    }
    let machine = args.device.open()?;
    let mut scene = load::scene_at(args.scene.as_deref(), args.time)?;
    // A picture's light, which a scene without any gets there.
    options::defaults::<LightArgs>().apply(&mut scene)?;
    let name = load::name(args.scene.as_deref());
    let measured = measure::measure(&scene).map_err(|error| anyhow!("{name}: {error}"))?;
    let wide = wide::measure(&scene, &args.presets).map_err(|error| anyhow!("{name}: {error}"))?;
    let config = options::defaults::<StructureArgs>().config(&scene);
    let prepared = prepare::<Watertight>(&scene, &config).map_err(|error| anyhow!("{name}: {error}"))?;
    let left_out = left_out::json(&prepared.unused, false);
    let device = device::measure(&machine, &scene, &prepared.structure, &name)?;
    let table = if args.json { tables::json } else { tables::text };
    let text = table(&name, &scene, &measured, &wide, &left_out, device.as_ref());
    output::to_stdout(&text)?;
    Ok(Outcome::Done)
}

/// By how much a mesh grows on its way to the world: as its first instance does.
fn world_scale(scene: &Scene, mesh_index: usize) -> f64 {
    let placed = scene.instances.iter().find(|instance| instance.mesh.0 as usize == mesh_index);
    placed.map_or(1.0, |placed| placed.world_from_object.determinant().abs().cbrt())
}
