use super::bounds::Receiver;
use super::build::{Node, build};
use super::cluster::Cluster;

/// A binary tree over lights, for choosing one by what it might do to a point.
///
/// From the root down a child is chosen by its importance, so lights far off are told apart by the sums of their
/// clusters and near ones by themselves; after Conty Estevez and Kulla 2018 without their splitting, one light a choice.
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    /// The leaf of each light.
    pub(super) leaves: Vec<u32>,
}

impl Tree {
    /// `None` without lights. The order of the lights decides ties, nothing else does.
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

    /// A light, from a number in `[0, 1)`, and the probability of it; `None` where no light reaches the receiver.
    ///
    /// Probabilities of all lights add up to 1, but for those of clusters that looked as if one of their lights might
    /// reach the receiver where none does.
    pub(super) fn choose(&self, receiver: &Receiver, mut choice: f64) -> Option<(u32, f64)> {
        let mut node = &self.nodes[0];
        let mut probability = 1.0;
        while let Some(children) = node.children {
            let shares = self.shares(children, receiver)?;
            // The second is taken only if it has a share: the first of a pair without a second has all of it.
            let second = usize::from(choice >= shares[0]);
            let before = if second == 1 { shares[0] } else { 0.0 };
            choice = ((choice - before) / shares[second]).clamp(0.0, 1.0 - f64::EPSILON);
            probability *= shares[second];
            node = &self.nodes[children[second] as usize];
        }
        Some((node.light, probability))
    }

    /// The probability with which [`Self::choose`] finds a light.
    pub(super) fn probability(&self, light: u32, receiver: &Receiver) -> f64 {
        let mut child = self.leaves[light as usize];
        let mut probability = 1.0;
        while let Some(parent) = self.nodes[child as usize].parent {
            let Some((children, shares)) =
                self.nodes[parent as usize].children.and_then(|pair| Some((pair, self.shares(pair, receiver)?)))
            else {
                return 0.0;
            };
            probability *= shares[usize::from(children[1] == child)];
            child = parent;
        }
        probability
    }

    /// The probabilities of two siblings; `None` where neither has any.
    fn shares(&self, children: [u32; 2], receiver: &Receiver) -> Option<[f64; 2]> {
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

    /// A number of the unit interval for each pair of indices.
    fn number(i: u32, k: u32) -> f64 {
        Sampler::new(Pattern::Random, 1, 1).single(i, 0, k).into()
    }

    fn direction(i: u32, k: u32) -> Vector {
        let [a, b, c] = [0, 1, 2].map(|j| number(i, k + j) - 0.5);
        unit([a, b, c]).unwrap()
    }

    /// Flat lights of one or two sides, points, and narrow spots, in a box that is long along x.
    fn lights(n: u32) -> Vec<Cluster> {
        let light = |i: u32| {
            let middle = [50.0 * number(i, 0), 5.0 * number(i, 1), 5.0 * number(i, 2)];
            let half = [0.3, 0.0, 0.1].map(|size| size * number(i, 3));
            let flat = Cone::about(direction(i, 4), i.is_multiple_of(2));
            let cone = match i % 4 {
                0 | 1 => flat,
                2 => Cone::ALL,
                _ => Cone { reach_rad: 0.3, ..flat },
            };
            Cluster { min: sub(middle, half), max: add(middle, half), cone, intensity: 10.0 * number(i, 8) + 0.1 }
        };
        (0..n).map(light).collect()
    }

    fn receivers() -> impl Iterator<Item = Receiver> {
        (100_000..100_040).map(|i| Receiver {
            position: [80.0 * number(i, 0) - 15.0, 10.0 * number(i, 1) - 2.5, 5.0 * number(i, 2)],
            normal: (i % 3 > 0).then(|| direction(i, 3)),
        })
    }

    /// What leaf probabilities lack to 1 is what inner nodes promise that no light below them keeps.
    fn lost(tree: &Tree, receiver: &Receiver) -> f64 {
        let mut open = vec![(0, 1.0)];
        let mut lost = 0.0;
        while let Some((number, probability)) = open.pop() {
            let Some(children) = tree.nodes[number as usize].children else { continue };
            match tree.shares(children, receiver) {
                Some(shares) => open.extend([0, 1].map(|k| (children[k], probability * shares[k]))),
                None => lost += probability,
            }
        }
        lost
    }

    /// Shares of up to fifteen levels, each rounded as it is found and as it is multiplied; twice, for one and the other.
    const PROBABILITY_ERROR: f64 = 30.0 * f64::EPSILON;

    #[test]
    fn probabilities_add_up_to_one() {
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

    /// Equal steps of the choice find each light as often as its probability says, and the probability with it.
    #[test]
    fn choices_follow_the_probabilities() {
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
                // A light is one interval of choices, and each end may take or leave one step.
                assert!((f64::from(count) - expected).abs() <= 1.0 + 1e-6, "{light}: {count} {expected}");
            }
        }
    }

    /// Irradiance of a light at a receiver if it were all in one corner of its box and shone along its axis.
    fn reaches(light: &Cluster, receiver: &Receiver) -> bool {
        let corners =
            (0..8).map(|i| std::array::from_fn(|k| if i >> k & 1 == 1 { light.max[k] } else { light.min[k] }));
        corners.into_iter().any(|corner: Vector| {
            let way = sub(receiver.position, corner);
            let towards = scale(way, 1.0 / length(way));
            let cosine = dot(light.cone.axis, towards);
            let cosine = if light.cone.is_two_sided { cosine.abs() } else { cosine };
            let shines = light.cone.spread_rad == PI || cosine > light.cone.reach_rad.cos() + 1e-6;
            shines && receiver.normal.is_none_or(|normal| dot(normal, towards) < -1e-6)
        })
    }

    /// No light that can reach a receiver is out of reach of the choice, whatever clusters it is in.
    #[test]
    fn no_light_is_lost() {
        let lights = lights(1000);
        let tree = Tree::new(&lights).unwrap();
        let mut n_reaching = 0;
        for receiver in receivers() {
            for (number, light) in (0..).zip(&lights) {
                if reaches(light, &receiver) {
                    assert!(tree.probability(number, &receiver) > 0.0, "{light:?} {receiver:?}");
                    n_reaching += 1;
                }
            }
        }
        assert!(n_reaching > 1000);
    }

    /// With cones that forget to grow, lights are lost, and the check above sees it.
    #[test]
    fn the_check_sees_a_narrow_cone() {
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

    /// Each light has one leaf, children know their parents, and equal lights make no endless tree.
    #[test]
    fn the_tree_is_whole() {
        let mut doubled = lights(300);
        let one = doubled[7];
        doubled.extend(vec![one; 300]);
        // Places each a hundred times as far as the last split off one by one until nodes are halved.
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
