//! Rays on the device: through a WideBvh with oriented nodes and without, and from the mesh to the hits, through what the CPU
//! uploads and what the device builds itself.

use std::{fmt::Write, time::Instant};

use anyhow::Result;
use canted_gpu::{
    Buffer, Commands, DeviceHit, DeviceRay, Gpu, GpuError, SceneInput, TracedScene,
    build::{BuildConfig, Topology, WideConfig},
};
use canted_lbvh::{self as lbvh, Bits, Strategy};
use canted_trace::{Intersect, Ray, ScaledRay};
use canted_wide::{Config, Preset, TriangleBvh};

use super::Bench;
use crate::models::{self, Kind, Model};

/// An ordinary scene, and two of thin diagonal parts.
const SCENES: [&str; 3] = ["sponza", "eiffel", "truss"];

/// Rays of a dispatch.
const SLICE: usize = 1 << 20;

/// Side of the squares of pixels whose rays a work-group traces.
const SQUARE: usize = 8;

/// Measures and writes the table.
pub(super) fn section(out: &mut String, bench: &Bench) -> Result<()> {
    let _ = writeln!(
        out,
        "\n### Rays\n\nPreset balanced, with oriented nodes where they pay off, and with axis-aligned nodes only. {0} x {0} camera \
         rays of each of four views, in squares of {SQUARE} x {SQUARE}; one diffuse ray and one occlusion ray from each of their \
         hits. Million rays per second of device time; what f32 leaves undecided is traced again by exact kernels, which is included. The last columns: share of such \
         rays with oriented nodes, in percent, and the number of rays whose traversal the driver cut short.\n\n\
         | scene | rays | number | oriented | axis-aligned | ratio | exact | cut |\n| --- | --- | --- | --- | --- | --- | --- | --- |",
        bench.scale.resolution
    );
    for name in SCENES {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let oriented = Config::preset(Preset::Balanced);
        let aligned = Config { oriented: false, rotate_mesh: false, ..oriented };
        let [oriented, aligned] = [build(&model, &oriented)?, build(&model, &aligned)?];
        let sets = sets(&model, &oriented, bench);
        let traced = [
            TracedScene::new(&bench.gpu, SceneInput::upload([&oriented]))?,
            TracedScene::new(&bench.gpu, SceneInput::upload([&aligned]))?,
        ];
        for (kind, rays) in Kind::ALL.into_iter().zip(sets) {
            let [oriented, aligned] = [cast(bench, &traced[0], kind, &rays)?, cast(bench, &traced[1], kind, &rays)?];
            let _ = writeln!(
                out,
                "| {name} | {} | {} | {:.2} | {:.2} | {:.2}x | {:.2} | {} |",
                kind.name(),
                rays.len(),
                oriented.rate(rays.len()),
                aligned.rate(rays.len()),
                aligned.milliseconds / oriented.milliseconds,
                1e2 * oriented.n_exact as f64 / rays.len().max(1) as f64,
                oriented.n_cut.max(aligned.n_cut)
            );
        }
    }
    Ok(())
}

fn build(model: &Model, config: &Config) -> Result<TriangleBvh> {
    Ok(TriangleBvh::build_with(&model.mesh.positions, &model.mesh.triangles, *config)?)
}

/// Rays of each kind: camera rays in squares, then rays from their hits.
fn sets(model: &Model, tree: &TriangleBvh, bench: &Bench) -> [Vec<Ray>; 3] {
    let camera = models::camera(model, bench.scale.resolution);
    let mut hits = vec![None; camera.len()];
    tree.par_closest_hits(&camera, &mut hits);
    let [diffuse, occlusion] = models::secondary(model, &camera, &hits);
    [in_squares(&camera, bench.scale.resolution as usize), diffuse, occlusion]
}

/// Rays of square pictures in scanline order, square by square.
fn in_squares(rays: &[Ray], side: usize) -> Vec<Ray> {
    let pixels = |square: usize| (0..SQUARE * SQUARE).map(move |i| (square, i / SQUARE, i % SQUARE));
    let n_across = side / SQUARE;
    let at = |(square, row, column): (usize, usize, usize)| {
        (square / n_across * SQUARE + row) * side + square % n_across * SQUARE + column
    };
    rays.chunks_exact(side * side)
        .flat_map(|picture| (0..n_across * n_across).flat_map(pixels).map(move |place| picture[at(place)]))
        .collect()
}

/// The time of casting rays.
struct Cast {
    milliseconds: f64,
    /// Rays that exact kernels traced.
    n_exact: usize,
    n_cut: usize,
}

impl Cast {
    /// Million rays a second.
    fn rate(&self, n_rays: usize) -> f64 {
        n_rays as f64 / (1e3 * self.milliseconds)
    }
}

/// Casts all rays several times; the minimum time counts.
fn cast(bench: &Bench, traced: &TracedScene, kind: Kind, rays: &[Ray]) -> Result<Cast, GpuError> {
    let gpu = &bench.gpu;
    let slices = rays
        .chunks(SLICE)
        .map(|slice| {
            let scaled: Vec<DeviceRay> =
                slice.iter().filter_map(ScaledRay::new).map(|ray| DeviceRay::scaled(&ray)).collect();
            gpu.buffer("rays", &scaled)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut least = Cast { milliseconds: f64::MAX, n_exact: 0, n_cut: 0 };
    for round in 0..=bench.rounds {
        let mut all = Cast { milliseconds: 0.0, n_exact: 0, n_cut: 0 };
        for slice in &slices {
            let slice = once(gpu, traced, kind, slice)?;
            all.milliseconds += slice.milliseconds;
            all.n_exact += slice.n_exact;
            all.n_cut += slice.n_cut;
        }
        if round > 0 && all.milliseconds < least.milliseconds {
            least = all;
        }
    }
    Ok(least)
}

/// Casts the rays of a slice.
fn once(gpu: &Gpu, traced: &TracedScene, kind: Kind, rays: &Buffer<DeviceRay>) -> Result<Cast, GpuError> {
    /// As in the kernels.
    const CUT: u32 = u32::MAX - 1;
    let mut commands = gpu.timed_commands();
    if kind == Kind::Occlusion {
        let found = gpu.zeroed::<u32>("found", rays.len())?;
        let undecided = traced.record_occluded(gpu, &mut commands, rays, &found)?;
        let (milliseconds, n_exact) = taken(gpu, commands, undecided.as_ref(), rays.len())?;
        let n_cut = gpu.read(&found)?.iter().filter(|&&found| found == CUT).count();
        return Ok(Cast { milliseconds, n_exact, n_cut });
    }
    let hits = gpu.zeroed::<DeviceHit>("hits", rays.len())?;
    let undecided = traced.record_closest_hits(gpu, &mut commands, rays, &hits)?;
    let (milliseconds, n_exact) = taken(gpu, commands, undecided.as_ref(), rays.len())?;
    let n_cut = gpu.read(&hits)?.iter().filter(|hit| hit.instance == CUT).count();
    Ok(Cast { milliseconds, n_exact, n_cut })
}

/// Milliseconds of all dispatches, and how many of `n_rays` exact kernels traced.
fn taken(
    gpu: &Gpu,
    commands: Commands<'_>,
    undecided: Option<&Buffer<u32>>,
    n_rays: usize,
) -> Result<(f64, usize), GpuError> {
    gpu.finish()?;
    let start = Instant::now();
    let times = commands.times()?;
    let on_wall = start.elapsed().as_secs_f64() * 1e3;
    let milliseconds = if gpu.has_timestamps() { times.iter().map(|pass| pass.milliseconds).sum() } else { on_wall };
    let n_exact = match undecided {
        None => n_rays,
        Some(undecided) => gpu.read(undecided)?[0] as usize,
    };
    Ok((milliseconds, n_exact))
}

/// A closed surface, thin diagonal parts, and a building.
const STRUCTURE_SCENES: [&str; 3] = ["bunny", "truss", "sponza"];

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
pub(super) fn structures(out: &mut String, bench: &Bench) -> Result<()> {
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
    for (number, name) in STRUCTURE_SCENES.into_iter().enumerate() {
        let n_rays = if bench.is_software() && number > 0 { FEW_RAYS } else { N_RAYS };
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let balanced = build(&model, &Config::preset(Preset::Balanced))?;
        let sets = sets(&model, &balanced, bench);
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
            let megabytes = traced.n_bytes() as f64 * 1e-6;
            let _ = write!(out, "| {name} | {structure} | {ready:.1} | {megabytes:.1} |");
            for (kind, set) in Kind::ALL.into_iter().zip(&sets) {
                let _ = write!(out, " {:.2} |", cast(bench, &traced, kind, set)?.rate(set.len()));
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
                let bvh = TriangleBvh::build_with(positions, triangles, Config::preset(preset))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_keep_every_ray() {
        let rays: Vec<Ray> = (0..2 * 16 * 16).map(|i| Ray::new([i as f32, 0.0, 0.0], [1.0; 3])).collect();
        let squared: Vec<f32> = in_squares(&rays, 16).iter().map(|ray| ray.origin[0]).collect();
        assert_eq!(squared[7..9], [7.0, 16.0]);
        assert_eq!(squared[64], 8.0);
        assert_eq!(squared[256], 256.0);
        let mut sorted = squared;
        sorted.sort_by(f32::total_cmp);
        assert!(sorted.iter().zip(&rays).all(|(x, ray)| *x == ray.origin[0]));
    }
}
