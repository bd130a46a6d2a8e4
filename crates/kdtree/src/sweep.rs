use canted_obb::Aabb;

use crate::{KdSplit, KdTreeConfig};

/// The part of a triangle in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fragment {
    pub(crate) triangle: u32,
    /// Contains the padded triangle in the cell.
    pub(crate) aabb: Aabb,
}

/// Where a fragment starts or ends on an axis, as a sortable number: the coordinate, 2 bits for the kind, 30 for the fragment.
pub(crate) type Event = u64;

/// Kinds of events, in the order of equal coordinates.
const END: usize = 0;
/// A fragment without extent on this axis.
const FLAT: usize = 1;
const START: usize = 2;

/// Adds the events of a fragment to the list of each axis.
pub(crate) fn push_events(events: &mut [Vec<Event>; 3], fragment: usize, aabb: &Aabb) {
    for (axis, events) in events.iter_mut().enumerate() {
        let event = |at: f32, kind: usize| u64::from(sortable(at)) << 32 | (kind << 30 | fragment) as u64;
        let (min, max) = (aabb.min[axis], aabb.max[axis]);
        if min < max {
            events.extend([event(min, START), event(max, END)]);
        } else {
            events.push(event(min, FLAT));
        }
    }
}

fn kind_of(event: Event) -> usize {
    (event >> 30 & 3) as usize
}

/// The fragment of an event.
pub(crate) fn fragment_of(event: Event) -> usize {
    (event & ((1 << 30) - 1)) as usize
}

/// The event of the same fragment under another number.
pub(crate) fn renumbered(event: Event, fragment: u32) -> Event {
    event & !((1 << 30) - 1) | u64::from(fragment)
}

/// Bits in the order of the numbers; equal for both zeros.
fn sortable(x: f32) -> u32 {
    let bits = (x + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// The number of [`sortable`] bits.
fn number_of(sortable: u32) -> f32 {
    f32::from_bits(if sortable >> 31 == 1 { sortable & !(1 << 31) } else { !sortable })
}

/// A plane, and on which side fragments are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Split {
    pub(crate) axis: usize,
    pub(crate) plane: f32,
    /// Number of fragments in each cell before they are clipped to it.
    pub(crate) n: [usize; 2],
}

impl Split {
    /// Whether a fragment is in the lower cell, and in the upper one.
    ///
    /// What only touches the plane is on one side, because it has the same point there; what is in the plane is below.
    pub(crate) fn sides(&self, aabb: &Aabb) -> [bool; 2] {
        let (min, max) = (aabb.min[self.axis], aabb.max[self.axis]);
        [min < self.plane || max <= self.plane, max > self.plane]
    }
}

/// Triangles up to which [`KdSplit::Midpoint`] makes a leaf.
const MIDPOINT_LEAF: usize = 5;

/// The split at the midpoint of the cell's longest axis, if more than [`MIDPOINT_LEAF`] fragments and the budget permit it.
fn middle_split(events: &[Vec<Event>; 3], n: usize, cell: &Aabb, budget: usize) -> Option<Split> {
    let extent: [f64; 3] = std::array::from_fn(|k| f64::from(cell.max[k]) - f64::from(cell.min[k]));
    let axis = (0..3).reduce(|a, b| if extent[b] > extent[a] { b } else { a })?;
    let (min, max) = (cell.min[axis], cell.max[axis]);
    let plane = min.midpoint(max);
    if n <= MIDPOINT_LEAF || !(min < plane && plane < max) {
        return None;
    }
    // As `Split::sides`: what ends at the plane is below it, what starts there above; what is in it below.
    let (mut n_below, mut n_above) = (0, n);
    for &event in &events[axis] {
        let at = number_of((event >> 32) as u32);
        match kind_of(event) {
            START if at < plane => n_below += 1,
            FLAT if at <= plane => (n_below, n_above) = (n_below + 1, n_above - 1),
            END if at <= plane => n_above -= 1,
            _ => {}
        }
    }
    (n_below.max(1) + n_above.max(1) <= budget).then_some(Split { axis, plane, n: [n_below, n_above] })
}

/// The split of least cost, if it is cheaper than a leaf; the first of equals, by axis and coordinate. With [`KdSplit::Midpoint`] as
/// [`middle_split`].
///
/// Reads: the sorted events of `n` fragments on each axis. A cell counts its fragments, at least one, towards `budget`.
/// Source: Wald, Havran 2006, section 3; the cost after MacDonald, Booth 1990. Relative to the source of the bonus (Silva 2010),
/// areas are divided by that of the node, so that scale does not matter.
pub(crate) fn best_split(
    events: &[Vec<Event>; 3],
    n: usize,
    cell: &Aabb,
    budget: usize,
    config: &KdTreeConfig,
) -> Option<Split> {
    if config.split == KdSplit::Midpoint {
        return middle_split(events, n, cell, budget);
    }
    let extent: [f64; 3] = std::array::from_fn(|k| f64::from(cell.max[k]) - f64::from(cell.min[k]));
    let half_area = extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0];
    // The sum of area times number that a split must be below.
    let intersection = config.intersection_cost / half_area;
    let leaf_cost = config.intersection_cost * n as f64;
    let mut best = (leaf_cost - config.traversal_cost) / intersection;
    let mut split = None;
    for axis in 0..3 {
        let (min, max) = (cell.min[axis], cell.max[axis]);
        let (a, b) = (extent[(axis + 1) % 3], extent[(axis + 2) % 3]);
        let (cap, around) = (a * b, a + b);
        let (mut n_lower, mut n_upper) = (0, n);
        let mut rest = events[axis].iter().copied().peekable();
        while let Some(first) = rest.next() {
            let mut counts = [0; 4];
            counts[kind_of(first)] = 1;
            while let Some(event) = rest.next_if(|event| event >> 32 == first >> 32) {
                counts[kind_of(event)] += 1;
            }
            n_upper -= counts[END] + counts[FLAT];
            let n_below = n_lower + counts[FLAT];
            let plane = number_of((first >> 32) as u32);
            if min < plane && plane < max && n_below.max(1) + n_upper.max(1) <= budget {
                let below = cap + around * (f64::from(plane) - f64::from(min));
                let above = cap + around * (f64::from(max) - f64::from(plane));
                let sum = below * n_below as f64 + above * n_upper as f64;
                let cost = if n_below == 0 || n_upper == 0 { sum * (1.0 - config.empty_bonus) } else { sum };
                if cost < best {
                    best = cost;
                    split = Some(Split { axis, plane, n: [n_below, n_upper] });
                }
            }
            n_lower += counts[START] + counts[FLAT];
        }
    }
    split
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;

    use super::*;

    #[test]
    fn sortable_bits_are_in_the_order_of_numbers() {
        let numbers = [f32::MIN, -1.5, -1.0, -1e-40, 0.0, 1e-40, f32::MIN_POSITIVE, 1.0, 1e7, f32::MAX];
        assert!(numbers.is_sorted_by(|a, b| sortable(*a) < sortable(*b)));
        assert_eq!(numbers.map(|x| number_of(sortable(x))), numbers);
        assert_eq!(sortable(-0.0), sortable(0.0));
    }

    /// The least cost over all planes, by counting the fragments of each plane anew.
    fn cheapest(fragments: &[Aabb], cell: &Aabb, budget: usize, config: &KdTreeConfig) -> Option<f64> {
        let planes = (0..3).flat_map(|k| fragments.iter().flat_map(move |f| [(k, f.min[k]), (k, f.max[k])]));
        let inside = planes.filter(|&(k, plane)| cell.min[k] < plane && plane < cell.max[k]);
        let cost = |(axis, plane)| cost_of(&Split { axis, plane, n: [0; 2] }, fragments, cell, budget, config);
        inside.filter_map(cost).reduce(f64::min)
    }

    fn cost_of(split: &Split, fragments: &[Aabb], cell: &Aabb, budget: usize, config: &KdTreeConfig) -> Option<f64> {
        let [lower, upper] = [0, 1].map(|side| fragments.iter().filter(|f| split.sides(f)[side]).count());
        let (mut below, mut above) = (*cell, *cell);
        below.max[split.axis] = split.plane;
        above.min[split.axis] = split.plane;
        let bonus = if lower == 0 || upper == 0 { config.empty_bonus } else { 0.0 };
        let sum = (below.area() * lower as f64 + above.area() * upper as f64) / cell.area();
        let cost = config.traversal_cost + config.intersection_cost * (1.0 - bonus) * sum;
        let is_cheaper = cost < config.intersection_cost * fragments.len() as f64 - 1e-9;
        (is_cheaper && lower.max(1) + upper.max(1) <= budget).then_some(cost)
    }

    #[test]
    fn the_sweep_finds_the_cheapest_of_all_planes() {
        let mut rng = SplitMix64::new(3);
        let (mut n_split, mut n_bonus, mut n_middle) = (0, 0, 0);
        for round in 0..2_000 {
            // Coordinates on a coarse grid: many are equal, and some fragments are flat.
            let cell = Aabb { min: [0.0, -4.0, 1.0], max: [8.0, 4.0, 9.0] };
            let boxes: Vec<Aabb> = (0..1 + rng.below(9))
                .map(|_| {
                    let ends = [0, 1, 2].map(|k| [0, 1].map(|_| cell.min[k] + rng.below(9) as f32));
                    Aabb { min: ends.map(|[a, b]| a.min(b)), max: ends.map(|[a, b]| a.max(b)) }
                })
                .collect();
            let config = KdTreeConfig { empty_bonus: [0.0, 0.5, 0.9][round % 3], ..KdTreeConfig::default() };
            let budget = [usize::MAX, boxes.len() + 1][round % 2];
            let mut events = [vec![], vec![], vec![]];
            for (i, aabb) in boxes.iter().enumerate() {
                push_events(&mut events, i, aabb);
            }
            events.iter_mut().for_each(|events| events.sort_unstable());
            let split = best_split(&events, boxes.len(), &cell, budget, &config);
            let want = cheapest(&boxes, &cell, budget, &config);
            assert_eq!(split.is_some(), want.is_some(), "{boxes:?}");
            let (Some(split), Some(want)) = (split, want) else { continue };
            let found = cost_of(&split, &boxes, &cell, budget, &config).expect("a cheaper split");
            assert!((found - want).abs() < 1e-9 * want, "{split:?}: {found}, {want}: {boxes:?}");
            let n = [0, 1].map(|side| boxes.iter().filter(|f| split.sides(f)[side]).count());
            assert_eq!(split.n, n);
            n_split += 1;
            n_bonus += u32::from(n.contains(&0));
            if let Some(middle) = middle_split(&events, boxes.len(), &cell, budget) {
                let n = [0, 1].map(|side| boxes.iter().filter(|f| middle.sides(f)[side]).count());
                assert_eq!((middle.axis, middle.plane, middle.n), (0, 4.0, n), "{boxes:?}");
                n_middle += 1;
            }
        }
        assert!(n_middle > 100, "{n_middle} at the midpoint");
        assert!(n_split > 500 && n_bonus > 50, "{n_split} splits, {n_bonus} with an empty cell");
    }
}
