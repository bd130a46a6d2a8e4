//! A checker of wide nodes and blocks that were read back. It knows the layout, not how it was built.

use canted_fixtures::device_tests::{Test, needs_nothing};
use canted_lbvh::Corners;

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_nothing(flaws_are_found)]
}

const EMPTY: u32 = 0x7fff_ffff;
const LEAF: u32 = 0x8000_0000;

/// Words of one BVH.
pub(crate) struct Wide<'a> {
    pub(crate) nodes: &'a [[u32; 4]],
    pub(crate) blocks: &'a [[u32; 4]],
    pub(crate) root: u32,
}

/// The box of a child.
#[derive(Clone, Debug)]
enum Volume {
    /// Three lower planes, three upper.
    Aligned([[f32; 3]; 2]),
    /// For each axis its components, the center and the half-extent.
    Oriented([[f32; 5]; 3]),
}

/// Checks that each triangle is in one leaf, with its corners, and inside of all boxes above it. Returns the number of oriented
/// nodes.
///
/// # Errors
/// The first flaw.
pub(crate) fn check(wide: &Wide<'_>, triangles: &[Corners]) -> Result<usize, String> {
    let mut seen = vec![0; triangles.len()];
    let mut open: Vec<(u32, Vec<Volume>)> = vec![(wide.root, vec![])];
    let (mut n_nodes, mut n_oriented) = (0, 0);
    while let Some((word, above)) = open.pop() {
        if word == EMPTY {
            continue;
        }
        if word & LEAF != 0 {
            for (id, corners) in leaf(wide.blocks, word)? {
                let expected = triangles.get(id as usize).ok_or(format!("no triangle {id}"))?;
                if corners != *expected {
                    return Err(format!("triangle {id} has corners {corners:?} for {expected:?}"));
                }
                seen[id as usize] += 1;
                if let Some(volume) = above.iter().find(|volume| !volume.contains(&corners)) {
                    return Err(format!("triangle {id} leaves the box {volume:?}"));
                }
            }
            continue;
        }
        n_nodes += 1;
        if n_nodes > triangles.len() {
            return Err("more nodes than triangles".to_owned());
        }
        let is_oriented = match word >> 29 {
            0 => false,
            1 => true,
            _ => return Err(format!("{word:x} is no word")),
        };
        n_oriented += usize::from(is_oriented);
        let (size, first_word) = if is_oriented { (128, 120) } else { (64, 48) };
        let start = 16 * (word & 0x1fff_ffff) as usize;
        let words = wide.nodes.as_flattened().get(start..start + size).ok_or(format!("no node {word:x}"))?;
        let children = &words[first_word..first_word + 8];
        let n_children = children.iter().filter(|&&word| word != EMPTY).count();
        if n_children < 2 {
            return Err(format!("node {word:x} has {n_children} children"));
        }
        for (i, &child) in children.iter().enumerate() {
            let row = |k: usize| f32::from_bits(words[8 * k + i]);
            let volume = if is_oriented {
                Volume::Oriented(std::array::from_fn(|axis| std::array::from_fn(|k| row(5 * axis + k))))
            } else {
                Volume::Aligned([[row(0), row(2), row(4)], [row(1), row(3), row(5)]])
            };
            if child == EMPTY {
                if !volume.is_nowhere() {
                    return Err(format!("an empty slot of node {word:x} has the box {volume:?}"));
                }
                continue;
            }
            let mut boxes = above.clone();
            boxes.push(volume);
            open.push((child, boxes));
        }
    }
    match seen.iter().position(|&n| n != 1) {
        None => Ok(n_oriented),
        Some(triangle) => Err(format!("triangle {triangle} is in {} leaves", seen[triangle])),
    }
}

impl Volume {
    fn contains(&self, corners: &Corners) -> bool {
        let inside = |p: &[f32; 3]| match self {
            Self::Aligned([low, high]) => (0..3).all(|k| low[k] <= p[k] && p[k] <= high[k]),
            Self::Oriented(slabs) => slabs.iter().all(|&[x, y, z, center, half]| {
                // Products are exact in f64, and sums err by less than what box tests add for rounding.
                let at: f64 = [x, y, z].iter().zip(p).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
                (at - f64::from(center)).abs() <= f64::from(half)
            }),
        };
        corners.iter().all(inside)
    }

    /// Whether no ray can enter the box.
    fn is_nowhere(&self) -> bool {
        match self {
            Self::Aligned([low, high]) => (0..3).all(|k| low[k] > 1e18 && high[k] < -1e18),
            Self::Oriented(slabs) => slabs.iter().all(|&[x, y, z, _, half]| [x, y, z] == [0.0; 3] && half < -1e18),
        }
    }
}

/// Numbers and corners of the triangles of a leaf.
fn leaf(blocks: &[[u32; 4]], word: u32) -> Result<Vec<(u32, Corners)>, String> {
    let (n, part) = ((word >> 26 & 31) as usize + 1, (word & 0x03ff_ffff) as usize);
    let words = blocks.as_flattened();
    let triangle = |i: usize| {
        let (at, step) =
            if i / 8 * 8 + 4 >= n { (i / 4 * 40 + part % 2 * 2 + i % 4, 4) } else { (i / 8 * 80 + i % 8, 8) };
        let word = |row: usize| words.get(part / 2 * 40 + at + row * step).copied();
        let row = |row: usize| word(row).map(f32::from_bits);
        let point = |k: usize| Some([row(3 * k)?, row(3 * k + 1)?, row(3 * k + 2)?]);
        let corners = || Some((word(9)?, [point(0)?, point(1)?, point(2)?]));
        corners().ok_or(format!("the leaf {word:x?} is outside of the blocks", word = part))
    };
    (0..n).map(triangle).collect()
}

/// Each flaw is found in what was right before.
fn flaws_are_found() {
    let triangles: Vec<Corners> = (0u8..5)
        .map(|i| {
            let x = f32::from(i);
            [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 1.0]]
        })
        .collect();
    let (nodes, blocks) = by_hand(&triangles);
    let checked = |nodes: &[u32], blocks: &[u32], root: u32| {
        let quads = |words: &[u32]| words.chunks(4).map(|quad| quad.try_into().unwrap()).collect::<Vec<[u32; 4]>>();
        check(&Wide { nodes: &quads(nodes), blocks: &quads(blocks), root }, &triangles)
    };
    assert_eq!(checked(&nodes, &blocks, 0), Ok(0));
    let flaw = |change: &dyn Fn(&mut Vec<u32>, &mut Vec<u32>)| {
        let (mut nodes, mut blocks) = (nodes.clone(), blocks.clone());
        change(&mut nodes, &mut blocks);
        checked(&nodes, &blocks, 0).expect_err("the flaw is not seen")
    };
    assert!(flaw(&|nodes, _| nodes[8] = 3.9f32.to_bits()).contains("leaves the box"));
    assert!(flaw(&|nodes, _| nodes[49] = nodes[48]).contains("leaves the box"));
    assert!(flaw(&|nodes, _| nodes[49] = EMPTY).contains("children"));
    assert!(flaw(&|nodes, _| nodes[49] = 400).contains("no node"));
    assert!(flaw(&|nodes, _| nodes[49] = LEAF | 400).contains("outside of the blocks"));
    assert!(flaw(&|nodes, _| nodes[49] = 0).contains("more nodes"));
    assert!(flaw(&|nodes, _| nodes[2] = 0).contains("empty slot"));
    assert!(flaw(&|_, blocks| blocks[36] = 4).contains("has corners"));
    assert!(flaw(&|_, blocks| blocks[3] = 7).contains("has corners"));
    assert!(flaw(&|nodes, _| nodes[48] &= !(1 << 26)).contains("triangle 3 is in 0 leaves"));
    assert!(checked(&nodes, &blocks, EMPTY).unwrap_err().contains("triangle 0 is in 0 leaves"));
}

/// One node over a leaf of four triangles and one of one.
fn by_hand(triangles: &[Corners]) -> (Vec<u32>, Vec<u32>) {
    let (mut nodes, mut blocks) = (vec![0; 64], vec![0; 80]);
    for child in 0..8 {
        let planes = match child {
            0 => [[0.0, 4.0], [0.0, 1.0], [0.0, 1.0]],
            1 => [[4.0, 5.0], [0.0, 1.0], [0.0, 1.0]],
            _ => [[9e18, -9e18]; 3],
        };
        for (row, x) in planes.as_flattened().iter().enumerate() {
            nodes[8 * row + child] = f32::to_bits(*x);
        }
        nodes[48 + child] = [LEAF | 3 << 26, LEAF | 2].get(child).copied().unwrap_or(EMPTY);
    }
    for (id, corners) in (0u32..).zip(triangles) {
        let at = (id / 4 * 40 + id % 4) as usize;
        for (row, x) in corners.as_flattened().iter().enumerate() {
            blocks[at + 4 * row] = x.to_bits();
        }
        blocks[at + 36] = id;
    }
    (nodes, blocks)
}
