//! The tree over instances: the same stages over boxes, rebuilt alone after instances move.

use canted_fixtures::{Mesh, icosphere, soup};
use canted_gpu::{
    Gpu,
    build::{BuildConfig, Built, Items, Run, STRATEGIES, TwoLevels},
};
use canted_lbvh::{Bits, Strategy};
use canted_obb::{Affine, Obb};
use canted_tests::{
    exact::{contains, contains_box},
    scenes::crowd,
};
use canted_tlas::Instance;

use crate::{
    compare::{end_to_end, stages},
    repeated::{changed, words_of},
    setup::{Twin, gpu, items, twins},
};

/// A mesh with many triangles, one with none and one with one.
fn meshes() -> [Mesh; 3] {
    [icosphere(1), soup(1, 0), soup(2, 1)]
}

/// Instances of these meshes in turn, with every kind of transform.
fn instances(placed: &[Affine]) -> Vec<Instance> {
    (0..).zip(placed).map(|(i, &affine)| Instance::new(i % 3, affine)).collect()
}

fn built(gpu: &Gpu, instances: &[Instance], config: BuildConfig) -> TwoLevels {
    let mut run = Run::new(gpu);
    let bottom = Built::new(&mut run, items(gpu, &twins(&meshes(), config.bits)), config).unwrap();
    TwoLevels::new(&mut run, bottom, instances, config).unwrap()
}

/// The boxes of the instances that have one, computed on the CPU from the device's root boxes.
fn placed(gpu: &Gpu, levels: &TwoLevels, instances: &[Instance]) -> Vec<Obb> {
    let roots = levels.bottom.roots(gpu).unwrap();
    let of = |instance: &Instance| Some(roots[instance.blas as usize]?.transformed(&instance.world_from_object));
    instances.iter().filter_map(of).collect()
}

/// Asserts that the top level equals the CPU's over the same boxes, and that its boxes contain them.
fn assert_top(gpu: &Gpu, levels: &TwoLevels, instances: &[Instance], config: BuildConfig) {
    let twin = Twin::of_boxes(&placed(gpu, levels, instances), config.bits);
    let with_triangles: Vec<u32> =
        (0..).zip(instances).filter(|(_, i)| i.blas != 1).map(|(number, _)| number).collect();
    assert_eq!(levels.instances, with_triangles);
    let twins = [twin];
    stages(gpu, &levels.top.items, &twins, config.bits).unwrap_or_else(|error| panic!("{config:?}, {error}"));
    end_to_end(gpu, &levels.top, &twins).unwrap_or_else(|error| panic!("{config:?} from end to end, {error}"));
    let Some(obbs) = &levels.top.obbs else { return };
    let (obbs, leaves) = (gpu.read(obbs).unwrap(), twins[0].leaves());
    assert_eq!(escaped(&twins[0], &leaves, &obbs), None, "{config:?}");
}

/// A box that is not contained in the box of a node above it.
fn escaped(twin: &Twin<Obb>, leaves: &[Obb], obbs: &[Obb]) -> Option<(usize, Obb)> {
    twin.tree.nodes.iter().zip(obbs).enumerate().find_map(|(index, (node, obb))| {
        let below = &leaves[node.first as usize..=node.last as usize];
        below.iter().find(|inner| !contains_box(obb, inner)).map(|inner| (index, *inner))
    })
}

#[test]
fn the_top_level_matches_the_cpu_over_the_same_boxes() {
    let Some(gpu) = gpu("the_top_level_matches_the_cpu_over_the_same_boxes") else { return };
    let instances = instances(&crowd());
    for bits in [Bits::B30, Bits::B63] {
        for strategy in STRATEGIES {
            let config = BuildConfig { bits, strategy };
            assert_top(&gpu, &built(&gpu, &instances, config), &instances, config);
        }
    }
}

#[test]
fn few_instances_make_a_small_top_level() {
    let Some(gpu) = gpu("few_instances_make_a_small_top_level") else { return };
    let config = BuildConfig { strategy: Strategy::Combined, ..BuildConfig::default() };
    for n in 0..5 {
        let instances = instances(&crowd()[..n]);
        assert_top(&gpu, &built(&gpu, &instances, config), &instances, config);
    }
}

#[test]
fn roots_contain_their_meshes() {
    let Some(gpu) = gpu("roots_contain_their_meshes") else { return };
    for strategy in [Strategy::Aabb, Strategy::Combined, Strategy::Dop] {
        let levels = built(&gpu, &[], BuildConfig { strategy, ..BuildConfig::default() });
        let roots = levels.bottom.roots(&gpu).unwrap();
        assert_eq!(roots.iter().map(Option::is_some).collect::<Vec<_>>(), [true, false, true]);
        for (mesh, root) in meshes().iter().zip(roots) {
            let inside = |&&index: &&u32| contains(&root.unwrap(), mesh.positions[index as usize]);
            let n_inside = mesh.triangles.iter().flatten().filter(inside).count();
            assert_eq!(n_inside, 3 * mesh.triangles.len(), "{strategy:?}");
        }
    }
}

/// Work-groups by stage.
fn groups(run: &Run<'_>) -> Vec<(&'static str, u64)> {
    run.times().iter().map(|time| (time.stage, time.n_groups)).collect()
}

#[test]
fn moved_instances_change_only_the_top_level() {
    let Some(gpu) = gpu("moved_instances_change_only_the_top_level") else { return };
    let config = BuildConfig { strategy: Strategy::PcaBounded, ..BuildConfig::default() };
    let mut placed = crowd();
    let mut levels = built(&gpu, &instances(&placed), config);
    placed.rotate_left(7);
    placed.truncate(30);
    let moved = instances(&placed);
    let bottom = words_of(&gpu, &levels.bottom);
    let mut run = Run::timed(&gpu);
    levels.place(&mut run, &moved).unwrap();
    assert_top(&gpu, &levels, &moved, config);
    assert_eq!(changed(&bottom, &words_of(&gpu, &levels.bottom)), None);

    let nowhere = [Instance::new(0, Affine::IDENTITY), Instance::new(7, Affine::IDENTITY)];
    let error = levels.place(&mut run, &nowhere).unwrap_err().to_string();
    assert!(error.contains("instance 1 refers to bottom-level BVH 7"), "{error}");
    let mut endless = Instance::new(0, Affine::IDENTITY);
    endless.world_from_object.columns[3][1] = f32::INFINITY;
    let error = levels.place(&mut run, &[endless]).unwrap_err().to_string();
    assert!(error.contains("the transform of instance 0 is not finite"), "{error}");
    assert_top(&gpu, &levels, &moved, config);

    // The update takes as many work-groups as a tree over these boxes, and the rejected updates took none.
    let mut alone = Run::timed(&gpu);
    let boxes = Items::boxes(&gpu, &self::placed(&gpu, &levels, &moved)).unwrap();
    Built::new(&mut alone, boxes, config).unwrap();
    assert_eq!(groups(&run), groups(&alone));
    Built::new(&mut alone, items(&gpu, &twins(&meshes(), config.bits)), config).unwrap();
    assert!(
        groups(&run).iter().zip(groups(&alone)).all(|(top, both)| top.1 < both.1),
        "the counts include the bottom level"
    );
}

#[test]
fn the_check_detects_a_box_without_its_instances() {
    let Some(gpu) = gpu("the_check_detects_a_box_without_its_instances") else { return };
    let config = BuildConfig { strategy: Strategy::Combined, ..BuildConfig::default() };
    let instances = instances(&crowd());
    let levels = built(&gpu, &instances, config);
    let twin = Twin::of_boxes(&placed(&gpu, &levels, &instances), config.bits);
    let mut obbs = gpu.read(levels.top.obbs.as_ref().unwrap()).unwrap();
    obbs[5].half_extents = obbs[5].half_extents.map(|half| half * 0.99);
    assert_eq!(escaped(&twin, &twin.leaves(), &obbs).map(|(index, _)| index), Some(5));
}
