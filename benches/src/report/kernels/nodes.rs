//! Boxes eight at a time: nodes of a case's boxes on every path, and nodes of equal boxes for a device.

use anyhow::Result;
use canted_obb::Aabb;
use canted_tests::extremes::slab::Pair;
use canted_trace::{ScaledRay, Watertight};
use canted_wide::{Config, Costs, SimdPath, TriangleBvh, WideBvh};

use super::contest::Test;
use super::lanes;

/// Boxes of a node.
pub(super) const LANES: usize = 8;

/// A node, and the pairs whose rays test it.
struct Node<'a> {
    tree: WideBvh<Aabb>,
    /// Its boxes are those of the pairs from this index on.
    first: usize,
    pairs: &'a [Pair],
}

impl Node<'_> {
    /// Calls `see` with the pairs whose boxes each ray enters, ray by ray.
    fn enter(&self, mut see: impl FnMut(usize, usize)) {
        for (i, (ray, _)) in self.pairs.iter().enumerate() {
            let Some(ray) = ScaledRay::new(ray) else { continue };
            self.tree.traverse_any(&ray, 0.0, &mut (), |number, t_max, ()| {
                see(i, self.first + number.index());
                t_max
            });
        }
    }
}

/// Nodes of eight boxes each; the last two nodes may overlap.
fn nodes<'a>(pairs: &'a [Pair], path: SimdPath) -> Result<Vec<(usize, Node<'a>)>> {
    let boxes: Vec<Aabb> = pairs.iter().map(|(_, obb)| obb.aabb()).collect();
    let last = boxes.len().saturating_sub(LANES);
    let node = |(i, own): (usize, &'a [Pair])| {
        let start = i * LANES;
        let first = start.min(last);
        let tree = WideBvh::<Aabb>::build(boxes[first..boxes.len().min(first + LANES)].to_vec(), &Config::default())?;
        Ok((start, Node { tree: tree.with_path(path), first, pairs: own }))
    };
    pairs.chunks(LANES).enumerate().map(node).collect()
}

/// Tests of a case on every path: whether each ray enters its own box among eight. The entry distance is not reported.
pub(super) fn tests(pairs: &[Pair]) -> Result<Vec<Test<'_, Option<f32>>>> {
    let test = |path: SimdPath| {
        let nodes = nodes(pairs, path)?;
        let mut answers = vec![None; pairs.len()];
        for (start, node) in &nodes {
            node.enter(|i, entered| {
                if start + i == entered {
                    answers[entered] = Some(f32::NAN);
                }
            });
        }
        let n_tests = LANES * pairs.len();
        let work = move || {
            let mut n_entered = 0u32;
            nodes.iter().for_each(|(_, node)| node.enter(|_, _| n_entered += 1));
            std::hint::black_box(n_entered);
        };
        Ok(Test {
            name: format!("its axis-aligned box, {}, of {LANES}", path.name()),
            answers,
            work: Box::new(work),
            n_tests,
        })
    };
    lanes::paths().0.into_iter().map(test).collect()
}

/// Each box eight times in a BVH of one node, as bounds of triangles, because devices only hold triangle BVHs.
pub(super) fn of_equal(boxes: &[Aabb]) -> Result<Vec<TriangleBvh<Watertight>>> {
    let costs = Costs { leaf: 0.0, max_leaf: 1, ..Costs::default() };
    let config = Config { costs, oriented: false, rotate_mesh: false, ..Config::default() };
    let of_one = |&Aabb { min, max }: &Aabb| {
        Ok(TriangleBvh::build(&[min, max, [min[0], max[1], min[2]]], &[[0, 1, 2]; LANES], &config)?)
    };
    boxes.iter().map(of_one).collect()
}

#[cfg(test)]
mod tests {
    use canted_obb::Obb;
    use canted_trace::Ray;

    use super::*;

    /// Eleven boxes one unit apart, so that the last three share a node with five others; every third ray misses its
    /// box.
    fn pairs() -> Vec<Pair> {
        let pair = |i: u8| {
            let center = [2.0 * f32::from(i), 0.0, 0.0];
            let x = center[0] + if i.is_multiple_of(3) { 0.9 } else { 0.1 };
            let obb = Obb { center, frame: Obb::IDENTITY_FRAME, half_extents: [0.5; 3] };
            (Ray::new([x, 0.0, -3.0], [0.0, 0.0, 1.0]), obb)
        };
        (0..11).map(pair).collect()
    }

    #[test]
    fn each_ray_tests_its_own_box_on_every_path() {
        let pairs = pairs();
        let found = tests(&pairs).unwrap();
        assert_eq!(found.len(), lanes::paths().0.len());
        for test in found {
            let entered: Vec<bool> = test.answers.iter().map(Option::is_some).collect();
            let wanted: Vec<bool> = (0..11usize).map(|i| !i.is_multiple_of(3)).collect();
            assert_eq!(entered, wanted, "{}", test.name);
            assert_eq!(test.n_tests, 88);
            (test.work)();
        }
    }

    #[test]
    fn equal_boxes_form_one_node() {
        let aabb = Aabb { min: [1.0, 2.0, 3.0], max: [4.0, 5.0, 3.0] };
        let tree = of_equal(&[aabb]).unwrap().remove(0);
        assert_eq!((tree.sizes().nodes, tree.aabb(), tree.n_primitives()), ([1, 0], aabb, LANES));
    }
}
