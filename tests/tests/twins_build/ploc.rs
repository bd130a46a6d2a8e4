//! Trees of locally-ordered clustering compared with the CPU's.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_fixtures::{Mesh, soup};
use canted_gpu::Gpu;
use canted_gpu::build::{BuildEncoder, Built, Topology, WideConfig};
use canted_lbvh::Bits;
use canted_obb::Aabb;
use canted_sah::{PlocConfig, ploc};
use canted_tests::scenes as models;

use crate::compare::end_to_end;
use crate::setup::{Twin, gpu, large, meshes, needles, primitives, twins};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(clustered_trees_match_the_integers_of_the_cpu),
        needs_device(slow_iterations_are_followed_by_merging_all_neighbors),
        needs_device(the_comparison_detects_another_topology),
        needs_device(the_bunny_is_clustered_as_on_the_cpu).unless(models::missing()),
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
