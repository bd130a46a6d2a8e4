//! The first difference between the device and the CPU, by stage.

use std::fmt::Debug;

use canted_gpu::{
    Gpu,
    build::{self, BuildConfig, BuildEncoder, Built, Codes, Grid, Node, Primitives, Trees},
};
use canted_lbvh::{self as lbvh, Bits, Child, ChildKind, Leaf, Tree, VolumeConfig};

use crate::setup::{Twin, primitives, words};

/// Codes in the device's layout.
fn on_device(gpu: &Gpu, codes: [Vec<u32>; 2], bits: Bits) -> Codes {
    let [low, high] = codes.map(|word| gpu.buffer("codes", &word).unwrap());
    Codes { low, high: (bits == Bits::B63).then_some(high) }
}

fn read(gpu: &Gpu, codes: &Codes) -> [Vec<u32>; 2] {
    let low = gpu.read(&codes.low).unwrap();
    let high = codes.high.as_ref().map_or_else(|| vec![0; low.len()], |high| gpu.read(high).unwrap());
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
    unequal("grids", &bits_of(&gpu.read(&domains).unwrap()), &bits_of(&grids(twins)))?;

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
    unequal("leaves", &gpu.read(&sorted.leaves).unwrap(), &leaves(primitives, twins))?;

    let trees = build::tree(&mut build, primitives, &on_device(gpu, cpu_sorted, bits)).unwrap();
    topology(gpu, primitives, &trees, twins)
}

/// Compares trees built from end to end.
///
/// # Errors
/// The first difference from the CPU: leaves, nodes or axis-aligned boxes.
pub(crate) fn end_to_end<L: Leaf>(gpu: &Gpu, built: &Built, twins: &[Twin<L>]) -> Result<(), String> {
    unequal("leaves", &gpu.read(&built.leaves).unwrap(), &leaves(&built.primitives, twins))?;
    topology(gpu, &built.primitives, &built.trees, twins)?;
    let aabbs = gpu.read(&built.aabbs).unwrap();
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
    let built =
        Built::new(&mut BuildEncoder::new(gpu), primitives(gpu, twins), BuildConfig { bits, ..BuildConfig::default() });
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
    let nodes = gpu.read(&trees.nodes).unwrap();
    for (index, (twin, range)) in twins.iter().zip(primitives.ranges()).enumerate() {
        let cpu = shifted(&twin.tree, range.first);
        unequal(&format!("nodes of tree {index}"), &nodes[range.first as usize..][..cpu.len()], &cpu)?;
    }
    check_parents(&nodes, &gpu.read(&trees.parents).unwrap(), primitives);
    let depth = twins.iter().map(|twin| twin.tree.depth).max().unwrap_or(0);
    unequal("depth", &gpu.read(&trees.depth).unwrap(), &[depth])
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
