use super::bounds::LightBounds;
use super::cluster::Cluster;

/// A node of a light tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) bounds: LightBounds,
    /// `None` for a leaf.
    pub(super) children: Option<[u32; 2]>,
    /// `None` for the root.
    pub(super) parent: Option<u32>,
    /// The light of a leaf; of an inner node, some light below it.
    pub(super) light: u32,
}

/// Bins along each axis in which a split is looked for.
const BINS: usize = 12;

/// Depth from which nodes are halved: a tree of n lights is no deeper than this and log2(n), however they lie.
const DEEP: u32 = 40;

/// Builds a tree from the root down; its nodes, parents before children.
///
/// Split where the sum over both sides of intensity, measure of orientation and squared radius is least: the source's
/// heuristic with the ball that importance uses in place of the box. A number of binnings that is logarithmic in the
/// number of lights, each linear.
pub(super) fn build(lights: &[Cluster]) -> Option<Vec<Node>> {
    let mut order: Vec<u32> = (0..).zip(lights).map(|(light, _)| light).collect();
    let mut nodes = vec![node_of(lights, &order, None)?];
    // Ranges of the order, with the node over each.
    let mut open = vec![(0, 0, order.len(), 0)];
    while let Some((number, start, end, depth)) = open.pop() {
        if end - start < 2 {
            continue;
        }
        let middle = start + split(lights, &mut order[start..end], depth);
        #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^31 lights: they are numbered in 32 bits")]
        let first = nodes.len() as u32;
        nodes[number as usize].children = Some([first, first + 1]);
        for (child, range) in [(first, start..middle), (first + 1, middle..end)] {
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

/// Reorders lights so that those of the first child come first; their number, at least one and not all.
fn split(lights: &[Cluster], order: &mut [u32], depth: u32) -> usize {
    let best = if depth < DEEP { best_plane(lights, order) } else { None };
    let Some((axis, plane)) = best else { return order.len() / 2 };
    let bins = Bins::along(lights, order, axis);
    let is_first = |light: u32| bins.of(&lights[light as usize]) < plane;
    let (first, second): (Vec<u32>, Vec<u32>) = order.iter().partition(|&&light| is_first(light));
    order[..first.len()].copy_from_slice(&first);
    order[first.len()..].copy_from_slice(&second);
    first.len()
}

/// Axis and first bin of the second side; `None` where all middles coincide.
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
            if best.is_none_or(|(least, ..)| cost < least) {
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

/// Equal steps between the least and the greatest middle along an axis.
struct Bins {
    axis: usize,
    least: f64,
    /// Bins per unit of length; 0 where all middles coincide.
    scale: f64,
}

impl Bins {
    fn along(lights: &[Cluster], order: &[u32], axis: usize) -> Self {
        let middles = order.iter().map(|&light| lights[light as usize].middle()[axis]);
        let (least, greatest) =
            middles.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), middle| (a.min(middle), b.max(middle)));
        #[expect(clippy::cast_precision_loss, reason = "twelve")]
        let scale = BINS as f64 / (greatest - least);
        Self { axis, least, scale: if scale.is_finite() { scale } else { 0.0 } }
    }

    fn of(&self, light: &Cluster) -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the quotient lies in 0..=BINS")]
        let bin = ((light.middle()[self.axis] - self.least) * self.scale) as usize;
        bin.min(BINS - 1)
    }
}
