//! Geometry that changes every frame: refits, rebuilds and moved instances, compared with peers in turn.
//!
//! ```text
//! mesh, its vertices at two times -> BVHs -> refit or rebuild, all in turn -> tables
//! ```

mod sequences;

use std::{fmt::Write, hint::black_box, time::Duration};

use anyhow::Result;
use canted_bih::Bih;
use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{Mesh, SplitMix64, grid, grid_cells, scaffold_nodes, scaffold_of};
use canted_kdtree::KdTree;
use canted_obb::Affine;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::InstanceId;
use canted_wide::{Config, Preset, TriangleBvh};
use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2_from_tris};

use crate::{
    models::{self, Model},
    options::Options,
    timing::{self, Seconds, median, spread},
    wide::peers as theirs,
};

/// Something that is updated for every frame.
struct Updated<'a> {
    name: String,
    /// Updates for the frame of this number.
    update: Box<dyn FnMut(usize) -> Result<()> + Send + 'a>,
    took: Vec<Seconds>,
}

impl<'a> Updated<'a> {
    fn new(name: impl Into<String>, update: impl FnMut(usize) -> Result<()> + Send + 'a) -> Self {
        Self { name: name.into(), update: Box::new(update), took: vec![] }
    }
}

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let _ = writeln!(
        out,
        "\n## Motion\n\nGeometry moves every frame; everything is updated in turn, {} frames after a warm-up. Milliseconds: median wall time \
         (half spread), and processor time of all threads, which other processes do not affect.",
        options.rounds
    );
    refits(out, options)?;
    builds(out, options)?;
    instances(out, options)?;
    sequences::policies(out, options)?;
    sequences::pictures(out, options)
}

/// Updates all for each frame, in turn; the first frame warms up.
fn run(all: &mut [Updated<'_>], rounds: usize, pool: &rayon::ThreadPool) -> Result<()> {
    for frame in 0..=rounds {
        for one in &mut *all {
            // Threads of peers are outside of the pool.
            let (done, took) = timing::time_all(|| pool.install(|| (one.update)(frame)));
            done?;
            if frame > 0 {
                one.took.push(took);
            }
        }
    }
    Ok(())
}

/// A row: the name, times, and how many times as long as `reference` it takes in processor time and wall time.
fn row(out: &mut String, scene: &str, one: &Updated<'_>, reference: Option<&Updated<'_>>) {
    let of = |seconds: fn(&Seconds) -> f64, one: &Updated<'_>| one.took.iter().map(seconds).collect::<Vec<f64>>();
    let (wall, cpu) = (of(|s| 1e3 * s.wall, one), of(|s| 1e3 * s.cpu, one));
    let relative = reference.map_or_else(String::new, |reference| {
        let [of_wall, of_cpu] = [(|s: &Seconds| 1e3 * s.wall) as fn(&Seconds) -> f64, |s| 1e3 * s.cpu]
            .map(|seconds| median(&of(seconds, one)) / median(&of(seconds, reference)));
        format!("{of_wall:.2} / {of_cpu:.2}")
    });
    let _ = writeln!(
        out,
        "| {scene} | {} | {:.2} (±{:.0} %) | {:.2} | {relative} |",
        one.name,
        median(&wall),
        100.0 * spread(&wall),
        median(&cpu)
    );
}

/// Logarithm of the number of triangles.
const LOG2: u32 = 20;

/// A mesh of at most two to this power triangles.
type MeshOfSize = fn(u32) -> Mesh;

/// The scenes that exist in every size, given the logarithm of the maximum number of triangles.
const DEFORMING: [(&str, MeshOfSize); 2] =
    [("scaffold", |log2| scaffold_of(1, false, scaffold_nodes(log2))), ("grid", |log2| grid(5, grid_cells(log2)))];

const PRESETS: [(&str, Preset); 3] =
    [("dynamic", Preset::Dynamic), ("fast", Preset::Fast), ("balanced", Preset::Balanced)];

/// The frames of a mesh: twisted about its z axis to and fro.
struct Frames {
    mesh: Mesh,
    twisted: [Vec<[f32; 3]>; 2],
}

impl Frames {
    fn of(mesh: Mesh) -> Self {
        let [least, greatest] =
            mesh.positions.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], p| [a.min(p[2]), b.max(p[2])]);
        let height = (greatest - least).max(f32::MIN_POSITIVE);
        let twist = |degrees: f32| {
            let turned = |&[x, y, z]: &[f32; 3]| {
                let (sin, cos) = (degrees.to_radians() * (z - least) / height).sin_cos();
                [cos * x - sin * y, sin * x + cos * y, z]
            };
            mesh.positions.iter().map(turned).collect()
        };
        Self { twisted: [twist(5.0), twist(10.0)], mesh }
    }

    fn positions(&self, frame: usize) -> &[[f32; 3]] {
        &self.twisted[frame % 2]
    }

    /// The mesh at a frame.
    fn at(&self, frame: usize) -> Mesh {
        Mesh { positions: self.positions(frame).to_vec(), triangles: self.mesh.triangles.clone() }
    }
}

/// Measures and writes the table.
pub(super) fn refits(out: &mut String, options: &Options) -> Result<()> {
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build()?;
    let _ = writeln!(
        out,
        "\n### Refit and rebuild of a deforming mesh\n\nMeshes twisted by 5 and by 10 degrees in turn; {n_threads} threads. Last column: wall and \
         processor time relative to WideBvh's refit, preset fast.\n\n| scene | update | ms | processor ms | relative |\n| --- | --- | --- | --- | --- |",
    );
    for (name, generate) in DEFORMING {
        let mesh = generate(if options.is_quick { LOG2 - 4 } else { LOG2 });
        let scene = format!("{name}, {} triangles", mesh.triangles.len());
        let frames = Frames::of(mesh);
        let mut all = refitted(&frames)?;
        all.push(of_obvhs(&frames));
        #[cfg(feature = "peers")]
        refitted_by_embree(&frames, n_threads, &mut all)?;
        run(&mut all, options.rounds, &pool)?;
        let reference = all.iter().position(|one| one.name == "WideBvh fast, refit").map(|i| &all[i]);
        all.iter().for_each(|one| row(out, &scene, one, reference));
    }
    Ok(())
}

fn refitted(frames: &Frames) -> Result<Vec<Updated<'_>>> {
    let triangles = &frames.mesh.triangles[..];
    let mut all = vec![];
    for (name, preset) in PRESETS {
        let config = Config::preset(preset);
        let mut bvh = TriangleBvh::build_with(&frames.mesh.positions, triangles, config)?;
        all.push(Updated::new(format!("WideBvh {name}, refit"), move |frame| {
            bvh.refit(frames.positions(frame), triangles)?;
            Ok(())
        }));
    }
    for (name, preset) in &PRESETS[..2] {
        let config = Config::preset(*preset);
        all.push(Updated::new(format!("WideBvh {name}, rebuild"), move |frame| {
            TriangleBvh::build_with(frames.positions(frame), triangles, config)?;
            Ok(())
        }));
    }
    all.push(Updated::new("BIH, rebuild", move |frame| {
        Bih::build(frames.positions(frame), triangles, &canted_bih::BihConfig::default())?;
        Ok(())
    }));
    Ok(all)
}

/// Their refit, with new boxes of the leaves as their example sets them; their triangles are new, too.
fn of_obvhs(frames: &Frames) -> Updated<'_> {
    let all = theirs::triangles(&frames.mesh);
    let mut bvh = build_bvh2_from_tris(&all, BvhBuildParams::fastest_build(), &mut Duration::default());
    let at = [0, 1].map(|frame| theirs::triangles(&frames.at(frame)));
    Updated::new("obvhs BVH2 fastest, refit", move |frame| {
        let triangles = &at[frame % 2];
        for i in 0..bvh.nodes.len() {
            let node = bvh.nodes[i];
            if node.is_leaf() {
                let first = node.first_index as usize;
                let of_leaf = &bvh.primitive_indices[first..first + node.prim_count as usize];
                let aabb =
                    of_leaf.iter().fold(obvhs::aabb::Aabb::INVALID, |all, &i| all.union(&triangles[i as usize].aabb()));
                bvh.nodes[i].set_aabb(aabb);
            }
        }
        bvh.refit_all();
        Ok(())
    })
}

#[cfg(feature = "peers")]
fn refitted_by_embree<'a>(frames: &'a Frames, n_threads: usize, all: &mut Vec<Updated<'a>>) -> Result<()> {
    use canted_peers::embree::{self, MovingMesh, Update};

    let mesh = embree::Mesh { positions: &frames.mesh.positions, triangles: &frames.mesh.triangles };
    for library in embree::libraries().into_iter().take(1) {
        let version = library.version();
        for (name, update) in [("refit", Update::Refit), ("rebuild, low quality", Update::Rebuild)] {
            let mut moving = MovingMesh::new(&library, &mesh, n_threads, update)?;
            let name = format!("Embree {}.{} dynamic, {name}", version / 10_000, version / 100 % 100);
            all.push(Updated::new(name, move |frame| Ok(moving.update(frames.positions(frame))?)));
        }
    }
    Ok(())
}

const BUILT: [&str; 3] = ["scaffold", "bunny", "grid"];

/// Measures and writes the table.
pub(super) fn builds(out: &mut String, options: &Options) -> Result<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let _ = writeln!(
        out,
        "\n### Builds of structures for one frame\n\nOne thread, from indexed triangles; `obvhs` starts from ready triangles. Last column: wall and processor time \
         relative to the BIH.\n\n| scene | structure | ms | processor ms | relative |\n| --- | --- | --- | --- | --- |",
    );
    for name in BUILT {
        let Some(model) = models::load(name)? else {
            let _ = writeln!(out, "| {name} | not available | | | |");
            continue;
        };
        let mut all = structures(&model);
        run(&mut all, options.rounds, &pool)?;
        let scene = format!("{name}, {} triangles", model.mesh.triangles.len());
        all.iter().for_each(|one| row(out, &scene, one, all.first()));
    }
    Ok(())
}

fn structures(model: &Model) -> Vec<Updated<'_>> {
    let (positions, triangles) = (&model.mesh.positions[..], &model.mesh.triangles[..]);
    let their_triangles = theirs::triangles(&model.mesh);
    let wide = |preset| {
        let config = Config::preset(preset);
        move |_| {
            black_box(TriangleBvh::build_with(positions, triangles, config)?);
            Ok(())
        }
    };
    vec![
        Updated::new("BIH", move |_| {
            black_box(Bih::build(positions, triangles, &canted_bih::BihConfig::default())?);
            Ok(())
        }),
        Updated::new("SAH kd-tree", move |_| {
            black_box(KdTree::build(positions, triangles, &canted_kdtree::KdTreeConfig::default())?);
            Ok(())
        }),
        Updated::new("obvhs BVH2 fastest", move |_| {
            let params = BvhBuildParams::fastest_build();
            black_box(build_bvh2_from_tris(&their_triangles, params, &mut Duration::default()));
            Ok(())
        }),
        Updated::new("Bvh2, radix tree", move |_| {
            black_box(Bvh2::build(positions, triangles, &Bvh2Config::default())?);
            Ok(())
        }),
        Updated::new("WideBvh dynamic", wide(Preset::Dynamic)),
        Updated::new("WideBvh fast", wide(Preset::Fast)),
    ]
}

const N_INSTANCES: u32 = 10_000;

/// Transforms of all instances at a frame: they leave the center of a cube.
fn transforms(frame: usize) -> Vec<Affine> {
    let mut rng = SplitMix64::new(1);
    let spread = 100.0 * (1.0 + 0.1 * (frame % 2) as f64);
    let place = |_| {
        let [x, y, z] = std::array::from_fn(|_| (spread * rng.signed()) as f32);
        let (sin, cos) = (rng.signed() as f32 + frame as f32).sin_cos();
        Affine { columns: [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0], [x, y, z]] }
    };
    (0..N_INSTANCES).map(place).collect()
}

/// Measures and writes the table.
pub(super) fn instances(out: &mut String, options: &Options) -> Result<()> {
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build()?;
    let _ = writeln!(
        out,
        "\n### {N_INSTANCES} moved instances\n\nEvery instance gets another transform, then the top level is updated; {n_threads} threads. Last column: wall and \
         processor time relative to the first row.\n\n| scene | update | ms | processor ms | relative |\n| --- | --- | --- | --- | --- |",
    );
    let mesh = scaffold_of(1, false, 3);
    let frames = [transforms(0), transforms(1)];
    let mut all = placed(&mesh, &frames)?;
    #[cfg(feature = "peers")]
    placed_by_embree(&mesh, &frames, n_threads, &mut all)?;
    run(&mut all, options.rounds, &pool)?;
    let scene = format!("{N_INSTANCES} instances");
    all.iter().for_each(|one| row(out, &scene, one, all.first()));
    Ok(())
}

fn placed<'a>(mesh: &Mesh, frames: &'a [Vec<Affine>; 2]) -> Result<Vec<Updated<'a>>> {
    let instances = |frame: usize| frames[frame % 2].iter().map(|&at| Instance::new(0, at)).collect::<Vec<_>>();
    let tlas = || -> Result<_> {
        let bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, Config::default())?;
        Ok(Tlas::new(vec![bvh], &instances(0), TopConfig::Wide(Config::preset(Preset::Fast)))?)
    };
    let [mut refitted, mut rebuilt] = [tlas()?, tlas()?];
    Ok(vec![
        Updated::new("Tlas, refit", move |frame| {
            let moved: Vec<_> = (0u32..).map(InstanceId).zip(instances(frame)).collect();
            Ok(refitted.edit().set_each(&moved)?)
        }),
        Updated::new("Tlas, rebuild, fast", move |frame| Ok(rebuilt.set_instances(&instances(frame))?)),
    ])
}

#[cfg(feature = "peers")]
fn placed_by_embree<'a>(
    mesh: &'a Mesh,
    frames: &'a [Vec<Affine>; 2],
    n_threads: usize,
    all: &mut Vec<Updated<'a>>,
) -> Result<()> {
    use canted_peers::embree::{self, MovingInstances, Placement, Quality};

    let mesh = embree::Mesh { positions: &mesh.positions, triangles: &mesh.triangles };
    for library in embree::libraries().into_iter().take(1) {
        let placement = |at: &Affine| Placement { mesh: 0, world_from_object: at.columns };
        let placements: Vec<_> = frames[0].iter().map(placement).collect();
        let mut moving = MovingInstances::new(&library, &[mesh], &placements, (n_threads, Quality::Low))?;
        let matrices = [0, 1].map(|frame: usize| frames[frame].iter().map(|at| at.columns).collect::<Vec<_>>());
        let version = library.version();
        let name = format!("Embree {}.{} dynamic, low quality", version / 10_000, version / 100 % 100);
        all.push(Updated::new(name, move |frame| Ok(moving.update((0..).zip(&matrices[frame % 2]))?)));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_move_what_is_above_the_bottom() {
        let frames = Frames::of(canted_fixtures::scaffold_of(1, false, 3));
        let moved = frames.positions(0).iter().zip(frames.positions(1)).filter(|(a, b)| a != b).count();
        assert!(moved > frames.mesh.positions.len() / 2, "{moved}");
        assert_eq!(frames.positions(0), frames.positions(2));
    }
}
