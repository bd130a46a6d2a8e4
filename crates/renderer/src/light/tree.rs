//! A light tree: chooses one light by its estimated contribution to a point; twin of `shared/light/tree.wgsl`.
//!
//! ```text
//! lights -> Cluster (box, Cone, intensity) -> build -> Tree, whose nodes have LightBounds -> one light for a Receiver
//! ```
//!
//! Source: Conty Estevez and Kulla 2018, *Importance Sampling of Many Lights with Adaptive Tree Splitting*, without adaptive
//! splitting: one light per choice.

use std::f64::consts::PI;

#[cfg(feature = "gpu")]
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

#[cfg(feature = "gpu")]
use crate::narrow;
use crate::wide;

/// A binary tree of lights. Sampling descends from the root and chooses a child by importance.
pub(crate) struct Tree {
    nodes: Vec<Node>,
    /// The leaf of each light.
    pub(crate) leaves: Vec<u32>,
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

/// `LightNode` of `shared/light/tree`, which documents the members.
#[cfg(feature = "gpu")]
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct LightNode {
    pub(crate) center: [f32; 3],
    pub(crate) radius: f32,
    pub(crate) axis: [f32; 3],
    pub(crate) cos_emission: f32,
    pub(crate) spread: [f32; 2],
    pub(crate) intensity: f32,
    pub(crate) is_two_sided: u32,
    pub(crate) parent: u32,
    pub(crate) first_child: u32,
    pub(crate) light: u32,
    pub(crate) padding: u32,
}

#[cfg(feature = "gpu")]
impl Tree {
    /// The nodes on the GPU, where `light` numbers the lights.
    pub(crate) fn packed(&self, light: impl Fn(u32) -> u32) -> Vec<LightNode> {
        let all = self.nodes[0].bounds.intensity;
        let nodes = self.nodes.iter().map(|node| {
            let bounds = &node.bounds;
            LightNode {
                center: narrow(bounds.center),
                radius: bounds.radius as f32,
                axis: narrow(bounds.axis),
                cos_emission: bounds.cos_emission as f32,
                spread: [bounds.spread.cos as f32, bounds.spread.sin as f32],
                // Relative to the total, which fits f32; never zero, however weak the light.
                intensity: ((bounds.intensity / all) as f32).max(1e-30),
                is_two_sided: bounds.is_two_sided.into(),
                parent: node.parent.unwrap_or(0),
                first_child: node.children.map_or(0, |children| children[0]),
                light: light(node.light),
                padding: 0,
            }
        });
        nodes.collect()
    }
}

/// A node of the light tree.
#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: LightBounds,
    /// `None` for a leaf.
    children: Option<[u32; 2]>,
    /// `None` for the root.
    parent: Option<u32>,
    /// The light of a leaf; in an inner node, any light below it.
    light: u32,
}

/// Bins per axis.
const BINS: usize = 12;

/// Depth from which nodes are split into equal numbers of lights, which limits the depth to this plus log2(n).
const MAX_BINNED_DEPTH: u32 = 40;

/// Builds a light tree top-down. Parents come before children.
///
/// A split minimizes the sum over both sides of intensity, orientation measure and squared radius: the source's
/// heuristic, with the bounding sphere in place of the box, because importance uses the sphere.
fn build(lights: &[Cluster]) -> Option<Vec<Node>> {
    let mut order: Vec<u32> = (0..).zip(lights).map(|(light, _)| light).collect();
    let mut nodes = vec![node_of(lights, &order, None)?];
    // Node number, range of `order`, depth.
    let mut open = vec![(0, 0, order.len(), 0)];
    while let Some((number, start, end, depth)) = open.pop() {
        if end - start < 2 {
            continue;
        }
        let split_at = start + split(lights, &mut order[start..end], depth);
        let first = nodes.len() as u32;
        nodes[number as usize].children = Some([first, first + 1]);
        for (child, range) in [(first, start..split_at), (first + 1, split_at..end)] {
            nodes.push(node_of(lights, &order[range.clone()], Some(number))?);
            open.push((child, range.start, range.end, depth + 1));
        }
    }
    Some(nodes)
}

fn node_of(lights: &[Cluster], order: &[u32], parent: Option<u32>) -> Option<Node> {
    let cluster = order.iter().map(|&light| lights[light as usize]).reduce(|a, b| a.union(&b))?;
    Some(Node { bounds: LightBounds::new(&cluster), children: None, parent, light: *order.first()? })
}

/// Partitions `order` for the two children. Returns the size of the first, which is at least one and not all.
fn split(lights: &[Cluster], order: &mut [u32], depth: u32) -> usize {
    let best = if depth < MAX_BINNED_DEPTH { best_plane(lights, order) } else { None };
    let Some((axis, plane)) = best else { return order.len() / 2 };
    let bins = Bins::along(lights, order, axis);
    let is_first = |light: u32| bins.of(&lights[light as usize]) < plane;
    let (first, second): (Vec<u32>, Vec<u32>) = order.iter().partition(|&&light| is_first(light));
    order[..first.len()].copy_from_slice(&first);
    order[first.len()..].copy_from_slice(&second);
    first.len()
}

/// Axis and first bin of the second child; `None` if all centers coincide.
fn best_plane(lights: &[Cluster], order: &[u32]) -> Option<(usize, usize)> {
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in 0..3 {
        let bins = Bins::along(lights, order, axis);
        if bins.scale == 0.0 {
            continue;
        }
        let mut clusters: [Option<Cluster>; BINS] = [None; BINS];
        for &light in order {
            let light = &lights[light as usize];
            let bin = &mut clusters[bins.of(light)];
            *bin = join(*bin, Some(*light));
        }
        let mut after = [None; BINS];
        for i in (1..BINS).rev() {
            after[i - 1] = join(after[i], clusters[i]);
        }
        let mut before = None;
        for i in 1..BINS {
            before = join(before, clusters[i - 1]);
            let (Some(a), Some(b)) = (before, after[i - 1]) else { continue };
            let cost = cost(&a) + cost(&b);
            if best.is_none_or(|(min, ..)| cost < min) {
                best = Some((cost, axis, i));
            }
        }
    }
    best.map(|(_, axis, plane)| (axis, plane))
}

fn join(a: Option<Cluster>, b: Option<Cluster>) -> Option<Cluster> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    }
}

fn cost(cluster: &Cluster) -> f64 {
    cluster.intensity * cluster.cone.measure() * cluster.radius_squared()
}

/// Equal bins between the minimum and the maximum center along an axis.
struct Bins {
    axis: usize,
    min: f64,
    /// Bins per unit of length; 0 if all centers coincide.
    scale: f64,
}

impl Bins {
    fn along(lights: &[Cluster], order: &[u32], axis: usize) -> Self {
        let centers = order.iter().map(|&light| lights[light as usize].center()[axis]);
        let (min, max) =
            centers.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), center| (a.min(center), b.max(center)));
        let scale = BINS as f64 / (max - min);
        Self { axis, min, scale: if scale.is_finite() { scale } else { 0.0 } }
    }

    fn of(&self, light: &Cluster) -> usize {
        let bin = ((light.center()[self.axis] - self.min) * self.scale) as usize;
        bin.min(BINS - 1)
    }
}

/// A point that receives light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receiver {
    pub(super) position: DVec3,
    /// Unit normal of the receiving side; `None` if both sides receive light.
    pub(super) normal: Option<DVec3>,
}

/// Bounds of a cluster of lights for importance sampling: a bounding sphere and a direction cone.
#[derive(Clone, Copy, Debug)]
struct LightBounds {
    center: DVec3,
    radius: f64,
    axis: DVec3,
    spread: Angle,
    /// Cosine of the angle to a light's axis beyond which the light is black.
    cos_emission: f64,
    is_two_sided: bool,
    /// W/sr of luminance.
    intensity: f64,
}

/// The sum of two importances must be finite.
const MAX_IMPORTANCE: f64 = 1e300;

impl LightBounds {
    fn new(cluster: &Cluster) -> Self {
        let Cluster { cone, intensity, .. } = *cluster;
        let (sin, cos) = cone.spread_rad.sin_cos();
        Self {
            center: cluster.center(),
            radius: cluster.radius_squared().sqrt(),
            axis: cone.axis,
            spread: Angle { cos, sin },
            cos_emission: cone.emission_rad.cos(),
            is_two_sided: cone.is_two_sided,
            intensity,
        }
    }

    /// Estimate of the irradiance of the lights at a point; zero only if no light can reach it.
    ///
    /// Intensity over squared distance, times the maximum cosines of emission (over the cone's axes) and of reception
    /// (over the sphere's points). Inside the sphere the distance is the radius. Angles have an error of about 10⁻⁸, so
    /// a light within that angle of a horizon may be missed.
    fn importance(&self, receiver: &Receiver) -> f64 {
        let offset = receiver.position - self.center;
        let (square, radius_squared) = (offset.dot(offset), self.radius * self.radius);
        let distance = square.sqrt();
        // Half-angle of the sphere as seen from the point; all directions from inside.
        let sphere = if square > radius_squared {
            Angle { cos: (1.0 - radius_squared / square).sqrt(), sin: self.radius / distance }
        } else {
            Angle { cos: -1.0, sin: 0.0 }
        };
        // NaN if a light without extent is at the receiver: such a light counts from all directions.
        let direction = offset * (1.0 / distance);
        let cosine = self.axis.dot(direction);
        let cosine = if self.is_two_sided { cosine.abs() } else { cosine };
        let emitted = Angle::of(cosine).minus(self.spread).minus(sphere).cos;
        if emitted < self.cos_emission {
            return 0.0;
        }
        let received = receiver.normal.map_or(1.0, |normal| Angle::of(-normal.dot(direction)).minus(sphere).cos);
        let distance_squared = square.max(radius_squared).max(f64::MIN_POSITIVE);
        (self.intensity * emitted * received / distance_squared).clamp(0.0, MAX_IMPORTANCE)
    }
}

/// An angle in 0..=π.
#[derive(Clone, Copy, Debug)]
struct Angle {
    cos: f64,
    sin: f64,
}

impl Angle {
    /// Zero for a NaN cosine.
    fn of(cos: f64) -> Self {
        let cos = if cos.is_nan() { 1.0 } else { cos.clamp(-1.0, 1.0) };
        Self { cos, sin: ((1.0 - cos) * (1.0 + cos)).sqrt() }
    }

    /// The difference, clamped to zero.
    fn minus(self, other: Self) -> Self {
        if self.cos >= other.cos {
            return Self { cos: 1.0, sin: 0.0 };
        }
        Self { cos: self.cos * other.cos + self.sin * other.sin, sin: self.sin * other.cos - self.cos * other.sin }
    }
}

/// A group of lights: bounding box, emission cone and intensity. World space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cluster {
    pub(super) min: DVec3,
    pub(super) max: DVec3,
    pub(super) cone: Cone,
    /// Sum of the maximum radiant intensities, in W/sr of luminance.
    pub(super) intensity: f64,
}

impl Cluster {
    /// The bounds of a triangle.
    pub(super) fn of_points(points: [DVec3; 3], cone: Cone, intensity: f64) -> Self {
        let [a, b, c] = points;
        Self { min: a.min(b).min(c), max: a.max(b).max(c), cone, intensity }
    }

    /// The bounds of a light within a box about `center`; `None` for a light that is black or too bright for numbers.
    pub(super) fn of_box(center: [f32; 3], half: DVec3, cone: Cone, intensity: f64) -> Option<Self> {
        let center = wide(center);
        let is_lit = intensity > 0.0 && intensity.is_finite();
        is_lit.then(|| Self { min: center - half, max: center + half, cone, intensity })
    }

    fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            cone: self.cone.union(&other.cone),
            intensity: self.intensity + other.intensity,
        }
    }

    /// Center of the bounding box.
    fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Squared radius of the bounding sphere: half the diagonal of the box.
    fn radius_squared(&self) -> f64 {
        let half = (self.max - self.min) * 0.5;
        half.dot(half)
    }
}

/// Directions of emission: axes within `spread` of `axis`, each light emitting within `reach` of its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Unit vector.
    pub(super) axis: DVec3,
    /// Maximum angle between `axis` and the axis of a light, θo in the source.
    pub(super) spread_rad: f64,
    /// Maximum angle of emission to a light's axis, θe in the source.
    pub(super) emission_rad: f64,
    /// Whether the lights also emit along the opposite directions.
    pub(super) is_two_sided: bool,
}

impl Cone {
    /// All directions.
    pub(super) const ALL: Self = Self { axis: DVec3::Z, spread_rad: PI, emission_rad: 0.5 * PI, is_two_sided: false };

    /// A flat light: one axis, emission up to 90 degrees.
    pub(super) fn about(axis: DVec3, is_two_sided: bool) -> Self {
        Self { axis, spread_rad: 0.0, emission_rad: 0.5 * PI, is_two_sided }
    }

    /// The smallest cone that contains both, up to rounding.
    fn union(&self, other: &Self) -> Self {
        let emission_rad = self.emission_rad.max(other.emission_rad);
        let is_two_sided = self.is_two_sided || other.is_two_sided;
        let (wider, other) = if self.spread_rad >= other.spread_rad { (self, other) } else { (other, self) };
        // The axis of two-sided lights may be flipped.
        let cosine = wider.axis.dot(other.axis);
        let flip = if other.is_two_sided && cosine < 0.0 { -1.0 } else { 1.0 };
        let towards = other.axis * flip;
        let between = (flip * cosine).clamp(-1.0, 1.0).acos();
        if between + other.spread_rad <= wider.spread_rad {
            return Self { emission_rad, is_two_sided, ..*wider };
        }
        let spread_rad = 0.5 * (wider.spread_rad + between + other.spread_rad);
        match wider.axis.cross(towards).try_normalize() {
            Some(pole) if spread_rad < PI => {
                // Rotate the wider cone's axis towards the other, in the plane of both.
                let (s, c) = (spread_rad - wider.spread_rad).sin_cos();
                let axis = wider.axis * c + pole.cross(wider.axis) * s;
                Self { axis: axis.try_normalize().unwrap_or(wider.axis), spread_rad, emission_rad, is_two_sided }
            }
            _ => Self { spread_rad: PI, emission_rad, is_two_sided, ..*wider },
        }
    }

    /// The orientation measure of Conty Estevez and Kulla, section 4: solid angle, weighted by the cosine beyond the
    /// spread.
    fn measure(&self) -> f64 {
        let (spread, outer) = (self.spread_rad, (self.spread_rad + self.emission_rad).min(PI));
        let fringe =
            2.0 * outer * spread.sin() - (spread - 2.0 * outer).cos() - 2.0 * spread * spread.sin() + spread.cos();
        2.0 * PI * (1.0 - spread.cos()) + 0.5 * PI * fringe
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pattern, Sampler};

    /// A number in `[0, 1)` for each pair of indices.
    fn number(i: u32, k: u32) -> f64 {
        Sampler::new(Pattern::Random, 1, 1).single(i, 0, k).into()
    }

    fn direction(i: u32, k: u32) -> DVec3 {
        DVec3::from([0, 1, 2].map(|j| number(i, k + j) - 0.5)).try_normalize().unwrap()
    }

    /// One-sided and two-sided flat lights, points, and narrow spots in a box that is long along x.
    fn lights(n: u32) -> Vec<Cluster> {
        let light = |i: u32| {
            let center = DVec3::new(50.0 * number(i, 0), 5.0 * number(i, 1), 5.0 * number(i, 2));
            let half = DVec3::new(0.3, 0.0, 0.1) * number(i, 3);
            let flat = Cone::about(direction(i, 4), i.is_multiple_of(2));
            let cone = match i % 4 {
                0 | 1 => flat,
                2 => Cone::ALL,
                _ => Cone { emission_rad: 0.3, ..flat },
            };
            Cluster { min: center - half, max: center + half, cone, intensity: 10.0 * number(i, 8) + 0.1 }
        };
        (0..n).map(light).collect()
    }

    fn receivers() -> impl Iterator<Item = Receiver> {
        (100_000..100_040).map(|i| Receiver {
            position: DVec3::new(80.0 * number(i, 0) - 15.0, 10.0 * number(i, 1) - 2.5, 5.0 * number(i, 2)),
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
        let corner = |i: u32| DVec3::from([0, 1, 2].map(|k| if i >> k & 1 == 1 { light.max[k] } else { light.min[k] }));
        (0..8).map(corner).any(|corner| {
            let offset = receiver.position - corner;
            let towards = offset * (1.0 / offset.length());
            let cosine = light.cone.axis.dot(towards);
            let cosine = if light.cone.is_two_sided { cosine.abs() } else { cosine };
            let emits = light.cone.spread_rad == PI || cosine > light.cone.emission_rad.cos() + 1e-6;
            emits && receiver.normal.is_none_or(|normal| normal.dot(towards) < -1e-6)
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
        let axis = DVec3::X;
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
            let far = DVec3::X * 100.0_f64.powi(i);
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
