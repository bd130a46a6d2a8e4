//! Scans, sorts, and every stage of a build up to the nodes: integers equal to those of the CPU, also for models of others.

use std::fmt::Debug;

use bytemuck::{Pod, Zeroable};
use canted_fixtures::{
    Mesh, SplitMix64,
    device_tests::{Test, needs_device},
    soup,
};
use canted_gpu::{
    Gpu, NamedBinding, Number, Variant, block_on,
    build::{self, BuildConfig, BuildEncoder, Built, Codes, Grid, Node, Primitives, STRATEGIES, Sorter, Trees},
    wgsl,
};
use canted_lbvh::{self as lbvh, Bits, Child, ChildKind, Leaf, Tree, VolumeConfig, sort_by_code};
use canted_tests::scenes;

use crate::{
    setup::{BOTH, Twin, gpu, large, meshes, primitives, twins, words},
    volumes::assert_contained,
};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(every_stage_matches_the_integers_of_the_cpu),
        needs_device(a_large_mesh_takes_several_slices),
        needs_device(no_mesh_and_no_triangle_make_no_tree),
        needs_device(grids_round_as_on_the_cpu),
        needs_device(the_comparison_detects_an_error_in_each_stage),
        needs_device(the_comparison_detects_a_wrong_box),
        needs_device(sums_match_the_cpu_at_every_length),
        needs_device(the_comparison_detects_one_wrong_sum),
        needs_device(the_sort_is_stable_across_sizes_and_duplicates),
        needs_device(a_million_pairs_are_sorted_stably),
        needs_device(the_comparison_detects_one_wrong_bit),
        needs_device(the_bunny_is_built_as_on_the_cpu).unless(scenes::missing()),
        needs_device(sponza_is_built_as_on_the_cpu).unless(scenes::missing()),
        needs_device(the_kitchen_is_built_as_on_the_cpu).unless(scenes::missing()),
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
        let (device, cpu) = (block_on(gpu.read(&domains)).unwrap(), grids(&twins));
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

/// Codes in the device's layout.
fn on_device(gpu: &Gpu, codes: [Vec<u32>; 2], bits: Bits) -> Codes {
    let [low, high] = codes.map(|word| gpu.buffer("codes", &word).unwrap());
    Codes { low, high: (bits == Bits::B63).then_some(high) }
}

fn read(gpu: &Gpu, codes: &Codes) -> [Vec<u32>; 2] {
    let low = block_on(gpu.read(&codes.low)).unwrap();
    let high = codes.high.as_ref().map_or_else(|| vec![0; low.len()], |high| block_on(gpu.read(high)).unwrap());
    [low, high]
}

/// The CPU's grids; empty inputs have none.
pub(crate) fn grids<L>(twins: &[Twin<L>]) -> Vec<Grid> {
    let of = |twin: &Twin<L>| Grid { offset: twin.domain.offset, scale: twin.domain.scale };
    let none = Grid { offset: [0.0; 3], scale: 0.0 };
    twins.iter().map(|twin| if twin.primitives.is_empty() { none } else { of(twin) }).collect()
}

/// The bits with both zeros equal, because the minimum of two zeros may be either.
pub(crate) fn bits_of(grids: &[Grid]) -> Vec<[u32; 4]> {
    grids
        .iter()
        .map(|Grid { offset: [x, y, z], scale }| [x, y, z, scale].map(|number| (number + 0.0).to_bits()))
        .collect()
}

/// The first difference between two lists.
fn unequal<T: PartialEq + Debug>(what: &str, device: &[T], cpu: &[T]) -> Result<(), String> {
    if device.len() != cpu.len() {
        return Err(format!("{what}: {} for {}", device.len(), cpu.len()));
    }
    match device.iter().zip(cpu).position(|(device, cpu)| device != cpu) {
        None => Ok(()),
        Some(i) => Err(format!("{what}: number {i} is {:?} for {:?}", device[i], cpu[i])),
    }
}

/// Compares every stage, each on the CPU's result of the previous one.
///
/// # Errors
/// The first difference from the CPU.
pub(crate) fn stages<L>(gpu: &Gpu, primitives: &Primitives, twins: &[Twin<L>], bits: Bits) -> Result<(), String> {
    let mut build = BuildEncoder::new(gpu);
    let domains = build::domain(&mut build, primitives, bits).unwrap();
    unequal("grids", &bits_of(&block_on(gpu.read(&domains)).unwrap()), &bits_of(&grids(twins)))?;

    let domains = gpu.buffer("domains", &grids(twins)).unwrap();
    let codes = build::codes(&mut build, primitives, &domains, bits).unwrap();
    let cpu_codes = words(twins.iter().flat_map(|twin| &twin.codes));
    for (device, cpu) in read(gpu, &codes).iter().zip(&cpu_codes) {
        unequal("codes", device, cpu)?;
    }

    let sorted = build::sort(&mut build, primitives, &on_device(gpu, cpu_codes, bits)).unwrap();
    let cpu_sorted = words(twins.iter().flat_map(|twin| &twin.sorted.codes));
    for (device, cpu) in read(gpu, &sorted.codes).iter().zip(&cpu_sorted) {
        unequal("sorted codes", device, cpu)?;
    }
    unequal("leaves", &block_on(gpu.read(&sorted.leaves)).unwrap(), &leaves(primitives, twins))?;

    let trees = build::tree(&mut build, primitives, &on_device(gpu, cpu_sorted, bits)).unwrap();
    topology(gpu, primitives, &trees, twins)
}

/// Compares trees built from end to end.
///
/// # Errors
/// The first difference from the CPU: leaves, nodes or axis-aligned boxes.
pub(crate) fn end_to_end<L: Leaf>(gpu: &Gpu, built: &Built, twins: &[Twin<L>]) -> Result<(), String> {
    unequal("leaves", &block_on(gpu.read(&built.leaves)).unwrap(), &leaves(&built.primitives, twins))?;
    topology(gpu, &built.primitives, &built.trees, twins)?;
    let aabbs = block_on(gpu.read(&built.aabbs)).unwrap();
    for (index, (twin, range)) in twins.iter().zip(built.primitives.ranges()).enumerate() {
        let cpu = lbvh::volumes(&twin.tree, &twin.leaves(), &VolumeConfig::default()).aabbs;
        unequal(&format!("boxes of tree {index}"), &aabbs[range.first as usize..][..cpu.len()], &cpu)?;
    }
    Ok(())
}

/// Asserts that every stage gives the CPU's integers, alone and one after another.
pub(crate) fn assert_equal(gpu: &Gpu, twins: &[Twin], bits: Bits, name: &str) {
    let alone = stages(gpu, &primitives(gpu, twins), twins, bits);
    alone.unwrap_or_else(|error| panic!("{name}, {bits:?}, {error}"));
    let config = BuildConfig { bits, ..BuildConfig::default() };
    let built = Built::new(&mut BuildEncoder::new(gpu), primitives(gpu, twins), config);
    let together = end_to_end(gpu, &built.unwrap(), twins);
    together.unwrap_or_else(|error| panic!("{name}, {bits:?} from end to end, {error}"));
}

/// The item of each leaf, numbered over all trees.
fn leaves<L>(primitives: &Primitives, twins: &[Twin<L>]) -> Vec<u32> {
    let firsts = primitives.ranges().iter().map(|range| range.first);
    twins
        .iter()
        .zip(firsts)
        .flat_map(|(twin, first)| twin.sorted.leaves.iter().map(move |leaf| leaf.0 + first))
        .collect()
}

fn topology<L>(gpu: &Gpu, primitives: &Primitives, trees: &Trees, twins: &[Twin<L>]) -> Result<(), String> {
    let nodes = block_on(gpu.read(&trees.nodes)).unwrap();
    for (index, (twin, range)) in twins.iter().zip(primitives.ranges()).enumerate() {
        let cpu = shifted(&twin.tree, range.first);
        unequal(&format!("nodes of tree {index}"), &nodes[range.first as usize..][..cpu.len()], &cpu)?;
    }
    check_parents(&nodes, &block_on(gpu.read(&trees.parents)).unwrap(), primitives);
    let depth = twins.iter().map(|twin| twin.tree.depth).max().unwrap_or(0);
    unequal("depth", &block_on(gpu.read(&trees.depth)).unwrap(), &[depth])
}

/// Nodes of a separate tree, renumbered for items that begin at `first`.
fn shifted(tree: &Tree, first: u32) -> Vec<Node> {
    let child = |child: Child| match child.kind() {
        ChildKind::Leaf(position) => (position + first) | 1 << 31,
        ChildKind::Inner(id) => id.0 + first,
    };
    let node = |node: &lbvh::Node| Node {
        left: child(node.left),
        right: child(node.right),
        first: node.first + first,
        last: node.last + first,
    };
    tree.nodes.iter().map(node).collect()
}

/// Asserts that each node's children name it as their parent.
fn check_parents(nodes: &[Node], parents: &[u32], primitives: &Primitives) {
    const LEAF: u32 = 1 << 31;
    let at = |child: u32| if child & LEAF == 0 { child as usize } else { nodes.len() + (child & !LEAF) as usize };
    for range in primitives.ranges() {
        for slot in range.first..(range.first + range.count).max(1) - 1 {
            let node = nodes[slot as usize];
            assert_eq!([node.left, node.right].map(|child| parents[at(child)]), [slot; 2]);
        }
        match range.count {
            0 => {}
            1 => assert_eq!(parents[at(range.first | LEAF)], u32::MAX),
            _ => assert_eq!(parents[at(range.first)], u32::MAX),
        }
    }
}

/// As in `shared/build.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Digit {
    n_keys: u32,
    n_tiles: u32,
    rest: [u32; 4],
}

/// The exclusive prefix sums of numbers, by work-groups of `group` invocations.
fn scanned(gpu: &Gpu, group: u32, numbers: &[u32]) -> Vec<u32> {
    const EACH: u32 = 16;
    let tiled = Variant::none().number(Number::Group, group).number(Number::KeysEach, EACH).number(Number::Radix, 256);
    let n_keys = u32::try_from(numbers.len()).unwrap();
    let n_tiles = n_keys.div_ceil(group * EACH);
    let digit = gpu.uniform("digit", &Digit { n_keys, n_tiles, rest: [0; 4] }).unwrap();
    let slice = gpu.uniform("slice", &[0, n_tiles, 0]).unwrap();
    let values = gpu.buffer("values", numbers).unwrap();
    // The initial content must not matter.
    let counts = gpu.buffer("counts", &vec![7_u32; n_tiles as usize]).unwrap();
    let prefixes = gpu.buffer("prefixes", &vec![7_u32; numbers.len()]).unwrap();
    let bound: [NamedBinding<'_>; 5] =
        [("slice", &slice), ("digit", &digit), ("values", &values), ("counts", &counts), ("prefixes", &prefixes)];
    let mut commands = gpu.commands();
    for name in [wgsl::build::sort::TILE_SUMS, wgsl::build::sort::TILE_PREFIXES] {
        commands.dispatch(&gpu.kernel(name, &tiled).unwrap(), &bound, [n_tiles, 1, 1]).unwrap();
    }
    block_on(commands.run()).unwrap();
    block_on(gpu.read(&prefixes)).unwrap()
}

/// The same as a loop. Sums wrap around on both sides.
fn scanned_by_cpu(numbers: &[u32]) -> Vec<u32> {
    let mut sum = 0_u32;
    let before = |&number: &u32| {
        let before = sum;
        sum = sum.wrapping_add(number);
        before
    };
    numbers.iter().map(before).collect()
}

fn numbers(n: usize) -> Vec<u32> {
    let mut rng = SplitMix64::new(n as u64);
    (0..n).map(|i| u32::try_from(rng.below(1 << (10 * (i % 3 + 1)))).unwrap()).collect()
}

/// For one tile and for several.
fn sums_match_the_cpu_at_every_length() {
    let gpu = gpu();
    for n in [0, 1, 2, 63, 64, 65, 1023, 1024, 1025, 4096, 4097, 65_537, 1 << 20] {
        let numbers = numbers(n);
        for group in [64, 256] {
            assert!(scanned(&gpu, group, &numbers) == scanned_by_cpu(&numbers), "{n} numbers, {group} invocations");
        }
    }
}

fn the_comparison_detects_one_wrong_sum() {
    let gpu = gpu();
    let numbers = numbers(3000);
    let mut other = numbers.clone();
    other[2999] ^= 1;
    // The last number is in no sum.
    assert!(scanned(&gpu, 64, &other) == scanned_by_cpu(&numbers));
    other[0] ^= 1;
    let found = scanned(&gpu, 64, &other);
    assert!(found.iter().zip(scanned_by_cpu(&numbers)).skip(1).all(|(&there, here)| there != here));
}

/// `n` codes of 63 bits with `distinct` values.
fn codes(n: usize, distinct: usize) -> Vec<u64> {
    let mut rng = SplitMix64::new(n as u64);
    (0..n).map(|_| (rng.below(distinct) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 1).collect()
}

fn sorted(gpu: &Gpu, sorter: &Sorter, codes: &[u64]) -> Vec<u32> {
    let [low, high] = words(codes.iter()).map(|word| gpu.buffer("codes", &word).unwrap());
    block_on(gpu.read(&sorter.sort(&mut BuildEncoder::new(gpu), &[(&low, 32), (&high, 31)]).unwrap())).unwrap()
}

fn sorted_by_cpu(codes: &[u64]) -> Vec<u32> {
    sort_by_code(codes, Bits::B63).leaves.iter().map(|leaf| leaf.0).collect()
}

fn the_sort_is_stable_across_sizes_and_duplicates() {
    let gpu = gpu();
    let sorter = Sorter::new(&gpu);
    for n in [0, 1, 2, 255, 256, 257, 1023, 1024, 1025, 70_000] {
        for distinct in [1, 3, 1 << 40] {
            let codes = codes(n, distinct);
            assert_eq!(sorted(&gpu, &sorter, &codes), sorted_by_cpu(&codes), "{n} codes, {distinct} distinct");
        }
    }
}

/// A million pairs, which take several slices of items: short codes with many duplicates, and long ones with few.
fn a_million_pairs_are_sorted_stably() {
    let gpu = gpu();
    let sorter = Sorter::new(&gpu);
    for distinct in [1000, 1 << 40] {
        let codes = codes(1 << 20, distinct);
        assert!(sorted(&gpu, &sorter, &codes) == sorted_by_cpu(&codes), "{distinct} distinct");
    }
}

fn the_comparison_detects_one_wrong_bit() {
    let gpu = gpu();
    let sorter = Sorter::new(&gpu);
    let codes = codes(1000, 1 << 40);
    let mut other = codes.clone();
    other[500] ^= 1 << 62;
    assert_ne!(sorted(&gpu, &sorter, &other), sorted_by_cpu(&codes));
}

/// Compares a model with the CPU: integers for codes of both lengths, oriented boxes with what is below them.
fn look_at(file: &str) {
    let (folder, gpu) = (scenes::folder(), gpu());
    let scene = canted_scene::read(&folder.join(file)).unwrap();
    let meshes: Vec<Mesh> =
        scene.meshes.into_iter().map(|mesh| Mesh { positions: mesh.positions, triangles: mesh.triangles }).collect();
    for bits in BOTH {
        assert_equal(&gpu, &twins(&meshes, bits), bits, file);
    }
    let twins = twins(&meshes, Bits::B63);
    for strategy in &STRATEGIES[1..] {
        assert_contained(&gpu, &twins, *strategy, file);
    }
}

fn the_bunny_is_built_as_on_the_cpu() {
    look_at("stanford/bunny.ply");
}

fn sponza_is_built_as_on_the_cpu() {
    look_at("sponza/sponza.obj");
}

fn the_kitchen_is_built_as_on_the_cpu() {
    look_at("kitchen/country_kitchen.glb");
}
