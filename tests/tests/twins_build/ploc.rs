//! Clustered trees equal to those of the CPU; repeated builds with the same bits.

use bytemuck::Pod;
use canted_fixtures::{
    Mesh,
    device_tests::{Test, needs_device},
    soup,
};
use canted_gpu::{
    Buffer, Gpu, block_on,
    build::{self, BuildConfig, BuildEncoder, Built, STRATEGIES, Topology, WideConfig},
};
use canted_lbvh::{Bits, Strategy};
use canted_obb::Aabb;
use canted_sah::{PlocConfig, ploc};
use canted_tests::scenes as models;

use crate::{
    setup::{Twin, gpu, large, meshes, needles, primitives, twins},
    stages::end_to_end,
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(clustered_trees_match_the_integers_of_the_cpu),
        needs_device(slow_iterations_are_followed_by_merging_all_neighbors),
        needs_device(the_comparison_detects_another_topology),
        needs_device(the_bunny_is_clustered_as_on_the_cpu).unless(models::missing()),
        needs_device(repeated_builds_have_the_same_bits),
        needs_device(the_comparison_detects_one_ulp_of_one_vertex),
    ]
}

/// The CPU's clustered trees.
fn clustered(meshes: &[Mesh]) -> Vec<Twin> {
    let mut twins = twins(meshes, Bits::B63);
    for twin in &mut twins {
        let boxes: Vec<Aabb> = twin.leaves().into_iter().map(Aabb::from_points).collect();
        twin.tree = ploc(twin.sorted.clone(), &boxes, &PlocConfig::NEAR);
        twin.sorted.leaves.clone_from(&twin.tree.leaves);
    }
    twins
}

fn compared(gpu: &Gpu, there: &[Twin], twins: &[Twin]) -> Result<(), String> {
    let built = Built::new(
        &mut BuildEncoder::new(gpu),
        primitives(gpu, there),
        WideConfig { topology: Topology::Ploc, ..WideConfig::default() },
    )
    .unwrap();
    end_to_end(gpu, &built, twins)
}

fn same(gpu: &Gpu, meshes: &[Mesh], name: &str) {
    let twins = clustered(meshes);
    compared(gpu, &twins, &twins).unwrap_or_else(|error| panic!("{name}: {error}"));
}

fn clustered_trees_match_the_integers_of_the_cpu() {
    let gpu = gpu();
    same(&gpu, &meshes(), "generated");
    same(&gpu, &needles(), "needles");
    same(&gpu, &[], "no mesh");
    same(&gpu, &[soup(1, 0)], "no triangle");
    for n in [1, 2, 3, 255, 256, 257, 258, 600] {
        same(&gpu, &[soup(2, 7), soup(3, n), soup(4, 300)], &format!("{n} triangles"));
    }
    same(&gpu, &[large(5, 50_000)], "large");
}

/// Boxes that grow along the curve: few clusters have a partner, so all neighbors are merged now and then.
fn slow_iterations_are_followed_by_merging_all_neighbors() {
    let gpu = gpu();
    let growing = |n: u16| {
        let mut mesh = Mesh { positions: vec![], triangles: vec![] };
        for i in 0..n {
            let first = u32::try_from(mesh.positions.len()).unwrap();
            let x = f32::from(i) * f32::from(i);
            mesh.positions.extend([[x, x, x], [1.1 * x + 1.0, x, x], [x, 1.1 * x + 1.0, 1.2 * x]]);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        mesh
    };
    same(&gpu, &[growing(2000), growing(200), growing(300)], "growing");
}

fn the_comparison_detects_another_topology() {
    let gpu = gpu();
    let meshes = [soup(1, 4), soup(3, 300)];
    let there = clustered(&meshes);
    assert!(compared(&gpu, &there, &twins(&meshes, Bits::B63)).is_err());
    let mut spoilt = clustered(&meshes);
    spoilt[1].tree.nodes.swap(7, 8);
    let error = compared(&gpu, &there, &spoilt).unwrap_err();
    assert!(error.starts_with("nodes of tree 1: "), "{error}");
}

fn the_bunny_is_clustered_as_on_the_cpu() {
    let (folder, gpu) = (models::folder(), gpu());
    let scene = canted_scene::read(&folder.join("stanford/bunny.ply")).unwrap();
    let meshes: Vec<Mesh> =
        scene.meshes.into_iter().map(|mesh| Mesh { positions: mesh.positions, triangles: mesh.triangles }).collect();
    same(&gpu, &meshes, "bunny");
}

/// Builds compared with the first.
const ROUNDS: usize = 50;

/// Words of buffers by name.
pub(crate) type Words = Vec<(&'static str, Vec<u32>)>;

fn read<T: Pod>(gpu: &Gpu, buffer: &Buffer<T>) -> Vec<u32> {
    bytemuck::cast_slice(&block_on(gpu.read(buffer)).unwrap()).to_vec()
}

/// All buffers that a build leaves on the device.
pub(crate) fn words_of(gpu: &Gpu, built: &Built) -> Words {
    let trees = &built.trees;
    let obbs = built.obbs.as_ref().map(|obbs| read(gpu, obbs)).unwrap_or_default();
    vec![
        ("leaves", read(gpu, &built.leaves)),
        ("nodes", read(gpu, &trees.nodes)),
        ("parents", read(gpu, &trees.parents)),
        ("heights", read(gpu, &trees.heights)),
        ("depth", read(gpu, &trees.depth)),
        ("axis-aligned boxes", read(gpu, &built.aabbs)),
        ("oriented boxes", obbs),
    ]
}

/// All results of the stages of a build, including the grids and codes that it drops.
fn stages(gpu: &Gpu, twins: &[Twin], strategy: Strategy) -> Words {
    let bits = Bits::B63;
    let mut build = BuildEncoder::new(gpu);
    let primitives = primitives(gpu, twins);
    let domains = build::domain(&mut build, &primitives, bits).unwrap();
    let codes = build::codes(&mut build, &primitives, &domains, bits).unwrap();
    let built = Built::new(&mut build, primitives, BuildConfig { bits, strategy }).unwrap();
    let mut words = vec![
        ("grids", read(gpu, &domains)),
        ("low words of codes", read(gpu, &codes.low)),
        ("high words of codes", read(gpu, codes.high.as_ref().unwrap())),
    ];
    words.extend(words_of(gpu, &built));
    words
}

/// The first buffer that differs.
pub(crate) fn changed(before: &Words, after: &Words) -> Option<&'static str> {
    before.iter().zip(after).find(|(before, after)| before != after).map(|((name, _), _)| *name)
}

/// A mesh of many work-groups, and needles, most of whose boxes are oriented.
fn two_meshes() -> [Mesh; 2] {
    [large(7, 4_000), needles().remove(0)]
}

fn repeated_builds_have_the_same_bits() {
    let gpu = gpu();
    let twins = twins(&two_meshes(), Bits::B63);
    for strategy in STRATEGIES {
        let first = stages(&gpu, &twins, strategy);
        for round in 1..ROUNDS {
            let again = stages(&gpu, &twins, strategy);
            assert_eq!(changed(&first, &again), None, "{strategy:?}, build {round}");
        }
    }
}

fn the_comparison_detects_one_ulp_of_one_vertex() {
    let gpu = gpu();
    let mut twins = twins(&two_meshes(), Bits::B63);
    let first = stages(&gpu, &twins, Strategy::Combined);
    let corner = twins[0].primitives.iter_mut().flatten().max_by(|a, b| a[0].total_cmp(&b[0])).unwrap();
    corner[0] = corner[0].next_up();
    let moved = stages(&gpu, &twins, Strategy::Combined);
    assert!(changed(&first, &moved).is_some());
}
