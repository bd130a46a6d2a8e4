//! Binary trees collapsed on the device, compared with a recursion on the CPU, word by word.

use std::{collections::BTreeMap, ops::RangeInclusive};

use canted_fixtures::{
    Mesh,
    device_tests::{Test, needs_device, needs_nothing},
    icosphere, soup,
};
use canted_gpu::{
    Gpu, block_on,
    build::{BuildConfig, BuildEncoder, Built, MAX_LEAF, Range, STRATEGIES, Topology, WideBvhs, WideConfig},
};
use canted_lbvh::{self as lbvh, Bits, Child, ChildKind, Corners, Strategy, Tree, VolumeConfig};
use canted_obb::{Aabb, flat_as_edge};

use crate::setup::{BOTH, Twin, gpu, large, meshes, needles, primitives, twins};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(wide_nodes_match_the_words_of_a_recursion),
        needs_device(the_comparison_detects_other_boxes_and_trees),
        needs_device(repeated_collapses_give_the_same_words),
        needs_device(oriented_nodes_enclose_their_triangles),
        needs_nothing(flaws_are_found),
    ]
}

const EMPTY: u32 = 0x7fff_ffff;
const LEAF: u32 = 0x8000_0000;

/// Words of nodes, aligned and oriented, and of the unit of their addresses.
const ALIGNED: usize = 24;
const ORIENTED: usize = 64;
const ADDRESS: usize = 8;

/// A tree with the boxes of its inner nodes and leaves.
struct Boxed<'a> {
    tree: &'a Tree,
    inner: Vec<Aabb>,
    leaves: Vec<Aabb>,
}

impl Boxed<'_> {
    fn of(twin: &Twin) -> Boxed<'_> {
        let leaves = twin.leaves();
        let inner = lbvh::volumes(&twin.tree, &leaves, &VolumeConfig::default()).aabbs;
        Boxed { tree: &twin.tree, inner, leaves: leaves.into_iter().map(Aabb::from_points).collect() }
    }

    fn aabb(&self, child: Child) -> Aabb {
        match child.kind() {
            ChildKind::Leaf(position) => self.leaves[position as usize],
            ChildKind::Inner(id) => self.inner[id.index()],
        }
    }

    /// First leaf position, and number of leaves.
    fn range(&self, child: Child) -> (u32, u32) {
        match child.kind() {
            ChildKind::Leaf(position) => (position, 1),
            ChildKind::Inner(id) => {
                let node = &self.tree.nodes[id.index()];
                (node.first, node.last - node.first + 1)
            }
        }
    }

    /// Opens the largest of the children that are no leaves, until there are eight.
    fn children(&self, slot: u32) -> Vec<Child> {
        let node = &self.tree.nodes[slot as usize];
        let mut children = vec![node.left, node.right];
        while children.len() < 8 {
            let area = |child: Child| {
                let Aabb { min, max } = self.aabb(child);
                let [x, y, z] = std::array::from_fn(|k| max[k] - min[k]);
                (x + z) * y + z * x
            };
            let open = (0..children.len()).filter(|&i| self.range(children[i]).1 > MAX_LEAF);
            // The first of equals.
            let Some(i) = open.reduce(|best, i| if area(children[i]) > area(children[best]) { i } else { best }) else {
                break;
            };
            let ChildKind::Inner(id) = children[i].kind() else { unreachable!("leaves are not opened") };
            let opened = &self.tree.nodes[id.index()];
            children[i] = opened.left;
            children.push(opened.right);
        }
        children
    }

    /// The children of each wide node, by slot, and the number of levels.
    fn collapse(&self) -> (BTreeMap<u32, [Option<Child>; 8]>, u32) {
        let (mut nodes, mut depth) = (BTreeMap::new(), 0);
        let mut open = vec![(0, 1)];
        while let Some((slot, level)) = open.pop() {
            if self.tree.leaves.len() <= MAX_LEAF as usize {
                break;
            }
            depth = depth.max(level);
            let children = self.children(slot);
            for &child in &children {
                if let (ChildKind::Inner(id), true) = (child.kind(), self.range(child).1 > MAX_LEAF) {
                    open.push((id.0, level + 1));
                }
            }
            nodes.insert(slot, self.placed(&children));
        }
        (nodes, depth)
    }

    /// Children toward the corners of their node: the lower half along the axis where twice their centers spread most, then the other half, and so on for
    /// the other axes.
    fn placed(&self, children: &[Child]) -> [Option<Child>; 8] {
        let center = |&child: &Child| {
            let Aabb { min, max } = self.aabb(child);
            std::array::from_fn::<f32, 3, _>(|k| min[k] + max[k])
        };
        let centers: Vec<[f32; 3]> = children.iter().map(center).collect();
        let spread = |k: usize| {
            let along = || centers.iter().map(|center| center[k]);
            along().fold(f32::NEG_INFINITY, f32::max) - along().fold(f32::INFINITY, f32::min)
        };
        let mut axes = [0, 1, 2];
        axes.sort_by(|&i, &j| spread(j).total_cmp(&spread(i)));
        let mut groups: Vec<(usize, Vec<usize>)> = vec![(0, (0..children.len()).collect())];
        for axis in axes {
            let halves = |(place, mut group): (usize, Vec<usize>)| {
                // Stable, and both zeros are equal.
                group.sort_by(|&i, &j| (centers[i][axis] + 0.0).total_cmp(&(centers[j][axis] + 0.0)));
                let mut high = group.split_off(group.len().div_ceil(2));
                high.sort_unstable();
                group.sort_unstable();
                [(place, group), (place | 1 << axis, high)]
            };
            groups = groups.into_iter().flat_map(halves).collect();
        }
        let mut placed = [None; 8];
        for (place, group) in groups {
            placed[place] = group.first().map(|&i| children[i]);
        }
        placed
    }
}

fn leaf(first: u32, n: u32) -> u32 {
    LEAF | (n - 1) << 26 | first
}

/// What the device makes of trees, as far as it is used.
#[derive(Default)]
struct Expected {
    nodes: BTreeMap<usize, u32>,
    /// Bytes of the boxes of nodes, whose last bit may depend on roundings.
    bytes: BTreeMap<usize, RangeInclusive<u8>>,
    triangles: BTreeMap<usize, u32>,
    depth: u32,
}

impl Expected {
    /// An aligned node from a word on, over children with these words and boxes.
    fn insert_node(&mut self, at: usize, children: [Option<(u32, Aabb)>; 8]) {
        let boxes = || children.iter().flatten().map(|(_, aabb)| aabb);
        let mut head = 0;
        for (child, found) in children.iter().enumerate() {
            let word = found.map_or(EMPTY, |(word, _)| word);
            self.nodes.insert(at + child, word);
            head |= (word >> 31) << (24 + child);
        }
        for k in 0..3 {
            let start = boxes().map(|aabb| aabb.min[k]).fold(f32::INFINITY, f32::min);
            let end = boxes().map(|aabb| aabb.max[k]).fold(f32::NEG_INFINITY, f32::max);
            let exponent = (27..=254).find(|&e| f64::from(power_of_two(e)) * 254.0 >= f64::from(end - start)).unwrap();
            self.nodes.insert(at + 8 + k, start.to_bits());
            head |= exponent << (8 * k);
            for (child, found) in children.iter().enumerate() {
                let [low, high] = found.map_or([255..=255, 0..=0], |(_, Aabb { min, max })| {
                    let steps = |x: f32| (f64::from(x) - f64::from(start)) / f64::from(power_of_two(exponent));
                    // A step of 2^-12 outward, of which roundings are a quarter.
                    let [small, large] = [0.75, 1.25].map(|slack| slack / 4096.0);
                    let byte = |steps: f64| steps.clamp(0.0, 255.0) as u8;
                    let (low, high) = (steps(min[k]), steps(max[k]));
                    [
                        byte((low - large).floor())..=byte((low - small).floor()),
                        byte((high + small).ceil())..=byte((high + large).ceil()),
                    ]
                });
                self.bytes.insert(4 * at + byte_of(child, k, 0), low);
                self.bytes.insert(4 * at + byte_of(child, k, 1), high);
            }
        }
        self.nodes.insert(at + 11, head);
    }
}

fn power_of_two(biased_exponent: u32) -> f32 {
    f32::from_bits(biased_exponent << 23)
}

/// The byte of a node with the low or high end of a child along an axis.
fn byte_of(child: usize, k: usize, end: usize) -> usize {
    let half = child / 4;
    let word = if k < 2 { 12 + 4 * half + 2 * k + end } else { 20 + 2 * half + end };
    4 * word + child % 4
}

fn expected(twins: &[Twin], ranges: &[Range], first_units: &[usize]) -> Expected {
    let boxed: Vec<Boxed<'_>> = twins.iter().map(Boxed::of).collect();
    let trees: Vec<_> = boxed.iter().map(Boxed::collapse).collect();
    // In the room of a tree, nodes come by slot, the root first.
    let mut units = BTreeMap::new();
    for ((tree, range), first_unit) in trees.iter().zip(ranges).zip(first_units) {
        for (i, slot) in tree.0.keys().enumerate() {
            units.insert(range.first + slot, first_unit + i);
        }
    }
    let mut expected = Expected::default();
    for (number, ((boxed, (wide, _)), range)) in boxed.iter().zip(&trees).zip(ranges).enumerate() {
        let unit = |slot: u32| units[&(range.first + slot)];
        for (&slot, children) in wide {
            let child = |found: Option<Child>| {
                found.map(|found| {
                    let (first, n) = boxed.range(found);
                    let word = match found.kind() {
                        ChildKind::Inner(id) if n > MAX_LEAF => u32::try_from(ALIGNED / ADDRESS * unit(id.0)).unwrap(),
                        _ => leaf(range.first + first, n),
                    };
                    (word, boxed.aabb(found))
                })
            };
            expected.insert_node(ALIGNED * unit(slot), children.map(child));
        }
        let leaves = wide.values().flatten().flatten().map(|&child| boxed.range(child)).filter(|&(_, n)| n <= MAX_LEAF);
        let n = range.count;
        let alone = (1..=MAX_LEAF).contains(&n).then_some((0, n));
        for (first, n) in leaves.chain(alone) {
            for position in first..first + n {
                let primitive = boxed.tree.leaves[position as usize];
                let corners = flat_as_edge(twins[number].primitives[primitive.index()]);
                let words = words_of_triangle(&corners, primitive.0);
                let at = 12 * (range.first + position) as usize;
                expected.triangles.extend(words.into_iter().enumerate().map(|(i, word)| (at + i, word)));
            }
        }
    }
    expected.depth = trees.iter().map(|tree| tree.1).max().unwrap_or(0);
    expected
}

/// The first difference between the words on the device and the CPU's.
fn unequal(what: &str, device: &[[u32; 4]], cpu: &BTreeMap<usize, u32>) -> Result<(), String> {
    let device = device.as_flattened();
    // Both zeros of where boxes start are equal, because the minimum of two zeros may be either.
    let is_start = |at: usize| what == "nodes" && (8..11).contains(&(at % ALIGNED));
    let same = |at: usize, a: u32, b: u32| a == b || is_start(at) && (a | b) == 1 << 31;
    for (&at, &word) in cpu {
        if device.get(at).is_none_or(|&found| !same(at, found, word)) {
            return Err(format!("{what}: word {at} is {:x?} for {word:x}", device.get(at)));
        }
    }
    Ok(())
}

/// Compares what the device makes of `there` with the CPU's result for `twins`.
fn compared(gpu: &Gpu, there: &[Twin], twins: &[Twin], bits: Bits) -> Result<(), String> {
    let mut build = BuildEncoder::new(gpu);
    let built = Built::new(&mut build, primitives(gpu, there), BuildConfig { bits, ..BuildConfig::default() }).unwrap();
    let wide = WideBvhs::new(&mut build, &built, None).unwrap();
    let (nodes, triangles) = (block_on(gpu.read(&wide.nodes)).unwrap(), block_on(gpu.read(&wide.triangles)).unwrap());
    // A root's word is where the room of its tree starts; trees without nodes need none.
    let first_units: Vec<usize> =
        wide.levels[0].roots.iter().map(|&root| root as usize / (ALIGNED / ADDRESS)).collect();
    let expected = expected(twins, built.primitives.ranges(), &first_units);
    unequal("nodes", &nodes, &expected.nodes)?;
    let found = |at: usize| nodes.as_flattened().get(at / 4).map_or(0, |word| word.to_le_bytes()[at % 4]);
    if let Some((&at, range)) = expected.bytes.iter().find(|&(&at, range)| !range.contains(&found(at))) {
        return Err(format!("nodes: byte {at} is {} for {range:?}", found(at)));
    }
    unequal("triangles", &triangles, &expected.triangles)?;
    let depths = block_on(wide.depths(gpu)).unwrap();
    if depths != [expected.depth] {
        return Err(format!("depth: {depths:?} for {}", expected.depth));
    }
    for (index, (twin, &root)) in twins.iter().zip(&wide.levels[0].roots).enumerate() {
        check(&Wide { nodes: &nodes, leaves: &triangles, root }, &twin.primitives)
            .map_err(|error| format!("tree {index}: {error}"))?;
    }
    Ok(())
}

fn wide_nodes_match_the_words_of_a_recursion() {
    let gpu = gpu();
    let same = |meshes: &[Mesh], bits, name: &str| {
        let twins = twins(meshes, bits);
        compared(&gpu, &twins, &twins, bits).unwrap_or_else(|error| panic!("{name}, {bits:?}: {error}"));
    };
    for bits in BOTH {
        same(&meshes(), bits, "generated");
    }
    same(&needles(), Bits::B63, "needles");
    for n in 0..12 {
        same(&[soup(7, n), soup(8, 3)], Bits::B63, &format!("{n} triangles"));
    }
    same(&[], Bits::B63, "no mesh");
    same(&[large(5, 30_000)], Bits::B63, "large");
    // Flat at both zeros.
    let zeros = |p: [f32; 3]| [p[0], p[1], 0.0 * p[0]];
    same(&[soup(9, 300).placed(zeros)], Bits::B63, "zeros");
}

/// One wrong number in the CPU's input, and where the comparison must report it.
fn the_comparison_detects_other_boxes_and_trees() {
    let gpu = gpu();
    type Spoil = fn(&mut Twin);
    let spoils: [(&str, Spoil); 3] = [
        ("nodes: ", |twin| twin.primitives[7][0][0] = 9.0),
        ("nodes: ", |twin| twin.tree.nodes.swap(3, 4)),
        ("triangles: ", |twin| twin.tree.leaves.swap(10, 11)),
    ];
    for (index, (stage, spoil)) in spoils.into_iter().enumerate() {
        let there = || twins(&[soup(1, 4), soup(2, 9), icosphere(2)], Bits::B63);
        let mut spoilt = there();
        spoil(&mut spoilt[2]);
        let error = compared(&gpu, &there(), &spoilt, Bits::B63).expect_err("the change is not seen");
        assert!(error.starts_with(stage), "{index}: {error}");
    }
}

/// Repeated builds give the same words, although levels are found in any order.
fn repeated_collapses_give_the_same_words() {
    let gpu = gpu();
    let twins = twins(&[large(6, 20_000), soup(8, 100)], Bits::B63);
    let words = || {
        let mut build = BuildEncoder::new(&gpu);
        let built = Built::new(&mut build, primitives(&gpu, &twins), BuildConfig::default()).unwrap();
        let wide = WideBvhs::new(&mut build, &built, None).unwrap();
        (block_on(gpu.read(&wide.nodes)).unwrap(), block_on(gpu.read(&wide.triangles)).unwrap(), wide.levels)
    };
    assert!(words() == words());
}

/// Needles have oriented nodes with every strategy, whose boxes hold what is below them.
fn oriented_nodes_enclose_their_triangles() {
    let gpu = gpu();
    let all = [needles(), meshes()].concat();
    let twins = twins(&all, Bits::B63);
    for (strategy, topology) in STRATEGIES.into_iter().zip([Topology::Radix, Topology::Ploc].into_iter().cycle()) {
        let mut build = BuildEncoder::new(&gpu);
        let config = BuildConfig { bits: Bits::B63, strategy };
        let built = Built::new(&mut build, primitives(&gpu, &twins), WideConfig { topology, ..config.into() }).unwrap();
        let wide = WideBvhs::new(&mut build, &built, None).unwrap();
        let (nodes, triangles) =
            (block_on(gpu.read(&wide.nodes)).unwrap(), block_on(gpu.read(&wide.triangles)).unwrap());
        let n_oriented: usize = twins
            .iter()
            .zip(&wide.levels[0].roots)
            .map(|(twin, &root)| {
                let checked = check(&Wide { nodes: &nodes, leaves: &triangles, root }, &twin.primitives);
                checked.unwrap_or_else(|error| panic!("{strategy:?}: {error}"))
            })
            .sum();
        assert_eq!(n_oriented > 100, strategy != Strategy::Aabb, "{strategy:?}: {n_oriented} oriented nodes");
    }
}

/// Words of one BVH.
pub(crate) struct Wide<'a> {
    pub(crate) nodes: &'a [[u32; 4]],
    /// Triangles in the order of leaves.
    pub(crate) leaves: &'a [[u32; 4]],
    pub(crate) root: u32,
}

/// The box of a child.
#[derive(Clone, Debug)]
enum Volume {
    /// Three lower planes, three upper.
    Aligned([[f64; 3]; 2]),
    /// For each axis its components, the center and the half-extent.
    Oriented([[f32; 5]; 3]),
}

/// Checks that each triangle is in one check_leaf, with its corners or as an edge if it has no area, and inside of all boxes above it. Returns the number of oriented
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
            for (id, corners) in check_leaf(wide.leaves, word)? {
                let expected = triangles.get(id as usize).ok_or(format!("no triangle {id}"))?;
                if corners != flat_as_edge(*expected) {
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
        let start = ADDRESS * (word & 0x1fff_ffff) as usize;
        let n_words = if is_oriented { ORIENTED } else { ALIGNED };
        let words = wide.nodes.as_flattened().get(start..start + n_words).ok_or(format!("no node {word:x}"))?;
        let children = &words[..8];
        let n_children = children.iter().filter(|&&word| word != EMPTY).count();
        if n_children < 2 {
            return Err(format!("node {word:x} has {n_children} children"));
        }
        for (i, &child) in children.iter().enumerate() {
            let volume = if is_oriented {
                let row = |k: usize| f32::from_bits(words[16 + 8 * k + i]);
                let axes = axes_of(words[8 + i]);
                Volume::Oriented(std::array::from_fn(|k| {
                    let [x, y, z] = axes[k];
                    [x, y, z, row(2 * k), row(2 * k + 1)]
                }))
            } else {
                if (child & LEAF != 0) != (words[11] >> (24 + i) & 1 != 0) {
                    return Err(format!("child {i} of node {word:x} is marked as what it is not"));
                }
                let end = |k: usize, end: usize| {
                    let at = byte_of(i, k, end);
                    let byte = f64::from(words[at / 4].to_le_bytes()[at % 4]);
                    if child == EMPTY {
                        return byte;
                    }
                    let step = power_of_two(words[11] >> (8 * k) & 255);
                    f64::from(f32::from_bits(words[8 + k])) + byte * f64::from(step)
                };
                Volume::Aligned([0, 1].map(|side| [0, 1, 2].map(|k| end(k, side))))
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
            Self::Aligned([low, high]) => (0..3).all(|k| low[k] <= p[k].into() && f64::from(p[k]) <= high[k]),
            Self::Oriented(slabs) => slabs.iter().all(|&[x, y, z, center, half]| {
                // Products are exact in f64, and sums err by less than what box tests add for rounding.
                let at: f64 = [x, y, z].iter().zip(p).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
                (at - f64::from(center)).abs() <= f64::from(half)
            }),
        };
        corners.iter().all(inside)
    }

    /// Whether no ray can enter the box, but for pads.
    fn is_nowhere(&self) -> bool {
        match self {
            Self::Aligned([low, high]) => (0..3).all(|k| low[k] > high[k]),
            Self::Oriented(slabs) => slabs.iter().all(|&[.., half]| half < -1e18),
        }
    }
}

/// The axes of a frame, by integers: the matrix of the quaternion `(2470, a, b, c)`, divided by 2^23.
fn axes_of(frame: u32) -> [[f32; 3]; 3] {
    let signed = |shift: u32| {
        let field = i64::from(frame >> shift & 0x7ff);
        if field < 1024 { field } else { field - 2048 }
    };
    let [w, x, y, z] = [2470, signed(0), signed(11), signed(21)];
    let rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ];
    // All are below 2^24, so they are exact.
    rows.map(|row| row.map(|x| x as f32 / 8_388_608.0))
}

/// Numbers and corners of the triangles of a check_leaf.
fn check_leaf(leaves: &[[u32; 4]], word: u32) -> Result<Vec<(u32, Corners)>, String> {
    let (n, first) = ((word >> 26 & 31) as usize + 1, (word & 0x03ff_ffff) as usize);
    let own = leaves.get(3 * first..3 * (first + n)).ok_or(format!("leaf {word:x} is outside of the triangles"))?;
    let triangle = |quads: &[[u32; 4]; 3]| (quads[0][3], quads.map(|[x, y, z, _]| [x, y, z].map(f32::from_bits)));
    Ok(own.as_chunks().0.iter().map(triangle).collect())
}

/// A triangle as leaves have it.
fn words_of_triangle(corners: &Corners, number: u32) -> [u32; 12] {
    let [a, b, c] = corners.map(|corner| corner.map(f32::to_bits));
    [a[0], a[1], a[2], number, b[0], b[1], b[2], 0, c[0], c[1], c[2], 0]
}

/// Each flaw is found in what was right before.
fn flaws_are_found() {
    let triangles: Vec<Corners> = (0u8..5)
        .map(|i| {
            let x = f32::from(i);
            [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 1.0]]
        })
        .collect();
    let (nodes, leaves) = by_hand(&triangles);
    let checked = |nodes: &[u32], leaves: &[u32], root: u32| {
        let quads = |words: &[u32]| words.chunks(4).map(|quad| quad.try_into().unwrap()).collect::<Vec<[u32; 4]>>();
        check(&Wide { nodes: &quads(nodes), leaves: &quads(leaves), root }, &triangles)
    };
    assert_eq!(checked(&nodes, &leaves, 0), Ok(0));
    let flaw = |change: &dyn Fn(&mut Vec<u32>, &mut Vec<u32>)| {
        let (mut nodes, mut leaves) = (nodes.clone(), leaves.clone());
        change(&mut nodes, &mut leaves);
        checked(&nodes, &leaves, 0).expect_err("the flaw is not seen")
    };
    // The high end along x of the first child, and both ends of the third.
    assert!(flaw(&|nodes, _| nodes[13] -= 1).contains("leaves the box"));
    assert!(flaw(&|nodes, _| nodes[12] &= !(0xff << 16)).contains("empty slot"));
    assert!(flaw(&|nodes, _| nodes[1] = nodes[0]).contains("leaves the box"));
    assert!(flaw(&|nodes, _| nodes[1] = EMPTY).contains("children"));
    assert!(flaw(&|nodes, _| unmarked(nodes, 400)).contains("no node"));
    assert!(flaw(&|nodes, _| nodes[1] = LEAF | 400).contains("outside of the triangles"));
    assert!(flaw(&|nodes, _| unmarked(nodes, 0)).contains("more nodes"));
    assert!(flaw(&|nodes, _| nodes[11] ^= 1 << 24).contains("marked"));
    assert!(flaw(&|_, leaves| leaves[3] = 4).contains("has corners"));
    assert!(flaw(&|_, leaves| leaves[12] = 7).contains("has corners"));
    assert!(flaw(&|nodes, _| nodes[0] &= !(1 << 26)).contains("triangle 3 is in 0 leaves"));
    assert!(checked(&nodes, &leaves, EMPTY).unwrap_err().contains("triangle 0 is in 0 leaves"));
}

/// Replaces a leaf by a word of a node.
fn unmarked(nodes: &mut [u32], word: u32) {
    nodes[1] = word;
    nodes[11] &= !(1 << 25);
}

/// One node over a leaf of four triangles and one of one. Its boxes start at the origin, and a step is 1.
fn by_hand(triangles: &[Corners]) -> (Vec<u32>, Vec<u32>) {
    let mut bytes = [0_u8; 4 * ALIGNED];
    for child in 0..8 {
        let planes = match child {
            0 => [[0, 4], [0, 1], [0, 1]],
            1 => [[4, 5], [0, 1], [0, 1]],
            _ => [[255, 0]; 3],
        };
        for (k, ends) in planes.into_iter().enumerate() {
            ends.into_iter().enumerate().for_each(|(end, byte)| bytes[byte_of(child, k, end)] = byte);
        }
    }
    let mut nodes: Vec<u32> = bytes.as_chunks().0.iter().map(|&word| u32::from_le_bytes(word)).collect();
    nodes[..8].fill(EMPTY);
    nodes[..2].copy_from_slice(&[LEAF | 3 << 26, LEAF | 4]);
    nodes[11] = 127 | 127 << 8 | 127 << 16 | 0b11 << 24;
    let leaves = (0u32..).zip(triangles).flat_map(|(id, corners)| words_of_triangle(corners, id)).collect();
    (nodes, leaves)
}
