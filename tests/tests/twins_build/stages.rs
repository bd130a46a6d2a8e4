//! Domain, codes, order and tree, each on the CPU's previous result and then from end to end, all meshes in one set of dispatches.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_fixtures::{Mesh, SplitMix64, soup};
use canted_gpu::build::{self, BuildConfig, BuildEncoder, Built};
use canted_lbvh::Bits;

use crate::{
    compare::{assert_equal, bits_of, end_to_end, grids, stages},
    setup::{BOTH, Twin, gpu, large, meshes, primitives, twins},
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(every_stage_matches_the_integers_of_the_cpu),
        needs_device(a_large_mesh_takes_several_slices),
        needs_device(no_mesh_and_no_triangle_make_no_tree),
        needs_device(grids_round_as_on_the_cpu),
        needs_device(the_comparison_detects_an_error_in_each_stage),
        needs_device(the_comparison_detects_a_wrong_box),
    ]
}

fn every_stage_matches_the_integers_of_the_cpu() {
    let gpu = gpu();
    for bits in BOTH {
        assert_equal(&gpu, &twins(&meshes(), bits), bits, "generated");
    }
}

fn a_large_mesh_takes_several_slices() {
    let gpu = gpu();
    assert_equal(&gpu, &twins(&[large(5, 300_000)], Bits::B63), Bits::B63, "large");
}

fn no_mesh_and_no_triangle_make_no_tree() {
    let gpu = gpu();
    assert_equal(&gpu, &[], Bits::B63, "no mesh");
    assert_equal(&gpu, &twins(&[soup(1, 0)], Bits::B63), Bits::B63, "no triangle");
}

/// Scales from the least to the greatest supported, and coordinates that round.
fn grids_round_as_on_the_cpu() {
    let gpu = gpu();
    let mut rng = SplitMix64::new(3);
    let mesh = |size: f32, seed: u64| {
        let mesh = soup(seed, 4);
        Mesh { positions: mesh.positions.iter().map(|p| p.map(|x| x * size)).collect(), ..mesh }
    };
    let meshes: Vec<Mesh> = (0..400)
        .map(|i| {
            let size = (rng.signed() * 40.0).exp2() as f32;
            mesh(size, i)
        })
        .chain([1e-30, 1e-32, 1e-35, 0.0, 4.0e18].into_iter().map(|size| mesh(size, 1)))
        .collect();
    for bits in BOTH {
        let twins = twins(&meshes, bits);
        let domains = build::domain(&mut BuildEncoder::new(&gpu), &primitives(&gpu, &twins), bits).unwrap();
        let (device, cpu) = (gpu.read(&domains).unwrap(), grids(&twins));
        for (index, (device, cpu)) in device.iter().zip(&cpu).enumerate() {
            assert_eq!(bits_of(&[*device]), bits_of(&[*cpu]), "mesh {index}, {bits:?}: {device:?} for {cpu:?}");
        }
    }
}

/// One wrong number in the CPU's result, and where the comparison must report it.
fn the_comparison_detects_an_error_in_each_stage() {
    let gpu = gpu();
    type Spoil = fn(&mut Twin);
    let spoils: [(&str, Spoil); 6] = [
        ("grids: number 2 ", |twin| twin.domain.scale = twin.domain.scale.next_up()),
        ("codes: ", |twin| twin.codes[20] ^= 1),
        ("sorted codes: ", |twin| twin.sorted.codes[20] ^= 1 << 40),
        ("leaves: ", |twin| twin.sorted.leaves.swap(3, 4)),
        ("nodes of tree 2: number 3 ", |twin| twin.tree.nodes.swap(3, 4)),
        ("depth: ", |twin| twin.tree.depth += 30),
    ];
    for (stage, spoil) in spoils {
        let mut twins = twins(&[soup(1, 4), soup(2, 9), soup(3, 30)], Bits::B63);
        spoil(&mut twins[2]);
        let error = stages(&gpu, &primitives(&gpu, &twins), &twins, Bits::B63).unwrap_err();
        assert!(error.starts_with(stage), "{error}");
    }
}

fn the_comparison_detects_a_wrong_box() {
    let gpu = gpu();
    let mut twins = twins(&[soup(1, 4), soup(3, 30)], Bits::B63);
    let built = Built::new(&mut BuildEncoder::new(&gpu), primitives(&gpu, &twins), BuildConfig::default()).unwrap();
    twins[1].primitives[7] = [[9.0; 3]; 3];
    let error = end_to_end(&gpu, &built, &twins).unwrap_err();
    assert!(error.starts_with("boxes of tree 1: "), "{error}");
}
