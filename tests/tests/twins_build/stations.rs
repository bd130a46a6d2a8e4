//! Domain, codes, order and tree, each on what the CPU made before it, all meshes in one set of dispatches.

use canted_fixtures::{Mesh, SplitMix64, soup};
use canted_gpu::{
    Gpu,
    build::{self, Codes, Grid, Items, Node, Run},
};
use canted_lbvh::Bits;

use crate::setup::{Twin, gpu, items, large, meshes, shifted, words};

const BOTH: [Bits; 2] = [Bits::B30, Bits::B63];

fn twins(bits: Bits) -> Vec<Twin> {
    meshes().iter().map(|mesh| Twin::of(mesh, bits)).collect()
}

/// Codes as the device has them.
fn on_device(gpu: &Gpu, codes: [Vec<u32>; 2], bits: Bits) -> Codes {
    let [low, high] = codes.map(|word| gpu.buffer("codes", &word).unwrap());
    Codes { low, high: (bits == Bits::B63).then_some(high) }
}

fn read(gpu: &Gpu, codes: &Codes) -> [Vec<u32>; 2] {
    let low = gpu.read(&codes.low).unwrap();
    let high = codes.high.as_ref().map_or_else(|| vec![0; low.len()], |high| gpu.read(high).unwrap());
    [low, high]
}

fn grids(twins: &[Twin]) -> Vec<Grid> {
    // A mesh without triangles has no grid.
    let of = |twin: &Twin| Grid { offset: twin.domain.offset, scale: twin.domain.scale };
    let none = Grid { offset: [0.0; 3], scale: 0.0 };
    twins.iter().map(|twin| if twin.corners.is_empty() { none } else { of(twin) }).collect()
}

/// The bits, both zeros as one: which of two zeros is less no one says.
fn bits_of(grids: &[Grid]) -> Vec<[u32; 4]> {
    grids
        .iter()
        .map(|Grid { offset: [x, y, z], scale }| [x, y, z, scale].map(|number| (number + 0.0).to_bits()))
        .collect()
}

/// Compares every station with the CPU, each on the CPU's previous output.
fn compare(gpu: &Gpu, items: &Items, twins: &[Twin], bits: Bits) {
    let mut run = Run::new(gpu);
    let domains = build::domain(&mut run, items, bits).unwrap();
    assert_eq!(bits_of(&gpu.read(&domains).unwrap()), bits_of(&grids(twins)), "{bits:?}");

    let domains = gpu.buffer("domains", &grids(twins)).unwrap();
    let codes = build::codes(&mut run, items, &domains, bits).unwrap();
    let cpu_codes = words(twins.iter().flat_map(|twin| &twin.codes));
    assert_eq!(read(gpu, &codes), cpu_codes, "{bits:?}");

    let sorted = build::sort(&mut run, items, &on_device(gpu, cpu_codes, bits)).unwrap();
    let cpu_sorted = words(twins.iter().flat_map(|twin| &twin.sorted.codes));
    assert_eq!(read(gpu, &sorted.codes), cpu_sorted, "{bits:?}");
    let firsts = items.ranges().iter().map(|range| range.first);
    let pairs = || twins.iter().zip(firsts.clone());
    let leaves: Vec<u32> =
        pairs().flat_map(|(twin, first)| twin.sorted.leaves.iter().map(move |leaf| leaf.0 + first)).collect();
    assert_eq!(gpu.read(&sorted.leaves).unwrap(), leaves, "{bits:?}");

    let trees = build::tree(&mut run, items, &on_device(gpu, cpu_sorted, bits)).unwrap();
    let nodes = gpu.read(&trees.nodes).unwrap();
    for (index, (twin, first)) in pairs().enumerate() {
        let cpu = shifted(&twin.tree, first);
        assert_eq!(&nodes[first as usize..][..cpu.len()], cpu, "mesh {index}, {bits:?}");
    }
    check_parents(&nodes, &gpu.read(&trees.parents).unwrap(), items);
    let depth = twins.iter().map(|twin| twin.tree.depth).max().unwrap_or(0);
    assert_eq!(gpu.read(&trees.depth).unwrap(), [depth], "{bits:?}");
}

/// Whether each node's children name it as their parent.
fn check_parents(nodes: &[Node], parents: &[u32], items: &Items) {
    const LEAF: u32 = 1 << 31;
    let at = |child: u32| if child & LEAF == 0 { child as usize } else { nodes.len() + (child & !LEAF) as usize };
    for range in items.ranges() {
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

#[test]
fn every_station_makes_the_integers_of_the_cpu() {
    let Some(gpu) = gpu("every_station_makes_the_integers_of_the_cpu") else { return };
    for bits in BOTH {
        let twins = twins(bits);
        compare(&gpu, &items(&gpu, &twins), &twins, bits);
    }
}

#[test]
fn a_large_mesh_takes_several_slices() {
    let Some(gpu) = gpu("a_large_mesh_takes_several_slices") else { return };
    let twins = [Twin::of(&large(5, 300_000), Bits::B63)];
    compare(&gpu, &items(&gpu, &twins), &twins, Bits::B63);
}

#[test]
fn no_mesh_and_no_triangle_make_no_tree() {
    let Some(gpu) = gpu("no_mesh_and_no_triangle_make_no_tree") else { return };
    compare(&gpu, &items(&gpu, &[]), &[], Bits::B63);
    let empty = [Twin::of(&soup(1, 0), Bits::B63)];
    compare(&gpu, &items(&gpu, &empty), &empty, Bits::B63);
}

/// Scales from the least to the greatest that are promised, and numbers that round.
#[test]
fn grids_round_as_on_the_cpu() {
    let Some(gpu) = gpu("grids_round_as_on_the_cpu") else { return };
    let mut rng = SplitMix64::new(3);
    let mesh = |size: f32, seed: u64| {
        let mesh = soup(seed, 4);
        Mesh { positions: mesh.positions.iter().map(|p| p.map(|x| x * size)).collect(), ..mesh }
    };
    let meshes: Vec<Mesh> = (0..400)
        .map(|i| {
            #[expect(clippy::cast_possible_truncation, reason = "any size will do")]
            let size = (rng.signed() * 40.0).exp2() as f32;
            mesh(size, i)
        })
        .chain([1e-30, 1e-32, 1e-35, 0.0, 4.0e18].into_iter().map(|size| mesh(size, 1)))
        .collect();
    for bits in BOTH {
        let twins: Vec<Twin> = meshes.iter().map(|mesh| Twin::of(mesh, bits)).collect();
        let domains = build::domain(&mut Run::new(&gpu), &items(&gpu, &twins), bits).unwrap();
        let (device, cpu) = (gpu.read(&domains).unwrap(), grids(&twins));
        for (index, (device, cpu)) in device.iter().zip(&cpu).enumerate() {
            assert_eq!(bits_of(&[*device]), bits_of(&[*cpu]), "mesh {index}, {bits:?}: {device:?} for {cpu:?}");
        }
    }
}

#[test]
#[should_panic(expected = "mesh 2")]
fn the_comparison_sees_another_tree() {
    let Some(gpu) = gpu("the_comparison_sees_another_tree") else { panic!("mesh 2 was not looked at") };
    let mut twins: Vec<Twin> = [soup(1, 4), soup(2, 9), soup(3, 30)].iter().map(|m| Twin::of(m, Bits::B63)).collect();
    twins[2].tree.nodes.swap(3, 4);
    compare(&gpu, &items(&gpu, &twins), &twins, Bits::B63);
}
