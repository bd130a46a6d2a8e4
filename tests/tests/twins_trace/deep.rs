//! BVHs at the greatest depth that devices trace, and one level deeper.

use canted_fixtures::Mesh;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{Gpu, GpuError, Options, Outcome, Source, TracedScene, block_on};
use canted_lbvh::triangle_corners;
use canted_obb::Affine;
use canted_tests::scenes::chain;
use canted_tlas::Instance;
use canted_trace::{Ray, TriangleTest};
use canted_wide::{NodeKind, TriangleBvh};

use super::gpu;
use super::setup::{build, loop_over_all, of_one_kind};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(hits_are_found_up_to_the_greatest_depth),
        needs_device(bvhs_too_deep_are_rejected),
        needs_device(the_comparison_detects_a_lost_hit_in_a_deep_bvh),
    ]
}

/// Sectors of the unit square around its corner: a triangle fills most of one, and its box covers those below too.
const SECTORS: u16 = 16;

/// Sectors with few triangles: the first has none, the others one each, spread over the chain. Rays through them enter the boxes of
/// all triangles of the sectors above, so the stack holds children of every level.
const RARE: u16 = 8;

/// Half of a triangle's and of a ray's share of a sector, so that no ray comes near an edge and rounding does not matter.
const FILLED: f32 = 0.4;
const AIMED: f32 = 0.2;

/// Children of a node.
const WIDTH: u16 = 8;

/// The slope of a line from the corner: `across` is -1/2 to 1/2 within its sector.
fn slope(sector: u16, across: f32) -> f32 {
    (f32::from(sector) + 0.5 + across) / f32::from(SECTORS)
}

/// Number of triangles in a BVH of this depth: each node holds seven and the next node, the last one eight.
fn n_triangles(depth: u16) -> u16 {
    (WIDTH - 1) * depth + 1
}

/// Triangles across x, one behind another from 0 to 1, and their BVH of this depth.
fn deep(depth: u16) -> (Mesh, TriangleBvh) {
    let n = n_triangles(depth);
    let sector = |i: u16| {
        let rare = (1..RARE).find(|&rare| i == (rare - 1) * (n - 1) / (RARE - 2));
        rare.unwrap_or(RARE + i % (SECTORS - RARE))
    };
    let corners = |i: u16| {
        let x = f32::from(i) / f32::from(n);
        [[x, 0.0, 0.0], [x, 1.0, slope(sector(i), -FILLED)], [x, 1.0, slope(sector(i), FILLED)]]
    };
    let positions = (0..n).flat_map(corners).collect();
    let mesh = Mesh { positions, triangles: (0..u32::from(n)).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect() };
    let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let tree = chain(n.into(), |i| i % 2 == 0);
    let wide = TriangleBvh::from_tree(&tree, &corners, &bounds, of_one_kind(NodeKind::Aligned)).unwrap();
    assert_eq!(wide.raw().depth, u32::from(depth));
    (mesh, wide)
}

/// Rays through every sector: past all triangles from both sides, and from between two of them; slightly off the corner.
fn rays(depth: u16) -> Vec<Ray> {
    let n = n_triangles(depth);
    let behind = |i: u16| (f32::from(i) + 0.5) / f32::from(n);
    let mut rays = vec![];
    for sector in 0..SECTORS {
        for (from, to) in [(-0.5, 1.0), (1.5, -1.0), (behind(n / 3), 1.0), (behind(2 * n / 3), -1.0)] {
            for (across, y) in [(-1.0, 0.3), (-0.4, 0.7), (0.2, 0.5), (0.9, 0.4)] {
                let slope = slope(sector, AIMED * across);
                rays.push(Ray::new([from, y, y * slope], [to, 0.1, 0.1 * slope]));
            }
        }
    }
    rays
}

/// The first ray whose answers differ from the triangle that a loop finds.
fn first_difference(gpu: &Gpu, scene: &TracedScene, rays: &[Ray], wants: &[Option<u32>]) -> Option<String> {
    let hits = block_on(scene.closest_hits(gpu, rays)).unwrap();
    let occluded = block_on(scene.occluded(gpu, rays)).unwrap();
    assert_eq!((hits.len(), occluded.len()), (rays.len(), rays.len()));
    rays.iter().zip(hits).zip(occluded).zip(wants).find_map(|(((ray, hit), occluded), &want)| {
        let is_right = match hit {
            Outcome::Complete(hit) => {
                hit.map(|hit| hit.primitive) == want && occluded == Outcome::Complete(want.is_some())
            }
            Outcome::Incomplete => false,
        };
        (!is_right).then(|| format!("{ray:?}: {hit:?} and {occluded:?} for {want:?}"))
    })
}

fn wants(mesh: &Mesh, rays: &[Ray]) -> Vec<Option<u32>> {
    loop_over_all(mesh, TriangleTest::Watertight, rays).into_iter().map(|hit| hit.map(|hit| hit.primitive.0)).collect()
}

fn hits_are_found_up_to_the_greatest_depth() {
    let gpu = gpu();
    for depth in [16, 17, 33, 52, 128] {
        let ((mesh, tree), rays) = (deep(depth), rays(depth));
        let wants = wants(&mesh, &rays);
        let n_hit = wants.iter().flatten().count();
        // The first sector is empty, and rays that start among the triangles miss some of the sparse ones.
        assert!(n_hit > rays.len() / 2 && wants.len() - n_hit >= rays.len() / usize::from(SECTORS), "{n_hit}");
        let scene = block_on(TracedScene::new(&gpu, Source::wide(&tree), Options::default())).unwrap();
        assert_eq!(first_difference(&gpu, &scene, &rays, &wants), None, "depth {depth}");
    }
}

fn bvhs_too_deep_are_rejected() {
    let gpu = gpu();
    let refused = "the stack of a ray: requires 129 levels of nodes, the device supports 128; use another builder";
    let error = |scene: Result<TracedScene, GpuError>| scene.err().expect("the tree is too deep").to_string();
    let (_, tree) = deep(129);
    assert_eq!(error(block_on(TracedScene::new(&gpu, Source::wide(&tree), Options::default()))), refused);
    // The depths of both levels add up.
    let (_, tree) = deep(128);
    assert!(block_on(TracedScene::new(&gpu, Source::wide(&tree), Options::default())).is_ok());
    assert_eq!(
        error(block_on(TracedScene::new(
            &gpu,
            Source::tlas([&tree], &[Instance::new(0, Affine::IDENTITY); 2]),
            Options::default()
        ))),
        refused
    );
}

fn the_comparison_detects_a_lost_hit_in_a_deep_bvh() {
    let gpu = gpu();
    let ((mesh, _), rays) = (deep(16), rays(16));
    // A BVH over all triangles but one.
    let mut fewer = mesh.clone();
    let n = fewer.triangles.len();
    fewer.triangles[n - 1] = fewer.triangles[0];
    let tree = build(&fewer, &of_one_kind(NodeKind::Aligned));
    let scene = block_on(TracedScene::new(&gpu, Source::wide(&tree), Options::default())).unwrap();
    assert!(first_difference(&gpu, &scene, &rays, &wants(&mesh, &rays)).is_some());
}
