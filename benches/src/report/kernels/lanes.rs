//! Triangles eight at a time on every path: those of a case, and the same triangles for all paths and a device.

use anyhow::{Result, ensure};
use canted_fixtures::soup;
use canted_gpu::{SceneInput, TracedScene};
use canted_lbvh::Corners;
use canted_tests::rays::from_inside;
use canted_trace::{Hit, Ray, Watertight};
use canted_wide::{Config, Costs, SimdPath, TriangleBvh};

use super::super::effort::Effort;
use super::super::model::{Cell, Table};
use super::super::samples::Samples;
use super::accuracy::Answer;
use super::contest::Test;
use super::device::Device;
use super::triangles::Pair;
use crate::interleave::{self, Contender};

/// Triangles of a leaf: four blocks of eight, so that triangle tests dominate.
pub(super) const LEAF: usize = 32;

/// All triangles in one leaf: nodes are too expensive.
fn one_leaf() -> Config {
    let costs = Costs { aligned_node: 1e6, oriented_node: 1e6, max_leaf: LEAF, ..Costs::default() };
    Config { costs, rotate_mesh: false, ..Config::default() }
}

fn leaf(corners: &[Corners]) -> Result<TriangleBvh<Watertight>> {
    let triangles: Vec<[u32; 3]> = (0..).step_by(3).take(corners.len()).map(|i| [i, i + 1, i + 2]).collect();
    Ok(TriangleBvh::build(corners.as_flattened(), &triangles, &one_leaf())?)
}

/// A BVH for each triangle.
pub(super) fn singles(corners: &[Corners]) -> Result<Vec<TriangleBvh<Watertight>>> {
    corners.iter().map(|corners| leaf(std::slice::from_ref(corners))).collect()
}

/// The available and the missing paths of this machine.
pub(super) fn paths() -> (Vec<SimdPath>, Vec<SimdPath>) {
    SimdPath::ALL.into_iter().partition(|path| path.is_available())
}

/// Tests of a case on every path, which must agree bit for bit with the single test; times are of rays through leaves
/// of the case's triangles.
pub(super) fn tests(
    pairs: &[Pair],
    trees: &[TriangleBvh<Watertight>],
    singly: &[Answer],
) -> Result<Vec<Test<'static, Answer>>> {
    let (rays, corners): (Vec<Ray>, Vec<Corners>) = pairs.iter().copied().unzip();
    let leaves = corners.chunks(LEAF).map(leaf).collect::<Result<Vec<_>>>()?;
    let n_tests = leaves.iter().zip(rays.chunks(LEAF)).map(|(leaf, rays)| leaf.n_primitives() * rays.len()).sum();
    let test = |path: SimdPath| {
        let on_path = |tree: &TriangleBvh<Watertight>| tree.clone().with_path(path);
        let answer = |(tree, ray): (&TriangleBvh<Watertight>, &Ray)| {
            on_path(tree).closest_hit(ray).map(|Hit { t, u, v, .. }| [t, u, v])
        };
        let answers: Vec<Answer> = trees.iter().zip(&rays).map(answer).collect();
        ensure!(bits(&answers) == bits(singly), "{} differs from the single test", path.name());
        let leaves: Vec<TriangleBvh<Watertight>> = leaves.iter().map(on_path).collect();
        let rays = rays.clone();
        let work = move || {
            let mut hits: [Option<Hit>; LEAF] = [None; LEAF];
            for (leaf, rays) in leaves.iter().zip(rays.chunks(LEAF)) {
                leaf.closest_hits(rays, &mut hits[..rays.len()]);
                std::hint::black_box(&hits);
            }
        };
        Ok(Test { name: format!("{}, {LEAF} in a leaf", path.name()), answers, work: Box::new(work), n_tests })
    };
    paths().0.into_iter().map(test).collect()
}

fn bits(answers: &[Answer]) -> Vec<Option<[u32; 3]>> {
    answers.iter().map(|answer| answer.map(|tuv| tuv.map(f32::to_bits))).collect()
}

/// Times a ray on every available path, and on the device if there is one.
pub(super) fn measure(effort: Effort, rounds: usize, device: Option<&Device>) -> Result<Table> {
    let mesh = soup(32, u32::try_from(LEAF)?);
    let tree = TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &one_leaf())?;
    let rays: Vec<Ray> = from_inside(&mesh, effort.pick(500, 100_000, 100_000), 7);
    let (there, _) = paths();
    let trees: Vec<TriangleBvh<Watertight>> = there.iter().map(|&path| tree.clone().with_path(path)).collect();
    let hits = |tree: &TriangleBvh<Watertight>| {
        let mut hits: Vec<Option<Hit>> = vec![None; rays.len()];
        tree.closest_hits(&rays, &mut hits);
        hits
    };
    let scalar = hits(&trees[0]);
    ensure!(trees.iter().all(|tree| hits(tree) == scalar), "paths differ in a hit");
    let scene = device.map(|device| TracedScene::new(&device.gpu, SceneInput::upload([&tree]))).transpose()?;
    let mut contenders: Vec<Contender<'_>> = there
        .iter()
        .zip(&trees)
        .map(|(path, tree)| Contender::new(path.name(), || drop(std::hint::black_box(hits(tree)))))
        .collect();
    if let Some((scene, device)) = scene.as_ref().zip(device) {
        // Run once before the contest, which cannot return errors.
        scene.closest_hits(&device.gpu, &rays)?;
        let work = || drop(std::hint::black_box(scene.closest_hits(&device.gpu, &rays)));
        contenders.push(Contender::new(device.name(), work));
    }
    let title = format!("{LEAF} triangles in a leaf, closest hits of rays from inside, one thread or one device");
    let mut table = Table::new(title, &["path", "time per ray", "speed over scalar"]);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_with_different_answers_is_detected() {
        let corners = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
        let pairs = [1.0, 9.0].map(|x| (Ray::new([x, 1.0, 0.0], [0.0, 0.0, 1.0]), corners));
        let trees = singles(&[corners; 2]).unwrap();
        let of = |answers: [Answer; 2]| tests(&pairs, &trees, &answers);
        let right = of([Some([1.0, 0.25, 0.25]), None]).unwrap();
        assert_eq!((right.len(), right[0].n_tests), (paths().0.len(), 4));
        for wrong in [[Some([1.0f32.next_up(), 0.25, 0.25]), None], [None, None]] {
            assert!(of(wrong).is_err(), "{wrong:?}");
        }
    }
}
