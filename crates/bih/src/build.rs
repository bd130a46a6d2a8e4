//! The recursion of the build: primitives to nodes.

use canted_lbvh::par;

use crate::BihConfig;
use crate::node::{Node, lower_plane, upper_plane};
use crate::partition::{Content, Item};
use crate::split::{Decision, Region, decide, halve};

/// Greatest number of nodes on a path from the root to a leaf, the leaf and clip nodes included.
///
/// Departure from the source, which names a limit but no value: where the levels that are left are just enough to halve the
/// primitives by count, they are halved by count. So no input exceeds the depth, and leaves keep their size.
pub(crate) const MAX_DEPTH: u32 = 64;

/// Fewest primitives of a node whose children are built in parallel.
const FORK: usize = 1 << 12;

/// More primitives than this get no clip nodes, so that distances between nodes fit 32 bits: without them there are at most two
/// nodes a primitive, with them at most five.
const MAX_CLIPPED: usize = 1 << 29;

/// Levels that suffice to halve any number of primitives by count: 2^30 take 31.
const ALWAYS_ENOUGH: u32 = 32;

/// Builds the nodes over `items`, which it reorders into leaf order. At least one item. Returns the height, too.
///
/// `pad` is the part of the padding that planes carry, relative to the reach of their content.
pub(crate) fn build(items: &mut [Item], content: Content, config: &BihConfig, pad: f64) -> (Vec<Node>, u32) {
    let factor = if items.len() > MAX_CLIPPED { f32::INFINITY } else { config.factor() };
    let builder = Builder { max_leaf: config.max_leaf(items.len()), factor, pad, fork: par::n_threads() > 1 };
    let mut nodes = Vec::with_capacity(2 * items.len().div_ceil(builder.max_leaf));
    let mut region = Region { space: content.bounds, visible: content.bounds, content };
    let height = builder.subtree(items, 0, &mut region, MAX_DEPTH, &mut nodes);
    (nodes, height)
}

struct Builder {
    max_leaf: usize,
    factor: f32,
    pad: f64,
    /// Whether there are several threads. Joining their nodes changes no bit.
    fork: bool,
}

impl Builder {
    /// Appends the subtree over `items`, whose first reference is `first`; returns its height. `levels` is the greatest height that
    /// is allowed.
    ///
    /// Holds: `levels` suffice to halve the items by count.
    fn subtree(&self, items: &mut [Item], first: u32, region: &mut Region, levels: u32, nodes: &mut Vec<Node>) -> u32 {
        if items.len() <= self.max_leaf {
            nodes.push(Node::leaf(first, items.len() as u32));
            return 1;
        }
        let must_halve = levels < ALWAYS_ENOUGH && levels <= self.halving_levels(items.len());
        let decision = if must_halve { halve(items) } else { decide(items, region, self.factor) };
        match decision {
            Decision::Leaf => {
                nodes.push(Node::leaf(first, items.len() as u32));
                1
            }
            Decision::Clip { axis } => {
                let [min, max] = [region.content.bounds.min[axis], region.content.bounds.max[axis]];
                let pad = self.pad * f64::from(region.content.reach);
                nodes.push(Node::clip(axis, [upper_plane(max, pad), lower_plane(min, pad)]));
                for aabb in [&mut region.space, &mut region.visible] {
                    (aabb.min[axis], aabb.max[axis]) = (min, max);
                }
                1 + self.subtree(items, first, region, levels - 1, nodes)
            }
            Decision::Split { axis, split, n_left } => {
                let (left_items, right_items) = items.split_at_mut(n_left);
                let [left, right] = [Content::of(left_items), Content::of(right_items)];
                let (left_max, right_min) = (left.bounds.max[axis], right.bounds.min[axis]);
                let planes = [
                    upper_plane(left_max, self.pad * f64::from(left.reach)),
                    lower_plane(right_min, self.pad * f64::from(right.reach)),
                ];
                let mut right_region = Region { content: right, ..*region };
                let left_region = region;
                left_region.content = left;
                (left_region.space.max[axis], left_region.visible.max[axis]) = (split, left_max);
                (right_region.space.min[axis], right_region.visible.min[axis]) = (split, right_min);
                let at = nodes.len();
                // The distance to the second child is known after the first.
                nodes.push(Node::clip(axis, planes));
                let right_first = first + n_left as u32;
                let (heights, second);
                if self.fork && left_items.len() + right_items.len() > FORK {
                    let mut right_nodes = vec![];
                    heights = par::join(
                        || self.subtree(left_items, first, left_region, levels - 1, nodes),
                        || self.subtree(right_items, right_first, &mut right_region, levels - 1, &mut right_nodes),
                    );
                    second = nodes.len();
                    nodes.extend_from_slice(&right_nodes);
                } else {
                    let left_height = self.subtree(left_items, first, left_region, levels - 1, nodes);
                    second = nodes.len();
                    let right_height = self.subtree(right_items, right_first, &mut right_region, levels - 1, nodes);
                    heights = (left_height, right_height);
                }
                nodes[at] = Node::split(axis, (second - at) as u32, planes);
                1 + heights.0.max(heights.1)
            }
        }
    }

    /// Levels that halving `n` items by count takes, the leaf included.
    fn halving_levels(&self, n: usize) -> u32 {
        n.div_ceil(self.max_leaf).next_power_of_two().trailing_zeros() + 1
    }
}

#[cfg(test)]
mod tests {
    //! The build against a literal version of the corrected algorithm, and what bounds it.

    use super::*;
    use crate::node::NodeKind;
    use crate::{BoxBih, LeafSize, check};
    use canted_fixtures::{
        Mesh, SplitMix64, coplanar_quads, equal_centroids, hair, identical, outlier, slivers, soup, torus,
    };
    use canted_obb::Aabb;

    fn boxes(mesh: &Mesh) -> Vec<Aabb> {
        mesh.triangles.iter().map(|t| Aabb::from_points(t.map(|v| mesh.positions[v as usize]))).collect()
    }

    fn config(leaf_size: u32, tight_factor: f32) -> BihConfig {
        BihConfig { leaf_size: LeafSize::AtMost(leaf_size), tight_factor, ..BihConfig::default() }
    }

    /// A BIH whose planes are not padded.
    fn bare(boxes: &[Aabb], config: &BihConfig) -> BoxBih {
        let items: Vec<Item> = (0..).zip(boxes).map(|(i, aabb)| Item::new(i, aabb)).collect();
        let content = Content::of(&items);
        BoxBih::with_pad(items, content, config, 0.0)
    }

    /// Boxes of whole numbers: equal ones, flat ones, points, centers on split planes.
    fn whole_numbers(seed: u16, n: usize, range: usize) -> Vec<Aabb> {
        let mut rng = SplitMix64::new(seed.into());
        let mut boxes = vec![];
        for _ in 0..n {
            let min: [f32; 3] = std::array::from_fn(|_| rng.below(range) as f32);
            boxes.push(Aabb { min, max: min.map(|x| x + rng.below(4) as f32) });
            if rng.below(5) == 0 {
                boxes.push(boxes[rng.below(boxes.len())]);
            }
        }
        boxes
    }

    /// What a node of the literal build is.
    #[derive(Debug, PartialEq)]
    enum Literal {
        /// Sorted numbers of primitives.
        Leaf(Vec<u32>),
        /// Axis, upper plane, lower plane.
        Clip(usize, f32, f32),
        Split(usize, f32, f32),
    }

    /// More halvings than separate whole numbers or coordinates of fixtures.
    const PATIENCE: usize = 400;

    /// The source's build as corrected: a filter for every attempt, and nothing known before it.
    fn literal(
        boxes: &[Aabb],
        ids: &[u32],
        mut space: Aabb,
        mut visible: Aabb,
        config: &BihConfig,
        out: &mut Vec<Literal>,
    ) {
        let of = |id: u32| boxes[id as usize];
        let center = |id: u32, axis: usize| of(id).min[axis] + of(id).max[axis];
        let leaf = || {
            let mut ids = ids.to_vec();
            ids.sort_unstable();
            Literal::Leaf(ids)
        };
        if ids.len() <= config.max_leaf(ids.len()) {
            return out.push(leaf());
        }
        for _ in 0..PATIENCE {
            let axis = longest(&space);
            let split = 0.5 * (space.min[axis] + space.max[axis]);
            let (left, right): (Vec<u32>, Vec<u32>) = ids.iter().partition(|&&id| center(id, axis) < 2.0 * split);
            let greatest = |ids: &[u32]| ids.iter().map(|&id| of(id).max[axis]).fold(f32::NEG_INFINITY, f32::max);
            let least = |ids: &[u32]| ids.iter().map(|&id| of(id).min[axis]).fold(f32::INFINITY, f32::min);
            let (min, max) = (least(ids), greatest(ids));
            if (max - min) * config.factor() < visible.max[axis] - visible.min[axis] {
                out.push(Literal::Clip(axis, max, min));
                for aabb in [&mut space, &mut visible] {
                    (aabb.min[axis], aabb.max[axis]) = (min, max);
                }
                return literal(boxes, ids, space, visible, config, out);
            }
            if right.is_empty() {
                space.max[axis] = split;
            } else if left.is_empty() {
                space.min[axis] = split;
            } else {
                let (left_max, right_min) = (greatest(&left), least(&right));
                out.push(Literal::Split(axis, left_max, right_min));
                let (mut left_space, mut left_visible) = (space, visible);
                (left_space.max[axis], left_visible.max[axis]) = (split, left_max);
                literal(boxes, &left, left_space, left_visible, config, out);
                (space.min[axis], visible.min[axis]) = (split, right_min);
                return literal(boxes, &right, space, visible, config, out);
            }
        }
        let are_equal = ids.iter().all(|&id| (0..3).all(|k| center(id, k) == center(ids[0], k)));
        assert!(are_equal, "{PATIENCE} halvings do not separate {ids:?}");
        out.push(leaf());
    }

    fn longest(aabb: &Aabb) -> usize {
        let extent = |k: usize| aabb.max[k] - aabb.min[k];
        (0..3).rev().max_by(|&a, &b| extent(a).total_cmp(&extent(b))).expect("three axes")
    }

    fn read(bih: &BoxBih) -> Vec<Literal> {
        let read = |node: &Node| match node.kind() {
            NodeKind::Leaf { first, n } => {
                let mut ids: Vec<u32> = bih.primitives[first as usize..][..n as usize].iter().map(|id| id.0).collect();
                ids.sort_unstable();
                Literal::Leaf(ids)
            }
            NodeKind::Clip { axis } => Literal::Clip(axis, node.planes[0], node.planes[1]),
            NodeKind::Split { axis, .. } => Literal::Split(axis, node.planes[0], node.planes[1]),
        };
        bih.nodes.iter().map(read).collect()
    }

    #[test]
    fn nodes_are_those_of_the_literal_algorithm() {
        let (mut n_clips, mut n_noticed) = (0, 0);
        let mut inputs =
            vec![boxes(&soup(3, 400)), boxes(&slivers(2, 300)), boxes(&torus(15, 9)), boxes(&coplanar_quads(9))];
        inputs.extend((0..40).map(|seed| whole_numbers(seed, 60, 1 + usize::from(seed))));
        for boxes in &inputs {
            for (leaf_size, factor) in [(1, 1.3), (2, 1.0), (4, 2.0), (7, f32::INFINITY)] {
                let config = config(leaf_size, factor);
                let bih = bare(boxes, &config);
                let bounds = bih.bounds;
                let mut want = vec![];
                literal(boxes, &(0..).take(boxes.len()).collect::<Vec<u32>>(), bounds, bounds, &config, &mut want);
                assert_eq!(read(&bih), want);
                // The comparison notices another configuration.
                let other = BihConfig { leaf_size: LeafSize::AtMost(leaf_size + 1), ..config };
                n_noticed += usize::from(read(&bare(boxes, &other)) != want);
                n_clips += want.iter().filter(|node| matches!(node, Literal::Clip(..))).count();
            }
        }
        assert!(n_clips > 100 && n_noticed > 100, "{n_clips} clip nodes, {n_noticed} other configurations noticed");
    }

    /// Some children overlap, and between some is a gap.
    #[test]
    fn planes_are_coordinates_of_boxes() {
        let boxes = boxes(&soup(3, 400));
        let (mut n_gaps, mut n_overlaps) = (0, 0);
        for node in &bare(&boxes, &config(1, 1.3)).nodes {
            let (axis, is_split) = match node.kind() {
                NodeKind::Split { axis, .. } => (axis, true),
                NodeKind::Clip { axis } => (axis, false),
                NodeKind::Leaf { .. } => continue,
            };
            let [upper, lower] = node.planes;
            assert!(
                boxes.iter().any(|aabb| aabb.max[axis] == upper) && boxes.iter().any(|aabb| aabb.min[axis] == lower)
            );
            n_gaps += usize::from(is_split && upper < lower);
            n_overlaps += usize::from(is_split && upper > lower);
        }
        assert!(n_gaps > 10 && n_overlaps > 10, "{n_gaps} gaps, {n_overlaps} overlaps");
    }

    #[test]
    fn every_build_passes_the_checker() {
        let thin = hair(
            3,
            &canted_fixtures::Hair {
                n_strands: 20,
                n_segments: 6,
                width: 0.0006,
                strand: canted_fixtures::Strand::Tube,
            },
        );
        let meshes = [soup(1, 3_000), slivers(2, 500), outlier(500), equal_centroids(300), identical(300), thin];
        let inputs =
            meshes.iter().map(boxes).chain((0..20).map(|seed| whole_numbers(seed, 200, 1 + 3 * usize::from(seed))));
        for boxes in inputs {
            for (leaf_size, factor) in [(1, 1.3), (1, 1.0), (3, f32::INFINITY), (10, f32::NAN)] {
                let bih = BoxBih::build(&boxes, &config(leaf_size, factor)).unwrap();
                let stats = check(&bih, &boxes).unwrap();
                let centers = |id: &canted_obb::PrimId| {
                    let aabb = boxes[id.index()];
                    [0, 1, 2].map(|k| aabb.min[k] + aabb.max[k])
                };
                // Larger leaves hold equal centers only.
                for node in &bih.nodes {
                    if let NodeKind::Leaf { first, n } = node.kind()
                        && n > leaf_size
                    {
                        let ids = &bih.primitives[first as usize..][..n as usize];
                        assert!(ids.iter().all(|id| centers(id) == centers(&ids[0])), "{stats:?}");
                    }
                }
                assert!(stats.n_splits < boxes.len(), "{stats:?}");
            }
        }
    }

    /// As many triangles as the thesis asks for.
    #[test]
    fn a_hundred_thousand_triangles_pass_the_checker() {
        let boxes = boxes(&soup(1, 100_000));
        for (leaf_size, factor) in [(1, 1.3), (10, f32::INFINITY)] {
            let bih = BoxBih::build(&boxes, &config(leaf_size, factor)).unwrap();
            let stats = check(&bih, &boxes).unwrap();
            assert!((12..=40).contains(&stats.depth) && stats.n_splits < boxes.len(), "{stats:?}");
        }
    }

    /// Each halving of space separates one box from the others: without halving by count, hundreds of levels.
    fn geometric(n: usize) -> Vec<Aabb> {
        let mut boxes = vec![];
        for i in 0..n {
            let distance = 2.0f32.powi(-i32::try_from(i / 3 % 120).unwrap());
            let mut min = [0.0; 3];
            min[i % 3] = distance;
            boxes.push(Aabb { min, max: min });
        }
        boxes
    }

    #[test]
    fn no_input_exceeds_the_depth() {
        // A chain, then a cluster at its end that is as far from its neighbor as the chain allows.
        let mut rng = SplitMix64::new(5);
        let cluster = (0..20_000).map(|_| {
            let min: [f32; 3] = std::array::from_fn(|_| 2.0f32.powi(-120) * rng.unit() as f32);
            Aabb { min, max: min }
        });
        let boxes: Vec<Aabb> = geometric(360).into_iter().chain(cluster).collect();
        for (leaf_size, factor) in [(1, f32::INFINITY), (1, 1.0), (4, 1.3)] {
            let bih = BoxBih::build(&boxes, &config(leaf_size, factor)).unwrap();
            let stats = check(&bih, &boxes).unwrap();
            assert!(stats.largest_leaf <= leaf_size as usize, "{stats:?}");
            assert!(stats.depth > MAX_DEPTH / 2, "{stats:?}: the input is not hard");
        }
    }

    #[test]
    fn equal_primitives_are_one_leaf() {
        let n = 100_000;
        let boxes = vec![Aabb { min: [1.0, 2.0, 3.0], max: [1.5, 2.0, 4.0] }; n];
        let bih = BoxBih::build(&boxes, &BihConfig::default()).unwrap();
        let stats = check(&bih, &boxes).unwrap();
        assert_eq!((stats.n_leaves, stats.largest_leaf, stats.depth), (1, n, 1));
    }

    /// Larger than several forks, so that threads build parts of it.
    #[test]
    fn the_number_of_threads_changes_no_bit() {
        let boxes = boxes(&soup(8, 30_000));
        let build = |n_threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| BoxBih::build(&boxes, &config(2, 1.3)).unwrap())
        };
        let one = build(1);
        check(&one, &boxes).unwrap();
        for n_threads in [2, 3, 8] {
            let other = build(n_threads);
            assert!(one.nodes == other.nodes && one.primitives == other.primitives, "{n_threads} threads");
        }
    }
}
