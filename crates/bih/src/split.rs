//! Where a node is split, and what is cut off before.

use canted_obb::Aabb;

use crate::partition::{Content, Item, partition, twice_centers};

/// The boxes of a node.
///
/// The source uses one box for two purposes. Here `space` is a cell of the scene's box, halved at split planes: it chooses the
/// split (Wächter, Keller 2006). `visible` is what rays know, cut at the planes of the nodes above: the tight-box rule
/// compares it with the content.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Region {
    pub(crate) space: Aabb,
    pub(crate) visible: Aabb,
    pub(crate) content: Content,
}

/// What becomes of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Decision {
    /// All centers are equal: no plane separates the primitives.
    Leaf,
    /// The primitives fill only a part of the axis.
    Clip { axis: usize },
    /// The first `n_left` primitives are on the left of the plane; neither side is empty.
    Split { axis: usize, split: f32, n_left: usize },
}

/// Decides for a node, and partitions its items.
///
/// Reads: at least two items, their region, the tight-box factor (infinity without clip nodes).
/// Holds: at most three partitions and one pass for centers; the space contains all centers, so it can always be halved further.
/// Source: the thesis's algorithms 3 and 4, which go back to Wächter, Keller 2006. Departures:
/// * The listing starts the left clip plane at +∞ and takes minima, and the reverse on the right, which loses geometry. Planes here
///   are the bounds of each side: its greatest and least coordinate.
/// * A node knows the bounds of its content from its parent's pass. The tight-box rule, `extent · factor < visible extent`, and
///   one-sided halving read them before they touch an item. The splits are the source's, but a retry costs no pass and
///   leaves nothing to restore.
/// * The source makes a leaf when the same split fails twice, after up to hundreds of passes or never. Here a leaf is made if and
///   only if all centers are equal. When one side is empty although the content reaches over the split, centers are bounded
///   in one pass, and later halvings read these bounds.
pub(crate) fn decide(items: &mut [Item], region: &mut Region, factor: f32) -> Decision {
    // Twice the bounds of what the split plane must separate: first of the content, later of the centers.
    let Aabb { min, max } = region.content.bounds;
    let mut twice: [[f32; 2]; 3] = std::array::from_fn(|k| [2.0 * min[k], 2.0 * max[k]]);
    let mut is_of_centers = false;
    loop {
        let axis = longest(&region.space);
        if is_loose(region, axis, factor) {
            return Decision::Clip { axis };
        }
        let (low, high) = (region.space.min[axis], region.space.max[axis]);
        let split = 0.5 * (low + high);
        let [least, greatest] = twice[axis];
        // Also false where the space is not finite.
        let is_inside = low < split && split < high;
        if is_inside && greatest < 2.0 * split {
            region.space.max[axis] = split;
            continue;
        }
        if is_inside && least >= 2.0 * split {
            region.space.min[axis] = split;
            continue;
        }
        let n_left = partition(items, axis, 2.0 * split);
        if n_left > 0 && n_left < items.len() {
            return Decision::Split { axis, split, n_left };
        }
        if is_of_centers {
            // Rounding keeps the midpoint from separating neighboring numbers.
            return separate(items, &twice);
        }
        (twice, is_of_centers) = (twice_centers(items), true);
        if twice.iter().all(|[least, greatest]| least == greatest) {
            // Halving would reach the loose axes in this order.
            let loose = (0..3).rev().filter(|&axis| is_loose(region, axis, factor));
            let extent = |axis: usize| region.space.max[axis] - region.space.min[axis];
            let first = loose.max_by(|&a, &b| extent(a).total_cmp(&extent(b)));
            return first.map_or(Decision::Leaf, |axis| Decision::Clip { axis });
        }
    }
}

/// Whether the content, times the factor, is narrower than what rays know.
fn is_loose(Region { visible, content, .. }: &Region, axis: usize, factor: f32) -> bool {
    (content.bounds.max[axis] - content.bounds.min[axis]) * factor < visible.max[axis] - visible.min[axis]
}

/// Splits below the greatest center of the axis on which centers differ most.
fn separate(items: &mut [Item], twice_centers: &[[f32; 2]; 3]) -> Decision {
    let Some(axis) = widest(twice_centers) else { return Decision::Leaf };
    let twice_split = twice_centers[axis][1];
    let n_left = partition(items, axis, twice_split);
    Decision::Split { axis, split: 0.5 * twice_split, n_left }
}

/// Splits at the median center of the widest axis, where the depth must not grow further.
pub(crate) fn halve(items: &mut [Item]) -> Decision {
    let centers = twice_centers(items);
    let Some(axis) = widest(&centers) else { return Decision::Leaf };
    let n_left = items.len() / 2;
    let (_, median, _) = items.select_nth_unstable_by(n_left, |a, b| {
        a.twice_center(axis).total_cmp(&b.twice_center(axis)).then(a.primitive().cmp(&b.primitive()))
    });
    Decision::Split { axis, split: 0.5 * median.twice_center(axis), n_left }
}

/// The axis on which centers differ most; `None` if all are equal.
fn widest(twice_centers: &[[f32; 2]; 3]) -> Option<usize> {
    let extent = |k: usize| twice_centers[k][1] - twice_centers[k][0];
    (0..3).filter(|&k| twice_centers[k][0] < twice_centers[k][1]).max_by(|&a, &b| extent(a).total_cmp(&extent(b)))
}

/// The axis of greatest extent, the first of equals.
fn longest(aabb: &Aabb) -> usize {
    let [x, y, z]: [f32; 3] = std::array::from_fn(|k| aabb.max[k] - aabb.min[k]);
    if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    }
}
