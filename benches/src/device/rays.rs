//! Rays on the device: through a WideBvh with oriented nodes and without, and from the mesh to the hits, through what the CPU
//! uploads and what the device builds itself.

use std::{fmt::Write, time::Instant};

use anyhow::Result;
use canted_fixtures::Mesh;
use canted_gpu::{
    Buffer, DeviceHit, DeviceRay, Gpu, GpuError, Options, RayList, Source, TracedScene, block_on,
    build::{BuildConfig, Topology, WideConfig},
};
use canted_lbvh::{self as lbvh, Bits, Strategy};
use canted_renderer::{Levels, SceneBvh, SceneBvhConfig, flatten, traced_scene};
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
        "\n### Rays\n\nPreset balanced with leaves for devices, with oriented nodes where they pay off, and with axis-aligned nodes only. {0} x {0} camera \
         rays of each of four views, in squares of {1} x {1}; one diffuse ray and one occlusion ray from each of their \
         hits. Million rays per second of device time, median (and fastest) of {2} runs; what f32 leaves undecided is traced again by exact \
         kernels, which is included. Exact: such kernels for all rays, oriented nodes. Leaves of the CPU: oriented nodes, \
         and leaves for eight triangles at once. The last columns: share of such rays with oriented nodes, in \
         percent, and the number of rays whose traversal the driver cut short.\n\n\
         | scene | rays | number | oriented | axis-aligned | ratio | exact | oriented over exact | leaves of the CPU | undecided | cut |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        bench.scale.resolution, SQUARE, bench.rounds
    );
    for name in SCENES {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let large = Config::preset(Preset::Balanced);
        let oriented = large.for_devices();
        let [oriented, aligned, large] =
            [build(&model, &oriented)?, build(&model, &oriented.axis_aligned())?, build(&model, &large)?];
        let sets = sets(&model, &oriented, bench, 0.0);
        let traced = [
            block_on(TracedScene::new(&bench.gpu, Source::wide(&oriented), Options::default()))?,
            block_on(TracedScene::new(&bench.gpu, Source::wide(&aligned), Options::default()))?,
            block_on(TracedScene::new(&bench.gpu, Source::wide(&oriented), Options::default()))?.with_exact_kernels(),
            block_on(TracedScene::new(&bench.gpu, Source::wide(&large), Options::default()))?,
        ];
        for (kind, rays) in Kind::ALL.into_iter().zip(sets) {
            let mut casts = vec![];
            for traced in &traced {
                casts.push(cast(bench, traced, kind, &rays)?);
            }
            let [oriented, aligned, exact, large] = &casts[..] else { unreachable!("a cast for each of the four") };
            let _ = writeln!(
                out,
                "| {name} | {} | {} | {} | {} | {:.2}x | {} | {:.2}x | {} | {:.2} | {} |",
                kind.name(),
                rays.len(),
                oriented.rates(rays.len()),
                aligned.rates(rays.len()),
                aligned.median() / oriented.median(),
                exact.rates(rays.len()),
                exact.median() / oriented.median(),
                large.rates(rays.len()),
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

/// Rays of each kind: camera rays in squares, then rays from their hits in the same order, which start `farther` from their surfaces than
/// usual, relative to the diagonal of the scene.
fn sets(model: &Model, tree: &TriangleBvh, bench: &Bench, farther: f64) -> [Vec<Ray>; 3] {
    let camera = in_squares(&models::camera(model, bench.scale.resolution), bench.scale.resolution as usize);
    let mut hits = vec![None; camera.len()];
    tree.par_closest_hits(&camera, &mut hits);
    let [diffuse, occlusion] = models::secondary_farther(model, &camera, &hits, farther);
    [camera, diffuse, occlusion]
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

/// The times of casting rays.
struct Cast {
    /// Milliseconds of each run, in increasing order.
    milliseconds: Vec<f64>,
    /// Rays that exact kernels traced.
    n_exact: usize,
    n_cut: usize,
}

impl Cast {
    fn median(&self) -> f64 {
        self.milliseconds[self.milliseconds.len() / 2]
    }

    /// Million rays a second, in the median run.
    fn rate(&self, n_rays: usize) -> f64 {
        n_rays as f64 / (1e3 * self.median())
    }

    /// The same, and in parentheses that of the fastest run.
    fn rates(&self, n_rays: usize) -> String {
        format!("{:.2} ({:.2})", self.rate(n_rays), n_rays as f64 / (1e3 * self.milliseconds[0]))
    }
}

/// Casts all rays several times.
fn cast(bench: &Bench, traced: &TracedScene, kind: Kind, rays: &[Ray]) -> Result<Cast> {
    let gpu = &bench.gpu;
    let slices = rays
        .chunks(SLICE)
        .map(|slice| {
            let scaled: Vec<DeviceRay> =
                slice.iter().filter_map(ScaledRay::new).map(|ray| DeviceRay::scaled(&ray)).collect();
            Ok(Slice {
                rays: gpu.buffer("rays", &scaled)?,
                hits: gpu.zeroed("hits", scaled.len())?,
                found: gpu.zeroed("found", scaled.len())?,
            })
        })
        .collect::<Result<Vec<_>, GpuError>>()?;
    bench.warm(|| Ok(slices.iter().try_for_each(|slice| slice.cast(gpu, traced, kind).map(drop))?))?;
    let mut all = Cast { milliseconds: vec![0.0; bench.rounds], n_exact: 0, n_cut: 0 };
    for slice in &slices {
        for milliseconds in &mut all.milliseconds {
            let (time, undecided) = slice.cast(gpu, traced, kind)?;
            *milliseconds += time;
            all.n_exact +=
                undecided.map_or(Ok(slice.rays.len()), |list| block_on(list.count(gpu)).map(|n| n as usize))?;
        }
        all.n_cut += slice.n_cut(gpu, kind)?;
    }
    all.n_exact /= bench.rounds;
    all.milliseconds.sort_by(f64::total_cmp);
    Ok(all)
}

/// Rays on the device, and room for their answers.
struct Slice {
    rays: Buffer<DeviceRay>,
    hits: Buffer<DeviceHit>,
    found: Buffer<u32>,
}

impl Slice {
    /// Casts the rays. Returns milliseconds of all dispatches, and the list of rays that exact kernels traced, or none where they traced all.
    fn cast(&self, gpu: &Gpu, traced: &TracedScene, kind: Kind) -> Result<(f64, Option<RayList>), GpuError> {
        let mut commands = gpu.timed_commands();
        let undecided = match kind {
            Kind::Occlusion => traced.record_occluded(gpu, &mut commands, &self.rays, &self.found)?,
            _ => traced.record_closest_hits(gpu, &mut commands, &self.rays, &self.hits)?,
        };
        let start = Instant::now();
        let times = block_on(commands.times())?;
        let on_wall = start.elapsed().as_secs_f64() * 1e3;
        let milliseconds =
            if gpu.has_timestamps() { times.iter().map(|pass| pass.milliseconds).sum() } else { on_wall };
        Ok((milliseconds, undecided))
    }

    /// Rays that the driver cut short.
    fn n_cut(&self, gpu: &Gpu, kind: Kind) -> Result<usize, GpuError> {
        /// As in the kernels.
        const CUT: u32 = u32::MAX - 1;
        Ok(match kind {
            Kind::Occlusion => block_on(gpu.read(&self.found))?.iter().filter(|&&found| found == CUT).count(),
            _ => block_on(gpu.read(&self.hits))?.iter().filter(|hit| hit.instance == CUT).count(),
        })
    }
}

/// Scenes of several meshes, and one with thousands of instances.
const LEVEL_SCENES: [&str; 3] = ["sponza", "country_kitchen", "built-in"];

/// How much farther from their surfaces than usual rays start, relative to the diagonal of the scene: then about as far as those of `render` and of
/// `origin_beside` in a program's kernel. Usual ones start within the error of an instance's transform.
const FARTHER: f64 = 2e-5;

/// Measures the same scenes in one level and in two, and writes the table.
pub(super) fn levels(out: &mut String, bench: &Bench) -> Result<()> {
    let _ = writeln!(
        out,
        "\n### Levels\n\nThe BVH that `render` uploads, in one level and in two. Rays and rates as in the table of rays, but rays from surfaces start \
         {FARTHER:e} of the diagonal farther away, as those of `render` do.\n\n\
         | scene | instances | rays | number | one level | two levels | two over one | two levels, exact | undecided, one, percent | two |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    for name in LEVEL_SCENES {
        let scene = if name == "built-in" { Some(canted_scene::builtin()) } else { models::scene(name)? };
        let Some(scene) = scene else {
            let _ = writeln!(out, "| {name} | not available |");
            continue;
        };
        let (positions, triangles, _) = flatten(&scene)?;
        let model = models::of_mesh(Mesh { positions, triangles });
        let sets = sets(&model, &build(&model, &Config::preset(Preset::Balanced))?, bench, FARTHER);
        let traced = [Levels::One, Levels::Two].map(|levels| {
            let bvh =
                SceneBvh::build(&scene, &SceneBvhConfig { levels, on_device: true, ..SceneBvhConfig::default() })?;
            Ok(traced_scene(&bench.gpu, &scene, &bvh)?)
        });
        let [one, two]: [Result<TracedScene>; 2] = traced;
        let (one, two) = (one?, two?);
        let mut casts = vec![];
        for (kind, rays) in Kind::ALL.into_iter().zip(&sets) {
            casts.push([cast(bench, &one, kind, rays)?, cast(bench, &two, kind, rays)?]);
        }
        let exact = two.with_exact_kernels();
        for ((kind, rays), [one, two]) in Kind::ALL.into_iter().zip(&sets).zip(casts) {
            let exact = cast(bench, &exact, kind, rays)?;
            let share = |cast: &Cast| 1e2 * cast.n_exact as f64 / rays.len().max(1) as f64;
            let _ = writeln!(
                out,
                "| {name} | {} | {} | {} | {} | {} | {:.2} | {} | {:.2} | {:.2} |",
                scene.instances.len(),
                kind.name(),
                rays.len(),
                one.rates(rays.len()),
                two.rates(rays.len()),
                one.median() / two.median(),
                exact.rates(rays.len()),
                share(&one),
                share(&two)
            );
        }
    }
    Ok(())
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
         million rays per second of device time, as in the table of rays. Whole: ready, uploading camera and diffuse rays, tracing \
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
        let sets = sets(&model, &balanced, bench, 0.0);
        let some: Vec<Ray> = sets[0].iter().chain(&sets[1]).copied().cycle().take(n_rays).collect();
        for (structure, made) in &STRUCTURES {
            let (mut ready, mut with_rays) = (f64::MAX, f64::MAX);
            for round in 0..=bench.rounds {
                let start = Instant::now();
                let traced = made.traced(&bench.gpu, &model)?;
                block_on(bench.gpu.finish())?;
                let built = start.elapsed().as_secs_f64() * 1e3;
                block_on(traced.closest_hits(&bench.gpu, &some))?;
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
                let bvh = TriangleBvh::build_with(positions, triangles, Config::preset(preset).for_devices())?;
                Ok(block_on(TracedScene::new(gpu, Source::wide(&bvh), Options::default()))?)
            }
            Self::Binary(strategy) => {
                let config = BuildConfig { bits: Bits::B63, strategy };
                of_device(&|corners| {
                    block_on(TracedScene::new(gpu, Source::build([corners], config), Options::default()))
                })
            }
            Self::Wide(bits, topology, strategy) => {
                let config = WideConfig { bits, topology, strategy };
                of_device(&|corners| {
                    block_on(TracedScene::new(gpu, Source::build([corners], config), Options::default()))
                })
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
