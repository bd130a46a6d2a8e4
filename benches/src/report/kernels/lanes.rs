//! Eight triangles or boxes at a time on every path: those of a case, and the same ones for all paths and a device; rays that pass
//! oriented boxes at a distance.

use std::ops::ControlFlow;

use anyhow::{Result, ensure};
use canted_fixtures::{SplitMix64, soup};
use canted_gpu::{Options, Source, TracedScene, block_on};
use canted_lbvh::Corners;
use canted_obb::{Aabb, Obb};
use canted_tests::{
    clouds::random_rotation,
    extremes::slab::{self, Pair},
    rays::from_inside,
};
use canted_trace::{Hit, Intersect, Ray};
use canted_wide::{Config, Costs, SimdPath, TriangleBvh, WideBvh};

use crate::{
    report::{
        kernels::{Answer, Device, LANES, Pair as TrianglePair, Test},
        model::{Cell, Effort, Table},
        samples::Samples,
    },
    timing::{self, Contender},
};

/// Triangles of a leaf: four blocks of eight, so that triangle tests dominate.
pub(super) const LEAF: usize = 32;

/// All triangles in one leaf: nodes are too expensive.
fn one_leaf() -> Config {
    let costs = Costs { aligned_node: 1e6, oriented_node: 1e6, max_leaf: LEAF, ..Costs::default() };
    Config { costs, rotate_mesh: false, ..Config::default() }
}

/// A BVH of one leaf.
pub(super) fn leaf(corners: &[Corners]) -> Result<TriangleBvh> {
    let triangles: Vec<[u32; 3]> = (0..).step_by(3).take(corners.len()).map(|i| [i, i + 1, i + 2]).collect();
    Ok(TriangleBvh::build_with(corners.as_flattened(), &triangles, one_leaf())?)
}

/// A BVH for each triangle.
pub(super) fn singles(corners: &[Corners]) -> Result<Vec<TriangleBvh>> {
    corners.iter().map(|corners| leaf(std::slice::from_ref(corners))).collect()
}

/// The available and the missing paths of this machine.
pub(super) fn paths() -> (Vec<SimdPath>, Vec<SimdPath>) {
    SimdPath::ALL.into_iter().partition(|path| path.is_available())
}

/// Tests of a case on every path, which must agree bit for bit with the single test; times are of rays through leaves
/// of the case's triangles.
pub(super) fn tests(
    pairs: &[TrianglePair],
    trees: &[TriangleBvh],
    singly: &[Answer],
) -> Result<Vec<Test<'static, Answer>>> {
    let (rays, corners): (Vec<Ray>, Vec<Corners>) = pairs.iter().copied().unzip();
    let leaves = corners.chunks(LEAF).map(leaf).collect::<Result<Vec<_>>>()?;
    let n_tests = leaves.iter().zip(rays.chunks(LEAF)).map(|(leaf, rays)| leaf.n_primitives() * rays.len()).sum();
    let test = |path: SimdPath| {
        let on_path = |tree: &TriangleBvh| tree.clone().with_path(path);
        let answer =
            |(tree, ray): (&TriangleBvh, &Ray)| on_path(tree).closest_hit(ray).map(|Hit { t, u, v, .. }| [t, u, v]);
        let answers: Vec<Answer> = trees.iter().zip(&rays).map(answer).collect();
        ensure!(bits(&answers) == bits(singly), "{} differs from the single test", path.name());
        let leaves: Vec<TriangleBvh> = leaves.iter().map(on_path).collect();
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
    let tree = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, one_leaf())?;
    let rays: Vec<Ray> = from_inside(&mesh, effort.pick(500, 100_000, 100_000), 7);
    let (there, _) = paths();
    let trees: Vec<TriangleBvh> = there.iter().map(|&path| tree.clone().with_path(path)).collect();
    let hits = |tree: &TriangleBvh| {
        let mut hits: Vec<Option<Hit>> = vec![None; rays.len()];
        tree.closest_hits(&rays, &mut hits);
        hits
    };
    let scalar = hits(&trees[0]);
    ensure!(trees.iter().all(|tree| hits(tree) == scalar), "paths differ in a hit");
    let scene = device
        .map(|device| block_on(TracedScene::new(&device.gpu, Source::wide(&tree), Options::default())))
        .transpose()?;
    let mut contenders: Vec<Contender<'_>> = there
        .iter()
        .zip(&trees)
        .map(|(path, tree)| Contender::new(path.name(), || drop(std::hint::black_box(hits(tree)))))
        .collect();
    if let Some((scene, device)) = scene.as_ref().zip(device) {
        // Run once before the contest, which cannot return errors.
        block_on(scene.closest_hits(&device.gpu, &rays))?;
        let work = || drop(std::hint::black_box(scene.closest_hits(&device.gpu, &rays)));
        contenders.push(Contender::new(device.name(), work));
    }
    let title = format!("{LEAF} triangles in a leaf, closest hits of rays from inside, one thread or one device");
    let mut table = Table::new(title, &["path", "time per ray", "speed over scalar"]);
    let to_ns = 1e9 / rays.len() as f64;
    for timing in timing::run(rounds, contenders) {
        table.rows.push(vec![
            Cell::text(&timing.name),
            Cell::measured(Samples::from(timing.seconds.clone()).scaled(to_ns), "ns"),
            Cell::measured(timing.speed_ratio, "times"),
        ]);
    }
    Ok(table)
}

/// A node, and the pairs whose rays test it.
struct Node<'a> {
    tree: WideBvh<Aabb>,
    /// Its boxes are those of the pairs from this index on.
    first: usize,
    pairs: &'a [Pair],
}

impl Node<'_> {
    /// Calls `see` with the pairs whose boxes each ray enters, ray by ray.
    fn enter(&self, mut see: impl FnMut(usize, usize)) {
        for (i, (ray, _)) in self.pairs.iter().enumerate() {
            self.tree.traverse(ray, |number, t_max| {
                see(i, self.first + number.index());
                ControlFlow::Continue(t_max)
            });
        }
    }
}

/// Nodes of eight boxes each; the last two nodes may overlap.
fn nodes<'a>(pairs: &'a [Pair], path: SimdPath) -> Result<Vec<(usize, Node<'a>)>> {
    let boxes: Vec<Aabb> = pairs.iter().map(|(_, obb)| obb.aabb()).collect();
    let last = boxes.len().saturating_sub(LANES);
    let node = |(i, own): (usize, &'a [Pair])| {
        let start = i * LANES;
        let first = start.min(last);
        let tree = WideBvh::<Aabb>::over(boxes[first..boxes.len().min(first + LANES)].to_vec())?;
        Ok((start, Node { tree: tree.with_path(path), first, pairs: own }))
    };
    pairs.chunks(LANES).enumerate().map(node).collect()
}

/// Tests of a case on every path: whether each ray enters its own box among eight. The entry distance is not reported.
pub(super) fn node_tests(pairs: &[Pair]) -> Result<Vec<Test<'_, Option<f32>>>> {
    let test = |path: SimdPath| {
        let nodes = nodes(pairs, path)?;
        let mut answers = vec![None; pairs.len()];
        for (start, node) in &nodes {
            node.enter(|i, entered| {
                if start + i == entered {
                    answers[entered] = Some(f32::NAN);
                }
            });
        }
        let n_tests = LANES * pairs.len();
        let work = move || {
            let mut n_entered = 0u32;
            nodes.iter().for_each(|(_, node)| node.enter(|_, _| n_entered += 1));
            std::hint::black_box(n_entered);
        };
        Ok(Test {
            name: format!("its axis-aligned box, {}, of {LANES}", path.name()),
            answers,
            work: Box::new(work),
            n_tests,
        })
    };
    paths().0.into_iter().map(test).collect()
}

/// Each box eight times in a BVH of one node, as bounds of triangles, because devices only hold triangle BVHs.
pub(super) fn of_equal(boxes: &[Aabb]) -> Result<Vec<TriangleBvh>> {
    let costs = Costs { leaf: 0.0, max_leaf: 1, ..Costs::default() };
    let config = Config { costs, oriented: false, rotate_mesh: false, ..Config::default() };
    let of_one = |&Aabb { min, max }: &Aabb| {
        Ok(TriangleBvh::build_with(&[min, max, [min[0], max[1], min[2]]], &[[0, 1, 2]; LANES], config)?)
    };
    boxes.iter().map(of_one).collect()
}

/// Distances relative to the size of the box, and their names.
pub(super) const SHARES: [(f64, &str); 3] = [
    (1e-6, "passes an oriented box at 1e-6 of its size"),
    (1e-3, "passes it at 1e-3 of its size"),
    (1.0, "passes it at its size"),
];

/// Distance of the origin, relative to the size of the box.
const AWAY: f64 = 2.0;

/// `n` rays that pass oriented boxes at `share` of their greatest edge, up to the rounding of origin and direction.
pub(super) fn pairs(share: f64, n: usize) -> Vec<slab::Pair> {
    let mut rng = SplitMix64::new(72);
    (0..n).map(|_| pair(&mut rng, share)).collect()
}

fn pair(rng: &mut SplitMix64, share: f64) -> slab::Pair {
    let [center, half] = [0; 2].map(|_: u8| rng.signed3());
    let obb = Obb {
        center: center.map(|x| x as f32),
        frame: random_rotation(rng).frame(),
        half_extents: half.map(|x| x.abs() as f32),
    };
    let size = 2.0 * obb.half_extents.into_iter().fold(0.0, |most: f64, half| most.max(f64::from(half)));
    // A corner, or a point of an edge or a face: `place` is in half-extents, at least one of them ±1.
    let mut place: [f64; 3] = std::array::from_fn(|_| [-1.0, 1.0, rng.signed()][rng.below(3)]);
    place[rng.below(3)] = [-1.0, 1.0][rng.below(2)];
    let axis = |k: usize| obb.frame[k].map(f64::from);
    let sum =
        |of: &dyn Fn(usize) -> f64| -> [f64; 3] { std::array::from_fn(|i| (0..3).map(|k| of(k) * axis(k)[i]).sum()) };
    let point = sum(&|k| place[k] * f64::from(obb.half_extents[k]));
    // The box lies behind any plane through the point whose normal points outward along every axis that ends there.
    let weights: [f64; 3] = std::array::from_fn(|_| rng.unit());
    let outward = |k: usize| if place[k].abs() == 1.0 { place[k] * (0.1 + weights[k]) } else { 0.0 };
    let normal = unit(sum(&outward));
    let any = rng.on_sphere();
    let along = any.iter().zip(normal).map(|(a, b)| a * b).sum::<f64>();
    let direction = unit(std::array::from_fn(|i| any[i] - along * normal[i]));
    let origin = std::array::from_fn(|i| {
        (f64::from(obb.center[i]) + point[i] + size * (share * normal[i] - AWAY * direction[i])) as f32
    });
    (Ray::new(origin, direction.map(|x| x as f32)), obb)
}

fn unit(x: [f64; 3]) -> [f64; 3] {
    let length = x.iter().map(|x| x * x).sum::<f64>().sqrt();
    x.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use canted_tests::exact::intersects_box;

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

    /// Eleven boxes one unit apart, so that the last three share a node with five others; every third ray misses its
    /// box.
    fn case() -> Vec<Pair> {
        let pair = |i: u8| {
            let center = [2.0 * f32::from(i), 0.0, 0.0];
            let x = center[0] + if i.is_multiple_of(3) { 0.9 } else { 0.1 };
            let obb = Obb { center, frame: Obb::IDENTITY_FRAME, half_extents: [0.5; 3] };
            (Ray::new([x, 0.0, -3.0], [0.0, 0.0, 1.0]), obb)
        };
        (0..11).map(pair).collect()
    }

    #[test]
    fn each_ray_tests_its_own_box_on_every_path() {
        let pairs = case();
        let found = node_tests(&pairs).unwrap();
        assert_eq!(found.len(), paths().0.len());
        for test in found {
            let entered: Vec<bool> = test.answers.iter().map(Option::is_some).collect();
            let wanted: Vec<bool> = (0..11usize).map(|i| !i.is_multiple_of(3)).collect();
            assert_eq!(entered, wanted, "{}", test.name);
            assert_eq!(test.n_tests, 88);
            (test.work)();
        }
    }

    #[test]
    fn equal_boxes_form_one_node() {
        let aabb = Aabb { min: [1.0, 2.0, 3.0], max: [4.0, 5.0, 3.0] };
        let tree = of_equal(&[aabb]).unwrap().remove(0);
        assert_eq!((tree.sizes().nodes, tree.aabb(), tree.n_primitives()), ([1, 0], aabb, LANES));
    }

    #[test]
    fn rays_pass_at_the_stated_distance() {
        for (share, what) in SHARES {
            let pairs = pairs(share, 60);
            let n_hit = pairs.iter().filter(|(ray, obb)| intersects_box(ray, obb)).count();
            // Rounding moves a distant origin by a few 1e-7 of the size.
            assert!(n_hit <= if share < 1e-5 { 12 } else { 0 }, "{what}: {n_hit}");
            // A box enlarged by a third of the distance is still missed, one enlarged by twice the distance is hit.
            let grown = |obb: &Obb, by: f64| {
                let size = 2.0 * obb.half_extents.into_iter().fold(0.0, f32::max);
                let by = (by * share) as f32 * size;
                Obb { half_extents: obb.half_extents.map(|half| half + by), ..*obb }
            };
            let n_of = |by: f64| pairs.iter().filter(|(ray, obb)| intersects_box(ray, &grown(obb, by))).count();
            assert!(share < 1e-5 || n_of(0.33) == 0, "{what}");
            assert!(n_of(2.0) == pairs.len(), "{what}: {} of {}", n_of(2.0), pairs.len());
        }
    }
}
