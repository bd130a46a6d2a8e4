//! Options of `canted render`, and what they decide together.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_film::Record;
use canted_renderer::{Integrator, Settings, light_hash, scene_hash};
use canted_scene::{Camera, Scene};
use clap::ValueEnum;

use super::{
    camera::{self, CameraArgs},
    choices::{FilterArg, IntegratorArg, LodArg},
    samples::SampleArgs,
};
use crate::{
    device::DeviceArg,
    light::LightArgs,
    load::Inputs,
    options::{self, StructureArgs},
};

/// Options of `canted render`.
#[derive(clap::Args, Clone)]
pub(crate) struct Args {
    /// The scene: OBJ, PLY, glTF, GLB, or a scene file in TOML; the built-in one without it.
    pub(crate) scene: Option<PathBuf>,
    /// Seconds into the file's first animation; the pose that the file has without it.
    #[arg(long, value_parser = options::number, value_name = "SECONDS", requires = "scene", allow_hyphen_values = true)]
    pub(crate) time: Option<f32>,
    /// The picture: `.png` (sRGB) or `.exr` (linear).
    #[arg(short, long, default_value = "canted.png", value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Pixels, as 1280x720.
    #[arg(long, value_parser = options::size, default_value = "1280x720", value_name = "WxH", allow_hyphen_values = true)]
    pub(crate) size: [u32; 2],
    #[command(flatten)]
    pub(super) samples: SampleArgs,
    /// How light around the middle of a pixel is weighed.
    #[arg(long, value_enum, default_value_t = FilterArg::Box, value_name = "FILTER")]
    pub(super) filter: FilterArg,
    /// How much of a texture a lookup averages: the texels about a point, a square, or the ellipse that is seen.
    #[arg(long, value_enum, default_value_t = LodArg::Aniso, value_name = "LOD")]
    pub(super) lod: LodArg,
    /// Which light is gathered: `hybrid` is fast and approximate, `path` computes what materials and lights say.
    #[arg(long, value_enum, default_value_t = IntegratorArg::Hybrid, value_name = "INTEGRATOR")]
    pub(super) integrator: IntegratorArg,
    /// Bounces after the surface that the camera sees: 2 for `hybrid`, 32 for `path` without it.
    #[arg(long, value_parser = clap::value_parser!(u32).range(0..=4096), value_name = "N")]
    pub(super) bounces: Option<u32>,
    #[command(flatten)]
    pub(super) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) light: LightArgs,
    #[command(flatten)]
    pub(crate) structure: StructureArgs,
    /// World-space distance over which cut-off bounces' light returns beside an occluder, for `hybrid`; `inf` for none, a tenth of
    /// the scene's diagonal without it.
    #[arg(long, value_parser = options::radius, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(super) ao_radius: Option<f32>,
    /// Show what primary rays cost instead of light.
    #[arg(long, value_enum, value_name = "TESTS")]
    pub(super) heatmap: Option<HeatmapArg>,
    /// Tests shown in the brightest colour of a heat map; a wide node counts as eight boxes.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), default_value_t = 128, requires = "heatmap", value_name = "N")]
    pub(super) heatmap_scale: u32,
    /// What computes: `auto` takes a GPU where there is one that knows the scene, else the CPU; `cpu`; `gpu` the best adapter;
    /// `both` shares the tiles out between CPU and GPU, and is the CPU alone where the only adapter is software; `both:NAME` shares
    /// with this one; else a part of an adapter's name, which `canted devices` lists.
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    pub(super) device: DeviceArg,
    /// Number of threads; all processors without it.
    #[arg(long, value_parser = options::threads, value_name = "N")]
    pub(super) threads: Option<usize>,
    /// Chooses the random numbers.
    #[arg(long, default_value_t = 0, value_name = "N", allow_hyphen_values = true)]
    pub(super) seed: u32,
    /// Print the facts about the run as JSON.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(ValueEnum, Clone, Copy)]
pub(super) enum HeatmapArg {
    Boxes,
    Triangles,
}

impl Args {
    /// What is read.
    pub(crate) fn inputs(&self) -> Result<Inputs> {
        let inputs = Inputs::of(self.scene.as_deref())?;
        Ok(match self.light.environment_file() {
            Some((image, ..)) => inputs.and("--env", image),
            None => inputs,
        })
    }

    pub(crate) fn settings(&self) -> Result<Settings> {
        let [width, height] = self.size;
        let Self { seed, ao_radius, .. } = *self;
        let (filter, lod) = (self.filter.filter(), self.lod.lod());
        let integrator = self.integrator.integrator();
        if ao_radius.is_some() && integrator != Integrator::Hybrid {
            return Err(anyhow!("--ao-radius is of the hybrid integrator alone"));
        }
        let bounces = self.bounces.unwrap_or(integrator.bounces());
        let mut settings =
            Settings { width, height, integrator, filter, lod, bounces, seed, ao_radius, ..Settings::default() };
        self.samples.apply(&mut settings)?;
        Ok(settings)
    }

    /// What decides the value of a sample, by name; `device` does by its roundings.
    pub(super) fn record(&self, scene: &Scene, camera: &Camera, settings: &Settings, device: String) -> Record {
        let triangles = self.structure.triangles.to_possible_value();
        let own = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("scene", format!("{:016x}", scene_hash(scene))),
            ("light", format!("{:016x}", light_hash(scene))),
            ("triangles", triangles.map_or_else(String::new, |value| value.get_name().to_owned())),
            ("device", device),
        ];
        let named = |(name, value): (&str, String)| (name.to_owned(), value);
        // The camera last: it may be another for another size.
        own.map(named).into_iter().chain(settings.record()).chain(camera::record(camera).map(named)).collect()
    }
}

/// The record of a checkpoint: what its tiles are sums of, too.
pub(super) fn of_tiles(record: &Record, settings: &Settings) -> Record {
    let noise = settings.noise.map_or_else(|| "none".to_owned(), |noise| noise.to_string());
    let own = [
        ("samples", format!("{:?}", settings.range())),
        ("use", if settings.part.is_some() { "a part to merge" } else { "a picture" }.to_owned()),
        ("noise", noise),
        ("aovs", settings.aovs.to_string()),
        ("tile", settings.tile.to_string()),
    ];
    record.iter().cloned().chain(own.map(|(name, value)| (name.to_owned(), value))).collect()
}
