use super::build::{Node, build};
use super::cluster::Cluster;
use super::glow::Receiver;

/// A binary tree over lights, for choosing one by what it might do to a point.
///
/// From the root down a child is chosen by its importance, so lights far off are told apart by the sums of their
/// clusters and near ones by themselves; after Conty Estevez and Kulla 2018 without their splitting, one light a choice.
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// The leaf of each light.
    leaves: Vec<u32>,
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
        let [first, second] = children.map(|child| self.nodes[child as usize].glow.importance(receiver));
        let sum = first + second;
        (sum > 0.0).then(|| [first / sum, second / sum])
    }
}
