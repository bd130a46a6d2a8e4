//! What a device traces: wide BVHs of the CPU, uploaded, and what it builds itself, from the mesh to the hits.

use std::{fmt::Write, time::Instant};

use anyhow::Result;
use canted_gpu::build::{BuildConfig, Topology, WideConfig};
use canted_gpu::{Gpu, GpuError, SceneInput, TracedScene};
use canted_lbvh::{self as lbvh, Bits, Strategy};
use canted_trace::{Ray, Watertight};
use canted_wide::{Config, Preset, TriangleBvh};

use super::{Bench, rays};
use crate::{
    models::{self, Model},
    wide::sets::Kind,
};

/// A closed surface, thin diagonal parts, and a building.
const SCENES: [&str; 3] = ["bunny", "truss", "sponza"];

/// Rays from the mesh to the hits; on software drivers for the first scene only, because the others take minutes.
const N_RAYS: usize = 100_000;
const FEW_RAYS: usize = 10_000;

/// How a scene comes to the device.
enum Made {
    Uploaded(Preset),
    Binary(Strategy),
    Wide(Bits, Topology, Strategy),
}

const STRUCTURES: [(&str, Made); 9] = [
    ("CPU, fast", Made::Uploaded(Preset::Fast)),
    ("CPU, balanced", Made::Uploaded(Preset::Balanced)),
    ("binary, radix", Made::Binary(Strategy::Aabb)),
    ("wide, radix, 30-bit codes", Made::Wide(Bits::B30, Topology::Radix, Strategy::Aabb)),
    ("wide, radix", Made::Wide(Bits::B63, Topology::Radix, Strategy::Aabb)),
    ("wide, radix, oriented nodes", Made::Wide(Bits::B63, Topology::Radix, Strategy::Combined)),
    ("wide, clustered", Made::Wide(Bits::B63, Topology::Ploc, Strategy::Aabb)),
    ("wide, clustered, oriented nodes", Made::Wide(Bits::B63, Topology::Ploc, Strategy::Combined)),
    ("wide, clustered, oriented nodes by dop", Made::Wide(Bits::B63, Topology::Ploc, Strategy::Dop)),
];

/// Measures and writes the table.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    let _ = writeln!(
        out,
        "\n### From the mesh to the hits\n\nOne BVH over all triangles, 63-bit codes but for one row. Ready: gathering, building, uploading and waiting, from vertices and \
         indices in the memory of the CPU, which uses {} threads. Oriented nodes have boxes of the strategy combined. Camera, diffuse, occlusion: \
         million rays per second of device time, as in the next table. Whole: ready, uploading camera and diffuse rays, tracing \
         and reading hits back. Minimum milliseconds of {} rounds after a warm-up.\n\n\
         | scene | BVH | ready | MB | camera | diffuse | occlusion | rays | whole |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        rayon::current_num_threads(),
        bench.rounds
    );
    for (number, name) in SCENES.into_iter().enumerate() {
        let n_rays = if bench.is_software() && number > 0 { FEW_RAYS } else { N_RAYS };
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let balanced = rays::build(&model, &Config::preset(Preset::Balanced))?;
        let sets = rays::sets(&model, &balanced, bench);
        let some: Vec<Ray> = sets[0].iter().chain(&sets[1]).copied().cycle().take(n_rays).collect();
        for (structure, made) in &STRUCTURES {
            let (mut ready, mut with_rays) = (f64::MAX, f64::MAX);
            for round in 0..=bench.rounds {
                let start = Instant::now();
                let traced = made.traced(&bench.gpu, &model)?;
                bench.gpu.finish()?;
                let built = start.elapsed().as_secs_f64() * 1e3;
                traced.closest_hits(&bench.gpu, &some)?;
                // The driver compiles during the first round.
                if round > 0 {
                    ready = ready.min(built);
                    with_rays = with_rays.min(start.elapsed().as_secs_f64() * 1e3);
                }
            }
            let traced = made.traced(&bench.gpu, &model)?;
            #[expect(clippy::cast_precision_loss, reason = "one digit is shown")]
            let megabytes = traced.n_bytes() as f64 * 1e-6;
            let _ = write!(out, "| {name} | {structure} | {ready:.1} | {megabytes:.1} |");
            for (kind, set) in Kind::ALL.into_iter().zip(&sets) {
                let _ = write!(out, " {:.2} |", rays::cast(bench, &traced, kind, set)?.rate(set.len()));
            }
            let _ = writeln!(out, " {n_rays} | {with_rays:.1} |");
        }
    }
    Ok(())
}

impl Made {
    /// The scene on the device, from vertices and indices.
    fn traced(&self, gpu: &Gpu, model: &Model) -> Result<TracedScene> {
        let (positions, triangles) = (&model.mesh.positions, &model.mesh.triangles);
        let of_device = |make: &dyn Fn(&[lbvh::Corners]) -> Result<TracedScene, GpuError>| -> Result<TracedScene> {
            let (corners, _) = lbvh::triangle_corners(positions, triangles)?;
            Ok(make(&corners)?)
        };
        match *self {
            Self::Uploaded(preset) => {
                let bvh = TriangleBvh::<Watertight>::build(positions, triangles, &Config::preset(preset))?;
                Ok(TracedScene::new(gpu, SceneInput::upload([&bvh]))?)
            }
            Self::Binary(strategy) => {
                let config = BuildConfig { bits: Bits::B63, strategy };
                of_device(&|corners| TracedScene::new(gpu, SceneInput::build([corners], config)))
            }
            Self::Wide(bits, topology, strategy) => {
                let config = WideConfig { bits, topology, strategy };
                of_device(&|corners| TracedScene::new(gpu, SceneInput::build([corners], config)))
            }
        }
    }
}
