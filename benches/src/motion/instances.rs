//! Ten thousand instances that all move: the top level alone.

use std::fmt::Write;

use anyhow::Result;
use canted_fixtures::{Mesh, SplitMix64, scaffold_of};
use canted_obb::Affine;
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{InstanceId, Watertight};
use canted_wide::{Config, Preset, TriangleBvh};

use super::{Updated, row, run};
use crate::options::Options;

const N_INSTANCES: u32 = 10_000;

/// Transforms of all instances at a frame: they leave the center of a cube.
#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "places of a benchmark")]
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
pub(super) fn table(out: &mut String, options: &Options) -> Result<()> {
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build()?;
    let _ = writeln!(
        out,
        "\n### {N_INSTANCES} moved instances\n\nEvery instance gets another transform, then the top level is updated; {n_threads} threads. Last column: wall and \
         processor time relative to the first row.\n\n| scene | update | ms | processor ms | relative |\n| --- | --- | --- | --- | --- |",
    );
    let mesh = scaffold_of(1, false, 3);
    let frames = [transforms(0), transforms(1)];
    let mut all = ours(&mesh, &frames)?;
    #[cfg(feature = "peers")]
    of_embree(&mesh, &frames, n_threads, &mut all)?;
    run(&mut all, options.rounds, &pool)?;
    let scene = format!("{N_INSTANCES} instances");
    all.iter().for_each(|one| row(out, &scene, one, all.first()));
    Ok(())
}

fn ours<'a>(mesh: &Mesh, frames: &'a [Vec<Affine>; 2]) -> Result<Vec<Updated<'a>>> {
    let instances = |frame: usize| frames[frame % 2].iter().map(|&at| Instance::new(0, at)).collect::<Vec<_>>();
    let tlas = || -> Result<_> {
        let bvh = TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::default())?;
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
fn of_embree<'a>(
    mesh: &'a Mesh,
    frames: &'a [Vec<Affine>; 2],
    n_threads: usize,
    all: &mut Vec<Updated<'a>>,
) -> Result<()> {
    use canted_peers::embree::{self, MovingInstances, Placement};

    let mesh = embree::Mesh { positions: &mesh.positions, triangles: &mesh.triangles };
    for library in embree::libraries().into_iter().take(1) {
        let placement = |at: &Affine| Placement { mesh: 0, world_from_object: at.columns };
        let placements: Vec<_> = frames[0].iter().map(placement).collect();
        let mut moving = MovingInstances::new(&library, &[mesh], &placements, n_threads)?;
        let matrices = [0, 1].map(|frame: usize| frames[frame].iter().map(|at| at.columns).collect::<Vec<_>>());
        let version = library.version();
        let name = format!("Embree {}.{} dynamic, low quality", version / 10_000, version / 100 % 100);
        all.push(Updated::new(name, move |frame| Ok(moving.update(&matrices[frame % 2])?)));
    }
    Ok(())
}
