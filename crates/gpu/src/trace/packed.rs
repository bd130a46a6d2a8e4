//! Nodes as devices read them. Aligned nodes have the boxes of their children in bytes (`aligned`), oriented ones a frame of 32 bits for each
//! child (`frames`).
//!
//! | | CPU | device |
//! |---|---|---|
//! | aligned | 256 bytes | 96 bytes |
//! | oriented | 512 bytes | 256 bytes |

use std::collections::BTreeMap;

use canted_wide::RawBvh;

use super::aligned;
use super::frames::{NOWHERE, PackedBox, Slabs, unit_slabs};
use super::layout::{EMPTY, LEAF, WIDTH};

/// Words of the unit of node addresses on the CPU, which is a cache line, and on devices.
pub(super) const CPU_ADDRESS: usize = 16;
const ADDRESS: usize = 8;

/// Words of nodes of a device, aligned and oriented, and of the CPU.
const NODES: [usize; 2] = [24, 64];
const CPU_NODES: [usize; 2] = [64, 128];

/// Bit of the words of oriented nodes, and bits of their address.
const ORIENTED: u32 = 0x2000_0000;
pub(super) const ADDRESSES: u32 = 0x1fff_ffff;

/// Whether a word refers to a node.
pub(super) fn is_node(word: u32) -> bool {
    word & LEAF == 0 && word != EMPTY
}

pub(super) fn is_oriented(word: u32) -> bool {
    word & ORIENTED != 0
}

/// The first word of a node of a device.
pub(super) fn first_word(word: u32) -> usize {
    (word & ADDRESSES) as usize * ADDRESS
}

/// Whether all nodes below a root are aligned.
pub(super) fn are_aligned(nodes: &[u32], root: u32) -> bool {
    let mut waiting = vec![root];
    while let Some(word) = waiting.pop() {
        if is_node(word) {
            if is_oriented(word) {
                return false;
            }
            waiting.extend(children(nodes, word));
        }
    }
    true
}

/// A BVH of the CPU with the nodes of a device, in the same order.
pub(super) fn packed(bvh: RawBvh<'_>) -> RawBvh<'_> {
    let mut reached = nodes_below(bvh.root, |word| children_on_cpu(&bvh.nodes, word));
    reached.sort_unstable_by_key(|word| word & ADDRESSES);
    let mut n_words = 0;
    let first = |&word: &u32| {
        let first = n_words;
        n_words += n_words_of(NODES, word);
        (word, first)
    };
    let firsts: Vec<(u32, usize)> = reached.iter().map(first).collect();
    let moved = |word: u32| {
        let at = || firsts.binary_search_by_key(&(word & ADDRESSES), |(word, _)| word & ADDRESSES);
        let place = is_node(word).then(at).and_then(Result::ok);
        place.map_or(word, |place| word & !ADDRESSES | (firsts[place].1 / ADDRESS) as u32)
    };
    let mut nodes = Vec::with_capacity(n_words);
    for &word in &reached {
        let at = (word & ADDRESSES) as usize * CPU_ADDRESS;
        let row = |row: usize, child: usize| f32::from_bits(bvh.nodes[at + row * WIDTH + child]);
        let children = children_on_cpu(&bvh.nodes, word);
        nodes.extend(children.map(moved));
        if !is_oriented(word) {
            let ends = |i: usize| [0, 1].map(|end| [0, 2, 4].map(|axis| row(axis + end, i)));
            let boxes = std::array::from_fn(|i| (children[i] != EMPTY).then(|| ends(i)));
            nodes.extend(aligned::packed(&boxes, leaves_of(&children)));
            continue;
        }
        let boxes = children.iter().enumerate().map(|(i, &child)| {
            let slabs: Slabs = std::array::from_fn(|k| std::array::from_fn(|j| row(5 * k + j, i)));
            if child == EMPTY { NOWHERE } else { PackedBox::around(&slabs, bvh.reach) }
        });
        let boxes: Vec<PackedBox> = boxes.collect();
        nodes.extend(boxes.iter().map(|child| child.frame));
        let numbers = (0..6).flat_map(|row| boxes.iter().map(move |child| child.ends.as_flattened()[row].to_bits()));
        nodes.extend(numbers);
    }
    RawBvh { nodes: nodes.into(), root: moved(bvh.root), ..bvh }
}

/// Nodes of a device, and their root, with those of the CPU: boxes around the old ones, with rows of unit length.
///
/// # Errors
/// A word that names no node, or a node that marks other children as leaves than those that are.
pub(super) fn unpacked(nodes: &[u32], root: u32) -> Result<(Vec<u32>, u32), String> {
    let mut all = vec![];
    // The address of each node that was reached, by its word.
    let mut addresses = BTreeMap::new();
    let mut waiting = vec![root];
    while let Some(word) = waiting.pop() {
        if !is_node(word) || addresses.contains_key(&word) {
            continue;
        }
        let at = first_word(word);
        let node = nodes.get(at..at + n_words_of(NODES, word)).filter(|_| word & !ADDRESSES & !ORIENTED == 0);
        let node = node.ok_or_else(|| format!("word {word:#010x} names no node"))?;
        let (children, rest) = node.split_at(WIDTH);
        addresses.insert(word, (all.len() / CPU_ADDRESS) as u32);
        waiting.extend(children);
        let start = all.len();
        all.resize(start + n_words_of(CPU_NODES, word), 0);
        let of_aligned = rest.first_chunk().filter(|_| !is_oriented(word));
        if of_aligned.is_some_and(|words| aligned::leaves(words) != leaves_of(children)) {
            return Err(format!("node {word:#010x} marks other children as leaves"));
        }
        let boxes = of_aligned.map(aligned::unpacked);
        for i in 0..WIDTH {
            let rows: Vec<u32> = if let Some(boxes) = boxes {
                let [low, high] = boxes[i].unwrap_or([[BEYOND; 3], [-BEYOND; 3]]);
                low.iter().zip(high).flat_map(|(&low, high)| [low.to_bits(), high.to_bits()]).collect()
            } else {
                let end = |row: usize| f32::from_bits(rest[(1 + row) * WIDTH + i]);
                let slabs = unit_slabs(rest[i], std::array::from_fn(|k| [end(2 * k), end(2 * k + 1)]));
                slabs.as_flattened().iter().map(|x| x.to_bits()).collect()
            };
            rows.into_iter()
                .chain([children[i]])
                .enumerate()
                .for_each(|(row, bits)| all[start + row * WIDTH + i] = bits);
        }
    }
    let moved = |word: u32| addresses.get(&word).map_or(word, |address| word & ORIENTED | address);
    for (word, &address) in &addresses {
        let first = address as usize * CPU_ADDRESS + words_row(*word) * WIDTH;
        all[first..first + WIDTH].iter_mut().for_each(|child| *child = moved(*child));
    }
    Ok((all, moved(root)))
}

/// A bit for each child that is a leaf.
fn leaves_of(children: &[u32]) -> u8 {
    children.iter().enumerate().fold(0, |leaves, (i, child)| leaves | u8::from(child & LEAF != 0) << i)
}

/// Ends of boxes that no ray enters, beyond all coordinates.
const BEYOND: f32 = 9.223_372e18;

fn n_words_of([aligned, oriented]: [usize; 2], word: u32) -> usize {
    if is_oriented(word) { oriented } else { aligned }
}

/// The words of all nodes that are reached from a root, each once.
pub(super) fn nodes_below(root: u32, children: impl Fn(u32) -> [u32; WIDTH]) -> Vec<u32> {
    let mut reached = vec![];
    let mut waiting = vec![root];
    while let Some(word) = waiting.pop() {
        if is_node(word) {
            reached.push(word);
            waiting.extend(children(word));
        }
    }
    reached
}

/// The words of the children of a node of a device.
pub(super) fn children(nodes: &[u32], word: u32) -> [u32; WIDTH] {
    std::array::from_fn(|i| nodes[first_word(word) + i])
}

/// The row with the words of the children of a node of the CPU.
pub(super) fn words_row(word: u32) -> usize {
    if is_oriented(word) { 15 } else { 6 }
}

/// The words of the children of a node of the CPU.
fn children_on_cpu(nodes: &[u32], word: u32) -> [u32; WIDTH] {
    let first = (word & ADDRESSES) as usize * CPU_ADDRESS + words_row(word) * WIDTH;
    std::array::from_fn(|i| nodes[first + i])
}
