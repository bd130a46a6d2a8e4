//! `canted stats`: compares bounding-volume strategies, in the layout of the dissertation's tables 3 to 5, and describes
//! the wide BVHs of presets.

mod binary;
#[cfg(feature = "gpu")]
mod gpu;
mod motion;
mod planes;
mod tables;
mod wide;

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_renderer::SceneBvh;
use canted_scene::{ReadOptions, Scene};
use canted_wide::Preset;

use crate::{
    device::{Machine, RunArgs},
    light::LightArgs,
    load::{self, FileArgs},
    options::{self, Form as _, Structure, named},
    output, render,
    settings::SceneSettings,
};

/// Options of `canted stats`.
#[derive(clap::Args)]
#[command(mut_arg("device", |arg| arg.help(DEVICE)))]
#[command(
    after_help = "Examples:\n  canted stats kitchen.glb\n  canted stats eiffel.obj --presets fast,quality --json > eiffel.json"
)]
pub(crate) struct Args {
    /// Scene: OBJ, PLY, STL, OFF, glTF, GLB, a scene file (.toml), or lines: .hair, .tck, .trk, .pdb, .xyz, .gcode [default: the built-in scene]
    scene: Option<PathBuf>,
    /// Time in the first animation of the file [default: rest pose]
    #[arg(long, value_parser = options::Finite::parse, value_name = "SECONDS", requires = "scene", allow_hyphen_values = true)]
    time: Option<f32>,
    /// Animation of the file, by name or by number from 0 [default: the first]
    #[arg(long, value_name = "NAME|INDEX", requires = "time")]
    animation: Option<String>,
    #[command(flatten)]
    files: FileArgs,
    /// Presets of the wide BVH to build, separated by commas. `quality` takes longest.
    #[arg(long, value_delimiter = ',', default_value = "balanced", value_parser = named::<Preset>(), value_name = "PRESETS")]
    presets: Vec<Preset>,
    #[command(flatten)]
    run: RunArgs,
}

impl Args {
    /// How the file is read, at a time in seconds.
    fn read_options(&self, time: Option<f32>) -> ReadOptions {
        self.files.read_options(time, self.animation.as_deref())
    }
}

const DEVICE: &str = "Device whose build times and buffers are included: auto (a hardware GPU, if there is one), cpu (none), \
                      gpu, or part of an adapter name (see `canted devices`)";

/// Builds the scene with every strategy and with presets, in one level and in two, and prints the tables.
pub(crate) fn run(args: &Args) -> Result<()> {
    SceneSettings::check(args.scene.as_deref())?;
    args.run.start()?;
    let mut scene = load::scene(args.scene.as_deref(), &args.read_options(args.time))?;
    // Adds the default light, as `canted render` does.
    options::defaults::<LightArgs>().apply(&mut scene, None)?;
    let name = load::name(args.scene.as_deref());
    let machine = Machine::open(&args.run.device, &Structure::default())?;
    let report = report(&name, &scene, args, &machine).map_err(|error| anyhow!("{name}: {error}"))?;
    output::to_stdout(&if args.run.json { report.json() } else { report.text() })
}

#[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "the CPU is the only machine"))]
fn report<'a>(name: &'a str, scene: &'a Scene, args: &Args, machine: &Machine) -> Result<tables::Report<'a>> {
    let binary = binary::measure(scene)?;
    let wide = wide::measure(scene, &args.presets)?;
    let planes = planes::measure(scene)?;
    let config = Structure::default().config_for(scene);
    let bvh = SceneBvh::build(scene, &config)?;
    let not_needed = render::not_needed(&bvh.unused, false);
    let levels = bvh.choice;
    let first = args.time.unwrap_or(0.0);
    let motion = motion::measure(args.scene.as_deref(), first, &args.read_options(Some(first)), &config)?;
    #[cfg(feature = "gpu")]
    let gpu = gpu::measure(machine, scene, &bvh)?;
    #[cfg(not(feature = "gpu"))]
    let gpu = None;
    Ok(tables::Report { name, scene, binary, wide, planes, not_needed, levels, motion, gpu })
}

/// The scale from a mesh to the world, by its first instance.
fn world_scale(scene: &Scene, mesh_index: usize) -> f64 {
    let instance = scene.instances.iter().find(|instance| instance.mesh.0 as usize == mesh_index);
    instance.map_or(1.0, |instance| instance.world_from_object.determinant().abs().cbrt())
}
