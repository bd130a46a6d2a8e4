//! The same triangles eight at a time on every path, and on a device.

use anyhow::{Result, ensure};
use canted_fixtures::soup;
use canted_gpu::{Choice, Gpu, TracedScene};
use canted_tests::rays::from_inside;
use canted_trace::{Hit, Ray, Watertight};
use canted_wide::{Config, Costs, SimdPath, Wide};

use super::super::effort::Effort;
use super::super::model::{Cell, Table};
use super::super::samples::Samples;
use crate::interleave::{self, Contender};

/// Triangles of a leaf: four blocks of eight, so that little but triangles is tested.
const N_TRIANGLES: u32 = 32;

/// Times a ray of every path that this machine has, and of the device where there is one.
pub(super) fn measure(effort: Effort, rounds: usize, skipped: &mut Vec<String>) -> Result<Table> {
    let mesh = soup(32, N_TRIANGLES);
    // Nodes so dear that all triangles are one leaf.
    let costs =
        Costs { box_node: 1e6, shared_node: 1e6, lean_node: 1e6, max_leaf: N_TRIANGLES as usize, ..Costs::default() };
    let config = Config { costs, turn: false, ..Config::default() };
    let tree = Wide::<Watertight>::build(&mesh.positions, &mesh.triangles, &config)?;
    let rays: Vec<Ray> = from_inside(&mesh, effort.pick(500, 100_000, 100_000), 7);
    let (there, missing): (Vec<_>, Vec<_>) = SimdPath::ALL.into_iter().partition(|path| path.is_available());
    skipped.extend(missing.iter().map(|path| format!("the path {}, which this machine lacks", path.name())));
    let trees: Vec<Wide<Watertight>> = there.iter().map(|&path| tree.clone().with_path(path)).collect();
    let hits = |tree: &Wide<Watertight>| {
        let mut hits: Vec<Option<Hit>> = vec![None; rays.len()];
        tree.closest_hits(&rays, &mut hits);
        hits
    };
    let scalar = hits(&trees[0]);
    ensure!(trees.iter().all(|tree| hits(tree) == scalar), "paths differ in a hit");
    let device = match Gpu::open(&Choice::Best) {
        Ok(gpu) => Some((TracedScene::one(&gpu, &tree, &[0])?, gpu)),
        Err(error) => {
            skipped.push(format!("the device: {error}"));
            None
        }
    };
    let mut contenders: Vec<Contender<'_>> = there
        .iter()
        .zip(&trees)
        .map(|(path, tree)| Contender::new(path.name(), || drop(std::hint::black_box(hits(tree)))))
        .collect();
    if let Some((scene, gpu)) = &device {
        // Asked once before, for its errors; in the contest they cannot come back.
        scene.closest_hits(gpu, &rays)?;
        let name = format!("device: {}", gpu.facts().name);
        contenders.push(Contender::new(name, || drop(std::hint::black_box(scene.closest_hits(gpu, &rays)))));
    }
    let title =
        format!("{N_TRIANGLES} triangles in a leaf, closest hits of rays from inside, one thread or one device");
    let mut table = Table::new(title, &["path", "time a ray", "speed beside scalar"]);
    #[expect(clippy::cast_precision_loss, reason = "small counts")]
    let to_ns = 1e9 / rays.len() as f64;
    for timing in interleave::run(rounds, contenders) {
        table.rows.push(vec![
            Cell::text(&timing.name),
            Cell::measured(Samples::from(timing.seconds.clone()).scaled(to_ns), "ns"),
            Cell::measured(timing.speed_ratio, "times"),
        ]);
    }
    Ok(table)
}
