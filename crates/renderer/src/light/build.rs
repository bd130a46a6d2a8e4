use super::bounds::LightBounds;
use super::cluster::Cluster;

/// A node of the light tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) bounds: LightBounds,
    /// `None` for a leaf.
    pub(super) children: Option<[u32; 2]>,
    /// `None` for the root.
    pub(super) parent: Option<u32>,
    /// The light of a leaf; in an inner node, any light below it.
    pub(super) light: u32,
}

/// Bins per axis.
const BINS: usize = 12;

/// Depth from which nodes are split into equal numbers of lights, which limits the depth to this plus log2(n).
const MAX_BINNED_DEPTH: u32 = 40;

/// Builds a light tree top-down. Parents come before children.
///
/// A split minimizes the sum over both sides of intensity, orientation measure and squared radius: the source's
/// heuristic, with the bounding sphere in place of the box, because importance uses the sphere.
pub(super) fn build(lights: &[Cluster]) -> Option<Vec<Node>> {
    let mut order: Vec<u32> = (0..).zip(lights).map(|(light, _)| light).collect();
    let mut nodes = vec![node_of(lights, &order, None)?];
    // Node number, range of `order`, depth.
    let mut open = vec![(0, 0, order.len(), 0)];
    while let Some((number, start, end, depth)) = open.pop() {
        if end - start < 2 {
            continue;
        }
        let split_at = start + split(lights, &mut order[start..end], depth);
        #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^31 lights: they are numbered in 32 bits")]
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
        #[expect(clippy::cast_precision_loss, reason = "twelve")]
        let scale = BINS as f64 / (max - min);
        Self { axis, min, scale: if scale.is_finite() { scale } else { 0.0 } }
    }

    fn of(&self, light: &Cluster) -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the quotient lies in 0..=BINS")]
        let bin = ((light.center()[self.axis] - self.min) * self.scale) as usize;
        bin.min(BINS - 1)
    }
}
