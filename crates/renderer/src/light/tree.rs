use super::bounds::Receiver;
use super::build::{Node, build};
use super::cluster::Cluster;

/// A light tree: a binary tree for choosing one light by its estimated contribution to a point.
///
/// Sampling descends from the root and chooses a child by importance. Source: Conty Estevez and Kulla 2018, without
/// adaptive splitting: one light per choice.
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    /// The leaf of each light.
    pub(super) leaves: Vec<u32>,
}

impl Tree {
    /// `None` without lights. Ties are decided by the order of the lights.
    pub(super) fn new(lights: &[Cluster]) -> Option<Self> {
        let nodes = build(lights)?;
        let mut leaves = vec![0; lights.len()];
        for (number, node) in (0..).zip(&nodes) {
            if node.children.is_none() {
                leaves[node.light as usize] = number;
            }
        }
        Some(Self { nodes, leaves })
    }

    /// Chooses a light by a number in `[0, 1)`, with its probability; `None` if no light reaches the receiver.
    ///
    /// The probabilities of all lights sum to 1, except for clusters whose bounds reach the receiver while none of
    /// their lights does.
    pub(super) fn choose(&self, receiver: &Receiver, mut choice: f64) -> Option<(u32, f64)> {
        let mut node = &self.nodes[0];
        let mut probability = 1.0;
        while let Some(children) = node.children {
            let probabilities = self.child_probabilities(children, receiver)?;
            // A child of probability 0 is never chosen: then the other has probability 1.
            let second = usize::from(choice >= probabilities[0]);
            let before = if second == 1 { probabilities[0] } else { 0.0 };
            choice = ((choice - before) / probabilities[second]).clamp(0.0, 1.0 - f64::EPSILON);
            probability *= probabilities[second];
            node = &self.nodes[children[second] as usize];
        }
        Some((node.light, probability))
    }

    /// The probability that [`Self::choose`] returns `light`.
    pub(super) fn probability(&self, light: u32, receiver: &Receiver) -> f64 {
        let mut child = self.leaves[light as usize];
        let mut probability = 1.0;
        while let Some(parent) = self.nodes[child as usize].parent {
            let Some((children, probabilities)) = self.nodes[parent as usize]
                .children
                .and_then(|pair| Some((pair, self.child_probabilities(pair, receiver)?)))
            else {
                return 0.0;
            };
            probability *= probabilities[usize::from(children[1] == child)];
            child = parent;
        }
        probability
    }

    /// The probabilities of two siblings; `None` if both are 0.
    fn child_probabilities(&self, children: [u32; 2], receiver: &Receiver) -> Option<[f64; 2]> {
        let [first, second] = children.map(|child| self.nodes[child as usize].bounds.importance(receiver));
        let sum = first + second;
        (sum > 0.0).then(|| [first / sum, second / sum])
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::cone::Cone;
    use super::*;
    use crate::vector::{Vector, add, dot, length, scale, sub, unit};
    use crate::{Pattern, Sampler};

    /// A number in `[0, 1)` for each pair of indices.
    fn number(i: u32, k: u32) -> f64 {
        Sampler::new(Pattern::Random, 1, 1).single(i, 0, k).into()
    }

    fn direction(i: u32, k: u32) -> Vector {
        let [a, b, c] = [0, 1, 2].map(|j| number(i, k + j) - 0.5);
        unit([a, b, c]).unwrap()
    }

    /// One-sided and two-sided flat lights, points, and narrow spots in a box that is long along x.
    fn lights(n: u32) -> Vec<Cluster> {
        let light = |i: u32| {
            let center = [50.0 * number(i, 0), 5.0 * number(i, 1), 5.0 * number(i, 2)];
            let half = [0.3, 0.0, 0.1].map(|size| size * number(i, 3));
            let flat = Cone::about(direction(i, 4), i.is_multiple_of(2));
            let cone = match i % 4 {
                0 | 1 => flat,
                2 => Cone::ALL,
                _ => Cone { emission_rad: 0.3, ..flat },
            };
            Cluster { min: sub(center, half), max: add(center, half), cone, intensity: 10.0 * number(i, 8) + 0.1 }
        };
        (0..n).map(light).collect()
    }

    fn receivers() -> impl Iterator<Item = Receiver> {
        (100_000..100_040).map(|i| Receiver {
            position: [80.0 * number(i, 0) - 15.0, 10.0 * number(i, 1) - 2.5, 5.0 * number(i, 2)],
            normal: (i % 3 > 0).then(|| direction(i, 3)),
        })
    }

    /// What leaf probabilities lack to a sum of 1: nodes that promise a light, but none below them reaches the
    /// receiver.
    fn lost(tree: &Tree, receiver: &Receiver) -> f64 {
        let mut open = vec![(0, 1.0)];
        let mut lost = 0.0;
        while let Some((number, probability)) = open.pop() {
            let Some(children) = tree.nodes[number as usize].children else { continue };
            match tree.child_probabilities(children, receiver) {
                Some(probabilities) => open.extend([0, 1].map(|k| (children[k], probability * probabilities[k]))),
                None => lost += probability,
            }
        }
        lost
    }

    /// Up to fifteen levels; probabilities are rounded when computed and when multiplied, on both sides of a
    /// comparison.
    const PROBABILITY_ERROR: f64 = 30.0 * f64::EPSILON;

    #[test]
    fn probabilities_sum_to_one() {
        for n in [1, 2, 3, 100, 1000] {
            let lights = lights(n);
            let tree = Tree::new(&lights).unwrap();
            for receiver in receivers() {
                let sum: f64 = (0..n).map(|light| tree.probability(light, &receiver)).sum();
                let lost = lost(&tree, &receiver);
                let bound = PROBABILITY_ERROR + f64::from(n) * f64::EPSILON;
                assert!((sum + lost - 1.0).abs() <= bound, "{n}: {sum} {lost}");
            }
        }
    }

    /// Evenly spaced choices find each light with its probability, and return that probability.
    #[test]
    fn choices_match_probabilities() {
        const STEPS: u32 = 20_000;
        let tree = Tree::new(&lights(50)).unwrap();
        for receiver in receivers() {
            let mut counts = [0_u32; 50];
            for i in 0..STEPS {
                let choice = (f64::from(i) + 0.5) / f64::from(STEPS);
                let Some((light, probability)) = tree.choose(&receiver, choice) else { continue };
                counts[light as usize] += 1;
                assert!((tree.probability(light, &receiver) / probability - 1.0).abs() <= PROBABILITY_ERROR);
            }
            for (light, count) in (0..).zip(counts) {
                let expected = tree.probability(light, &receiver) * f64::from(STEPS);
                // A light covers one interval of choices; each end may add or drop one step.
                assert!((f64::from(count) - expected).abs() <= 1.0 + 1e-6, "{light}: {count} {expected}");
            }
        }
    }

    /// Whether a light at some corner of its box, emitting along its axis, irradiates a receiver.
    fn reaches(light: &Cluster, receiver: &Receiver) -> bool {
        let corners =
            (0..8).map(|i| std::array::from_fn(|k| if i >> k & 1 == 1 { light.max[k] } else { light.min[k] }));
        corners.into_iter().any(|corner: Vector| {
            let offset = sub(receiver.position, corner);
            let towards = scale(offset, 1.0 / length(offset));
            let cosine = dot(light.cone.axis, towards);
            let cosine = if light.cone.is_two_sided { cosine.abs() } else { cosine };
            let emits = light.cone.spread_rad == PI || cosine > light.cone.emission_rad.cos() + 1e-6;
            emits && receiver.normal.is_none_or(|normal| dot(normal, towards) < -1e-6)
        })
    }

    /// A light that can reach a receiver has a positive probability.
    #[test]
    fn reaching_lights_have_positive_probability() {
        let lights = lights(1000);
        let tree = Tree::new(&lights).unwrap();
        let mut n_reached = 0;
        for receiver in receivers() {
            for (number, light) in (0..).zip(&lights) {
                if reaches(light, &receiver) {
                    assert!(tree.probability(number, &receiver) > 0.0, "{light:?} {receiver:?}");
                    n_reached += 1;
                }
            }
        }
        assert!(n_reached > 1000);
    }

    /// The test above detects cones that do not grow.
    #[test]
    fn test_detects_narrow_cone() {
        let lights = lights(1000);
        let axis = [1.0, 0.0, 0.0];
        let narrow: Vec<Cluster> =
            lights.iter().map(|light| Cluster { cone: Cone::about(axis, false), ..*light }).collect();
        let tree = Tree::new(&narrow).unwrap();
        let is_lost = |receiver: &Receiver| {
            (0..)
                .zip(&lights)
                .any(|(number, light)| reaches(light, receiver) && tree.probability(number, receiver) == 0.0)
        };
        assert!(receivers().any(|receiver| is_lost(&receiver)));
    }

    /// Each light has one leaf, parent links are correct, and coinciding lights do not make the tree too deep.
    #[test]
    fn tree_is_valid() {
        let mut doubled = lights(300);
        let one = doubled[7];
        doubled.extend(vec![one; 300]);
        // Positions that grow by factors of 100 are split off one at a time, until the depth limit.
        doubled.extend((0..60).map(|i| {
            let far = [100.0_f64.powi(i), 0.0, 0.0];
            Cluster { min: far, max: far, ..one }
        }));
        let tree = Tree::new(&doubled).unwrap();
        assert_eq!(tree.nodes.len(), 2 * doubled.len() - 1);
        let mut leaves = vec![0; doubled.len()];
        for (number, node) in (0..).zip(&tree.nodes) {
            match node.children {
                Some(children) => assert!(children.iter().all(|&c| tree.nodes[c as usize].parent == Some(number))),
                None => leaves[node.light as usize] += 1,
            }
        }
        assert!(leaves.iter().all(|&n| n == 1));
        let depth = |mut node: u32| {
            let mut depth = 0;
            while let Some(parent) = tree.nodes[node as usize].parent {
                (node, depth) = (parent, depth + 1);
            }
            depth
        };
        assert!(tree.leaves.iter().all(|&leaf| depth(leaf) <= 40 + 10));
        assert!(Tree::new(&[]).is_none());
    }
}
