use canted_obb::PrimId;

use crate::{
    TopDownConfig,
    assemble::Plot,
    par,
    reference::{Bounds, Reference},
};

/// References to split between any two neighbors along an axis.
struct Sweep<'a> {
    references: &'a [Reference],
    /// Centers on each axis, as integers of the same order.
    keys: &'a [[u32; 3]],
    config: &'a TopDownConfig,
}

/// The references of a node sorted by center on each axis, and scratch memory.
struct Orders<'a> {
    by_axis: [&'a mut [u32]; 3],
    scratch: &'a mut [u32],
    costs: &'a mut [f32],
}

/// Maximum number of references that are swept without allocating.
pub(crate) const MAX_BLOCK: usize = 32;

/// Builds a subtree by full sweeps; returns its height in nodes.
///
/// Evaluates the SAH cost of every plane between two centers. Centers are sorted once and stay sorted when nodes are
/// split.
/// Source: MacDonald & Booth 1990; the presorting after Wald & Havran 2006.
pub(crate) fn sweep(references: &[Reference], config: &TopDownConfig, plot: Plot<'_>, depth: u32) -> u32 {
    let keys: Vec<[u32; 3]> = references.iter().map(|r| [r.key(0), r.key(1), r.key(2)]).collect();
    let sorted = |axis: usize| {
        let mut keyed: Vec<u64> = (0..).zip(&keys).map(|(i, keys)| u64::from(keys[axis]) << 32 | i).collect();
        keyed.sort_unstable();
        keyed.into_iter().map(lower_half).collect::<Vec<_>>()
    };
    let (mut x, (mut y, mut z)) = par::join(|| sorted(0), || par::join(|| sorted(1), || sorted(2)));
    let (mut scratch, mut costs) = (vec![0; keys.len()], vec![0.0; keys.len()]);
    let orders = Orders { by_axis: [&mut x, &mut y, &mut z], scratch: &mut scratch, costs: &mut costs };
    Sweep { references, keys: &keys, config }.node(orders, plot, depth)
}

/// The same for at most [`MAX_BLOCK`] references.
#[inline(never)]
pub(crate) fn sweep_block(references: &[Reference], config: &TopDownConfig, plot: Plot<'_>, depth: u32) -> u32 {
    let n = references.len();
    let (mut keys, mut orders) = ([[0; 3]; MAX_BLOCK], [[0; MAX_BLOCK]; 3]);
    let (mut scratch, mut costs) = ([0; MAX_BLOCK], [0.0; MAX_BLOCK]);
    for (keys, reference) in keys.iter_mut().zip(references) {
        *keys = [reference.key(0), reference.key(1), reference.key(2)];
    }
    for (axis, order) in orders.iter_mut().enumerate() {
        let mut keyed = [0u64; MAX_BLOCK];
        for ((i, slot), keys) in (0..).zip(&mut keyed[..n]).zip(&keys) {
            *slot = u64::from(keys[axis]) << 32 | i;
        }
        keyed[..n].sort_unstable();
        for (slot, key) in order.iter_mut().zip(&keyed[..n]) {
            *slot = lower_half(*key);
        }
    }
    let by_axis = orders.each_mut().map(|order| &mut order[..n]);
    let orders = Orders { by_axis, scratch: &mut scratch[..n], costs: &mut costs[..n] };
    Sweep { references, keys: &keys[..n], config }.node(orders, plot, depth)
}

#[expect(clippy::cast_possible_truncation, reason = "the lower half is a number of 32 bits")]
fn lower_half(key: u64) -> u32 {
    key as u32
}

impl Sweep<'_> {
    /// Builds the node over all of `orders`; returns its height.
    fn node(&self, mut orders: Orders<'_>, plot: Plot<'_>, depth: u32) -> u32 {
        let n = plot.n_leaves();
        if n == 1 {
            let reference = &self.references[orders.by_axis[0][0] as usize];
            plot.leaf(PrimId(reference.primitive()));
            return 1;
        }
        let (axis, n_left) = match n {
            2 => (0, 1),
            _ if self.config.must_halve(n, depth) => (self.centers(&orders).longest(), n.div_ceil(2)),
            _ => self.best_split(&mut orders, depth),
        };
        self.partition(&mut orders, axis, n_left);
        let (left, right) = orders.split(n_left);
        let (left_plot, right_plot) = plot.split(n_left);
        let (build_left, build_right) =
            (|| self.node(left, left_plot, depth + 1), || self.node(right, right_plot, depth + 1));
        let (a, b) =
            if n > TopDownConfig::FORK { par::join(build_left, build_right) } else { (build_left(), build_right()) };
        1 + a.max(b)
    }

    /// The bounds of the centers.
    fn centers(&self, orders: &Orders<'_>) -> Bounds {
        let end = |order: &[u32], i: usize| self.references[order[i] as usize];
        let last = orders.scratch.len() - 1;
        let ends = orders.by_axis.each_ref().map(|order| [end(order, 0), end(order, last)]);
        crate::reference::centers(ends.as_flattened())
    }

    /// Axis and number of references on the left of the cheapest split; ties go to the more balanced one.
    #[expect(clippy::cast_precision_loss, reason = "a cost, compared with others computed the same way")]
    fn best_split(&self, orders: &mut Orders<'_>, depth: u32) -> (usize, usize) {
        let n = orders.scratch.len();
        let mut best = (f32::INFINITY, 0, 0, n / 2);
        for &axis in self.config.axes.at(depth, || self.centers(orders)) {
            let order = &*orders.by_axis[axis];
            let costs = &mut *orders.costs;
            let mut bounds = Bounds::EMPTY;
            for (i, &index) in order.iter().enumerate().skip(1).rev() {
                bounds = bounds.union(self.references[index as usize].bounds());
                costs[i] = bounds.half_area() * (n - i) as f32;
            }
            bounds = Bounds::EMPTY;
            for (i, &index) in (1..n).zip(order) {
                bounds = bounds.union(self.references[index as usize].bounds());
                let (cost, balance) = (bounds.half_area() * i as f32 + costs[i], i.min(n - i));
                if cost < best.0 || cost == best.0 && balance > best.1 {
                    best = (cost, balance, axis, i);
                }
            }
        }
        (best.2, best.3)
    }

    /// Moves the first `n_left` on `axis` to the front on every axis, in order.
    fn partition(&self, orders: &mut Orders<'_>, axis: usize, n_left: usize) {
        let pivot = orders.by_axis[axis][n_left];
        let key = |index: u32| (self.keys[index as usize][axis], index);
        for other in (0..3).filter(|&other| other != axis) {
            let order = &mut *orders.by_axis[other];
            let (mut front, mut back) = (0, 0);
            for i in 0..order.len() {
                let index = order[i];
                let left = key(index) < key(pivot);
                // The front never overtakes the reads; a wrong copy is overwritten.
                order[front] = index;
                orders.scratch[back] = index;
                front += usize::from(left);
                back += usize::from(!left);
            }
            order[front..].copy_from_slice(&orders.scratch[..back]);
        }
    }
}

impl Orders<'_> {
    fn split(self, n_left: usize) -> (Self, Self) {
        let [x, y, z] = self.by_axis.map(|order| order.split_at_mut(n_left));
        let (scratch, costs) = (self.scratch.split_at_mut(n_left), self.costs.split_at_mut(n_left));
        (
            Self { by_axis: [x.0, y.0, z.0], scratch: scratch.0, costs: costs.0 },
            Self { by_axis: [x.1, y.1, z.1], scratch: scratch.1, costs: costs.1 },
        )
    }
}
