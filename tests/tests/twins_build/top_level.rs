//! The tree over instances: the same stages over boxes.

use canted_fixtures::{
    Mesh,
    device_tests::{Test, needs_device},
    icosphere, soup,
};
use canted_gpu::{
    Gpu, block_on,
    build::{BuildConfig, BuildEncoder, Built, Primitives, STRATEGIES},
};
use canted_lbvh::{Bits, Strategy};
use canted_obb::{Affine, Obb};
use canted_tests::{
    exact::{contains, contains_box},
    scenes::crowd,
};
use canted_tlas::Instance;

use crate::{
    setup::{Twin, gpu, primitives, twins},
    stages::{end_to_end, stages},
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(the_top_level_matches_the_cpu_over_the_same_boxes),
        needs_device(few_instances_make_a_small_top_level),
        needs_device(roots_contain_their_meshes),
        needs_device(the_check_detects_a_box_without_its_instances),
    ]
}

/// A mesh with many triangles, one with none and one with one.
fn meshes() -> [Mesh; 3] {
    [icosphere(1), soup(1, 0), soup(2, 1)]
}

/// Instances of these meshes in turn, with every kind of transform.
fn instances(placed: &[Affine]) -> Vec<Instance> {
    (0..).zip(placed).map(|(i, &affine)| Instance::new(i % 3, affine)).collect()
}

fn bottom(gpu: &Gpu, config: BuildConfig) -> Built {
    Built::new(&mut BuildEncoder::new(gpu), primitives(gpu, &twins(&meshes(), config.bits)), config).unwrap()
}

/// The tree over instances, and their boxes, which the CPU computes from the device's root boxes.
fn top(gpu: &Gpu, instances: &[Instance], config: BuildConfig) -> (Built, Vec<Obb>) {
    let roots = block_on(bottom(gpu, config).roots(gpu)).unwrap();
    let of = |instance: &Instance| Some(roots[instance.blas as usize]?.transformed(&instance.world_from_object));
    let boxes: Vec<Obb> = instances.iter().filter_map(of).collect();
    let primitives = Primitives::boxes(gpu, &boxes).unwrap();
    (Built::new(&mut BuildEncoder::new(gpu), primitives, config).unwrap(), boxes)
}

/// Asserts that the top level equals the CPU's over the same boxes, and that its boxes contain them.
fn assert_top(gpu: &Gpu, instances: &[Instance], config: BuildConfig) {
    let (top, boxes) = top(gpu, instances, config);
    let twins = [Twin::of_boxes(&boxes, config.bits)];
    stages(gpu, &top.primitives, &twins, config.bits).unwrap_or_else(|error| panic!("{config:?}, {error}"));
    end_to_end(gpu, &top, &twins).unwrap_or_else(|error| panic!("{config:?} from end to end, {error}"));
    let Some(obbs) = &top.obbs else { return };
    let (obbs, leaves) = (block_on(gpu.read(obbs)).unwrap(), twins[0].leaves());
    assert_eq!(escaped(&twins[0], &leaves, &obbs), None, "{config:?}");
}

/// A box that is not contained in the box of a node above it.
fn escaped(twin: &Twin<Obb>, leaves: &[Obb], obbs: &[Obb]) -> Option<(usize, Obb)> {
    twin.tree.nodes.iter().zip(obbs).enumerate().find_map(|(index, (node, obb))| {
        let below = &leaves[node.first as usize..=node.last as usize];
        below.iter().find(|inner| !contains_box(obb, inner)).map(|inner| (index, *inner))
    })
}

fn the_top_level_matches_the_cpu_over_the_same_boxes() {
    let gpu = gpu();
    let instances = instances(&crowd());
    for bits in [Bits::B30, Bits::B63] {
        for strategy in STRATEGIES {
            let config = BuildConfig { bits, strategy };
            assert_top(&gpu, &instances, config);
        }
    }
}

fn few_instances_make_a_small_top_level() {
    let gpu = gpu();
    let config = BuildConfig { strategy: Strategy::Combined, ..BuildConfig::default() };
    for n in 0..5 {
        let instances = instances(&crowd()[..n]);
        assert_top(&gpu, &instances, config);
    }
}

fn roots_contain_their_meshes() {
    let gpu = gpu();
    for strategy in [Strategy::Aabb, Strategy::Combined, Strategy::Dop] {
        let roots = block_on(bottom(&gpu, BuildConfig { strategy, ..BuildConfig::default() }).roots(&gpu)).unwrap();
        assert_eq!(roots.iter().map(Option::is_some).collect::<Vec<_>>(), [true, false, true]);
        for (mesh, root) in meshes().iter().zip(roots) {
            let inside = |&&index: &&u32| contains(&root.unwrap(), mesh.positions[index as usize]);
            let n_inside = mesh.triangles.iter().flatten().filter(inside).count();
            assert_eq!(n_inside, 3 * mesh.triangles.len(), "{strategy:?}");
        }
    }
}

fn the_check_detects_a_box_without_its_instances() {
    let gpu = gpu();
    let config = BuildConfig { strategy: Strategy::Combined, ..BuildConfig::default() };
    let instances = instances(&crowd());
    let (top, boxes) = top(&gpu, &instances, config);
    let twin = Twin::of_boxes(&boxes, config.bits);
    let mut obbs = block_on(gpu.read(top.obbs.as_ref().unwrap())).unwrap();
    obbs[5].half_extents = obbs[5].half_extents.map(|half| half * 0.99);
    assert_eq!(escaped(&twin, &twin.leaves(), &obbs).map(|(index, _)| index), Some(5));
}
