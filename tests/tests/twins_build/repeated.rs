//! Repeated builds: no bit depends on the order of work-groups.

use bytemuck::Pod;
use canted_fixtures::Mesh;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{
    Buffer, Gpu,
    build::{self, BuildConfig, BuildEncoder, Built, STRATEGIES},
};
use canted_lbvh::{Bits, Strategy};

use crate::setup::{Twin, gpu, large, needles, primitives, twins};

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(repeated_builds_have_the_same_bits), needs_device(the_comparison_detects_one_ulp_of_one_vertex)]
}

/// Builds compared with the first.
const ROUNDS: usize = 20;

/// Words of buffers by name.
pub(crate) type Words = Vec<(&'static str, Vec<u32>)>;

fn read<T: Pod>(gpu: &Gpu, buffer: &Buffer<T>) -> Vec<u32> {
    bytemuck::cast_slice(&gpu.read(buffer).unwrap()).to_vec()
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
fn meshes() -> [Mesh; 2] {
    [large(7, 4_000), needles().remove(0)]
}

fn repeated_builds_have_the_same_bits() {
    let gpu = gpu();
    let twins = twins(&meshes(), Bits::B63);
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
    let mut twins = twins(&meshes(), Bits::B63);
    let first = stages(&gpu, &twins, Strategy::Combined);
    let corner = twins[0].primitives.iter_mut().flatten().max_by(|a, b| a[0].total_cmp(&b[0])).unwrap();
    corner[0] = corner[0].next_up();
    let moved = stages(&gpu, &twins, Strategy::Combined);
    assert!(changed(&first, &moved).is_some());
}
