//! Binned splits, and partitions of references in parallel.

use glam::Vec4;

use crate::{
    par,
    reference::{Bounds, Reference},
};

/// Maximum number of bins per axis.
pub(crate) const MAX_BINS: u32 = 64;

/// Bins of equal width between the least and the greatest box center on each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    low: Vec4,
    scale: Vec4,
    last: Vec4,
    n_bins: usize,
}

/// A plane between two bins of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) axis: usize,
    /// First bin on the right.
    pub(crate) bin: u32,
}

/// `2^23`: floats from here on are integers, stored in their low bits.
const INTEGERS: Vec4 = Vec4::splat(8_388_608.0);

impl Grid {
    /// The grid over `centers`; `n_bins` of 2 to [`MAX_BINS`].
    pub(crate) fn new(centers: &Bounds, n_bins: u32) -> Self {
        let n_bins = n_bins.clamp(2, MAX_BINS);
        // Finite for a zero extent too, so that everything is in bin 0.
        let scale = (Vec4::splat(n_bins as f32) / centers.extent()).min(Vec4::MAX);
        Self { low: centers.low(), scale, last: Vec4::splat((n_bins - 1) as f32), n_bins: n_bins as usize }
    }

    /// The bin of a reference on each axis, plus [`INTEGERS`]; the last lane is unused.
    ///
    /// Deterministic: a reference is in the same bin every time.
    #[inline]
    fn bin(&self, reference: &Reference) -> Vec4 {
        // Half a bin less, rounded to nearest, is the floor, without the NaN handling of a conversion.
        let bin = (reference.center() - self.low) * self.scale - Vec4::splat(0.5);
        bin.max(Vec4::ZERO).min(self.last) + INTEGERS
    }

    /// A predicate for references left of a plane.
    pub(crate) fn left_of(self, plane: Plane) -> impl Fn(&Reference) -> bool {
        let first_right = Vec4::splat(plane.bin as f32) + INTEGERS;
        let lane = 1 << plane.axis;
        move |reference| self.bin(reference).cmplt(first_right).bitmask() & lane != 0
    }
}

/// Bounds of the references, and counts of their primitives, in each of `N` bins per axis.
#[derive(Clone, Copy)]
struct Bins<const AXES: usize, const N: usize> {
    bounds: [[Bounds; N]; AXES],
    counts: [[u32; N]; AXES],
}

impl<const AXES: usize, const N: usize> Bins<AXES, N> {
    const EMPTY: Self = Self { bounds: [[Bounds::EMPTY; N]; AXES], counts: [[0; N]; AXES] };

    fn fill(&mut self, references: &[Reference], grid: &Grid, axes: [usize; AXES]) {
        for reference in references {
            let bins = grid.bin(reference).to_array();
            for (lane, (bounds, counts)) in self.bounds.iter_mut().zip(&mut self.counts).enumerate() {
                // `N` is a power of two and at least the number of bins, so the low bits are the bin.
                let lane = if AXES == 3 { lane } else { axes[lane] };
                let bin = bins[lane].to_bits() as usize % N;
                bounds[bin] = bounds[bin].union(reference.bounds());
                counts[bin] += reference.n();
            }
        }
    }

    /// Minima and integer sums, so the order does not matter.
    fn join(&mut self, other: &Self) {
        for (all, part) in self.bounds.as_flattened_mut().iter_mut().zip(other.bounds.as_flattened()) {
            *all = all.union(part);
        }
        for (all, part) in self.counts.as_flattened_mut().iter_mut().zip(other.counts.as_flattened()) {
            *all += part;
        }
    }
}

/// Minimum number of references for parallel binning, and the size of its chunks.
const LARGE: usize = 1 << 15;
const CHUNK: usize = 1 << 13;

/// The plane of least SAH cost between bins of the given axes; `None` if all references share one bin on each.
///
/// The cost is the area of each side times its number of primitives (Goldsmith & Salmon 1987, MacDonald & Booth 1990).
/// Ties go to the more balanced split.
/// Source: Wald 2007.
pub(crate) fn best_plane(references: &[Reference], grid: &Grid, axes: &[usize]) -> Option<Plane> {
    match (axes, grid.n_bins) {
        (&[axis], ..=8) => best_of::<1, 8>(references, grid, [axis]),
        (&[axis], 9..=32) => best_of::<1, 32>(references, grid, [axis]),
        (&[axis], _) => best_of::<1, 64>(references, grid, [axis]),
        (_, ..=8) => best_of::<3, 8>(references, grid, [0, 1, 2]),
        (_, 9..=16) => best_of::<3, 16>(references, grid, [0, 1, 2]),
        (_, 17..=32) => best_of::<3, 32>(references, grid, [0, 1, 2]),
        (_, _) => best_of::<3, 64>(references, grid, [0, 1, 2]),
    }
}

// Never inlined, to keep its arrays off the stack of the recursion.
#[inline(never)]
fn best_of<const AXES: usize, const N: usize>(
    references: &[Reference],
    grid: &Grid,
    axes: [usize; AXES],
) -> Option<Plane> {
    let mut bins = Bins::<AXES, N>::EMPTY;
    if references.len() < LARGE {
        bins.fill(references, grid, axes);
    } else {
        let parts = par::map_chunks(references, CHUNK, |_, chunk| {
            let mut bins = Bins::<AXES, N>::EMPTY;
            bins.fill(chunk, grid, axes);
            bins
        });
        parts.iter().for_each(|part| bins.join(part));
    }
    let mut best = Best { rank: Best::rank(f32::INFINITY, 0), place: 0 };
    for ((bounds, counts), axis) in bins.bounds.iter().zip(&bins.counts).zip(axes) {
        best.consider(bounds, counts, axis);
    }
    let [axis, bin] = [best.place / N, best.place % N];
    (bin > 0).then_some(Plane { axis, bin: bin as u32 })
}

/// The best plane so far.
struct Best {
    /// Least at the least cost, and of equal costs where the smaller side has most primitives.
    rank: u64,
    /// The axis times the number of bins, plus the bin behind the plane, which is not the first.
    place: usize,
}

impl Best {
    /// Numbers that are not negative have the order of their bits; infinity and NaN come last.
    fn rank(cost: f32, balance: u32) -> u64 {
        u64::from(cost.to_bits()) << 32 | u64::from(!balance)
    }

    /// Considers every plane between two bins of an axis that splits the references. Unused bins are empty.
    ///
    /// Without branches, of which processors predict few: the cost is NaN where a side is empty, and at an empty bin that of the plane before.
    fn consider<const N: usize>(&mut self, bins: &[Bounds; N], counts: &[u32; N], axis: usize) {
        let mut right_costs = [(0.0, 0); N];
        let (mut bounds, mut n) = (Bounds::EMPTY, 0);
        for ((bin, count), right) in bins.iter().zip(counts).zip(&mut right_costs).rev() {
            bounds = bounds.union(bin);
            n += count;
            *right = (bounds.half_area() * n as f32, n);
        }
        (bounds, n) = (Bounds::EMPTY, 0);
        for (((next, bin), count), (right_cost, n_right)) in (1..).zip(bins).zip(counts).zip(&right_costs[1..]) {
            bounds = bounds.union(bin);
            n += count;
            let rank = Self::rank(bounds.half_area() * n as f32 + right_cost, n.min(*n_right));
            let place = axis * N + next;
            (self.rank, self.place) = if rank < self.rank { (rank, place) } else { (self.rank, self.place) };
        }
    }
}

/// Copies the references on the left to the front of `out`, the others to the back; returns the number on the left.
///
/// Holds: the same order for any number of threads.
pub(crate) fn partition(
    references: &[Reference],
    out: &mut [Reference],
    is_left: impl Fn(&Reference) -> bool + Sync + Send,
) -> usize {
    if references.len() < LARGE {
        partition_serial(references, out, is_left)
    } else {
        partition_chunks(references, out, is_left)
    }
}

/// Branch-free; the references on the right are reversed.
fn partition_serial(references: &[Reference], out: &mut [Reference], is_left: impl Fn(&Reference) -> bool) -> usize {
    let (mut front, mut back) = (0, out.len());
    for reference in references {
        let left = is_left(reference);
        // Written to both ends; the wrong copy is overwritten later.
        out[front] = *reference;
        out[back - 1] = *reference;
        front += usize::from(left);
        back -= usize::from(!left);
    }
    front
}

/// Counts the references of each chunk, then writes all chunks in parallel.
fn partition_chunks(
    references: &[Reference],
    out: &mut [Reference],
    is_left: impl Fn(&Reference) -> bool + Sync + Send,
) -> usize {
    let counts = par::map_chunks(references, CHUNK, |_, chunk| chunk.iter().filter(|r| is_left(r)).count());
    let n_left = counts.iter().sum();
    let (mut lefts, mut rights) = out.split_at_mut(n_left);
    let mut jobs = Vec::with_capacity(counts.len());
    for (chunk, n) in references.chunks(CHUNK).zip(counts) {
        let (left, lefts_after) = std::mem::take(&mut lefts).split_at_mut(n);
        let (right, rights_after) = std::mem::take(&mut rights).split_at_mut(chunk.len() - n);
        (lefts, rights) = (lefts_after, rights_after);
        jobs.push((chunk, left.iter_mut(), right.iter_mut()));
    }
    par::for_jobs(jobs, |(chunk, mut left, mut right)| {
        for reference in chunk {
            let slot = if is_left(reference) { left.next() } else { right.next() };
            if let Some(slot) = slot {
                *slot = *reference;
            }
        }
    });
    n_left
}

/// Moves the half with the lower centers on an axis to the front; ties go by index.
pub(crate) fn halve(references: &mut [Reference], axis: usize) -> usize {
    let half = references.len().div_ceil(2);
    if half < references.len() {
        references.select_nth_unstable_by_key(half, |r| (r.key(axis), r.primitive()));
    }
    half
}

/// Halves the references by count on the axis of least total area, the first of equals.
pub(crate) fn split_at_median(references: &mut [Reference], axes: &[usize]) -> usize {
    let mut best = (f32::INFINITY, axes[0]);
    if let [_, _, ..] = axes {
        for &axis in axes {
            let n_left = halve(references, axis);
            let (left, right) = references.split_at(n_left);
            let cost = half_area(left) + half_area(right);
            if cost < best.0 {
                best = (cost, axis);
            }
        }
    }
    halve(references, best.1)
}

fn half_area(references: &[Reference]) -> f32 {
    references.iter().fold(Bounds::EMPTY, |all, r| all.union(r.bounds())).half_area()
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_obb::Aabb;

    use super::*;
    use crate::reference::centers;

    /// The plane of least cost, of those the one with most references on the smaller side if `by_balance`, of those the first: by trying all.
    fn by_trying(references: &[Reference], grid: &Grid, by_balance: bool) -> Option<Plane> {
        let mut best: Option<(f32, usize, Plane)> = None;
        for plane in (0..3).flat_map(|axis| (1..grid.n_bins as u32).map(move |bin| Plane { axis, bin })) {
            let (left, right): (Vec<Reference>, Vec<Reference>) =
                references.iter().partition(|r| grid.left_of(plane)(r));
            let balance = left.len().min(right.len());
            if balance == 0 {
                continue;
            }
            let cost = half_area(&left) * left.len() as f32 + half_area(&right) * right.len() as f32;
            if best.is_none_or(|(least, most, _)| cost < least || by_balance && cost == least && balance > most) {
                best = Some((cost, balance, plane));
            }
        }
        best.map(|(.., plane)| plane)
    }

    #[test]
    fn the_best_plane_is_that_of_trying_all() {
        let mut rng = SplitMix64::new(3);
        let (mut n_others, mut n_none) = (0, 0);
        for i in 0..3000 {
            // Few places, so that many bins are empty and many costs equal; some references are all at one place.
            let mut place = || (rng.next_u64() % [2, 4, 40, 1][i % 4]) as f32;
            let boxes = (0..2 + i % 13).map(|_| [place(), place(), place()]);
            let size = [[0.5; 3], [0.0, 0.5, 0.0], [0.0; 3]][i % 3];
            let boxes = boxes.map(|min| Aabb { min, max: std::array::from_fn(|k| min[k] + size[k]) });
            let references: Vec<_> = (0..).zip(boxes).map(|(id, aabb)| Reference::new(id, &aabb, 0.125)).collect();
            for n_bins in [8, 12, 16, 32] {
                let grid = Grid::new(&centers(&references), n_bins);
                let found = best_plane(&references, &grid, &[0, 1, 2]);
                assert_eq!(found, by_trying(&references, &grid, true), "{i}, {n_bins} bins");
                n_others += u32::from(found != by_trying(&references, &grid, false));
                n_none += u32::from(found.is_none());
            }
        }
        assert!(n_others > 100 && n_none > 100, "{n_others} {n_none}");
    }
}
