use canted_lbvh::Corners;
use canted_obb::{Aabb, PrimId};

use crate::clip::clip;

/// The part of a primitive inside a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fragment {
    pub(crate) primitive: PrimId,
    pub(crate) aabb: Aabb,
}

/// The bounds of all fragments.
pub(crate) fn around(fragments: &[Fragment]) -> Aabb {
    fragments.iter().fold(Aabb::EMPTY, |all, fragment| all.union(fragment.aabb))
}

/// Maximum number of bins per axis.
pub(crate) const MAX_BINS: usize = 64;

/// Bounds of a bin, and how many fragments begin and end there.
#[derive(Clone, Copy)]
struct Bin {
    aabb: Aabb,
    begin: u32,
    end: u32,
}

const EMPTY: Bin = Bin { aabb: Aabb::EMPTY, begin: 0, end: 0 };

/// A split of fragments, with its cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Area of each side times its number of fragments.
    pub(crate) cost: f64,
    pub(crate) axis: usize,
    /// First bin on the right.
    pub(crate) bin: usize,
    pub(crate) grid: Grid,
    pub(crate) boxes: [Aabb; 2],
    pub(crate) counts: [u32; 2],
}

/// Bins of equal width along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    low: f64,
    width: f64,
    n: usize,
}

impl Grid {
    #[expect(clippy::cast_precision_loss, reason = "at most 64 bins")]
    fn new(low: f64, high: f64, n: usize) -> Self {
        let n = n.clamp(2, MAX_BINS);
        Self { low, width: (high - low) / n as f64, n }
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturating, NaN to 0")]
    pub(crate) fn bin(&self, x: f64) -> usize {
        (((x - self.low) / self.width) as usize).min(self.n - 1)
    }

    /// The lower plane of a bin.
    #[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "any plane is valid")]
    pub(crate) fn plane(&self, bin: usize) -> f32 {
        (self.low + bin as f64 * self.width) as f32
    }
}

/// The object split of least cost, by the centers of the fragments; `None` if all centers are equal.
pub(crate) fn object_split(fragments: &[Fragment], n_bins: usize) -> Option<Candidate> {
    let mut centers = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for center in fragments.iter().map(|fragment| fragment.aabb.center()) {
        centers.0 = std::array::from_fn(|k| centers.0[k].min(center[k]));
        centers.1 = std::array::from_fn(|k| centers.1[k].max(center[k]));
    }
    let on = |axis: usize| {
        let grid = Grid::new(centers.0[axis], centers.1[axis], n_bins);
        let mut bins = [EMPTY; MAX_BINS];
        for fragment in fragments {
            let bin = &mut bins[grid.bin(fragment.aabb.center()[axis])];
            *bin = Bin { aabb: bin.aabb.union(fragment.aabb), begin: bin.begin + 1, end: bin.end + 1 };
        }
        cheapest(&bins, grid, axis, u32::MAX)
    };
    least((0..3).filter_map(on))
}

/// The spatial split of least cost; `None` if none makes both sides smaller.
pub(crate) fn spatial_split(fragments: &[Fragment], corners: &[Corners], n_bins: usize) -> Option<Candidate> {
    let bounds = around(fragments);
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 fragments")]
    let n = fragments.len() as u32;
    let on = |axis: usize| {
        let grid = Grid::new(bounds.min[axis].into(), bounds.max[axis].into(), n_bins);
        let mut bins = [EMPTY; MAX_BINS];
        for fragment in fragments {
            let [first, last] = [fragment.aabb.min, fragment.aabb.max].map(|end| grid.bin(end[axis].into()));
            bins[first].begin += 1;
            bins[last].end += 1;
            let mut rest = Some(fragment.aabb);
            for (i, bin) in (first + 1..).zip(&mut bins[first..last]) {
                let Some(aabb) = rest else { break };
                let [left, right] = clip(&corners[fragment.primitive.index()], &aabb, axis, grid.plane(i));
                bin.aabb = bin.aabb.union(left.unwrap_or(Aabb::EMPTY));
                rest = right;
            }
            bins[last].aabb = bins[last].aabb.union(rest.unwrap_or(Aabb::EMPTY));
        }
        cheapest(&bins, grid, axis, n - 1)
    };
    least((0..3).filter_map(on))
}

/// The first candidate of least cost.
fn least(candidates: impl Iterator<Item = Candidate>) -> Option<Candidate> {
    candidates.reduce(|best, next| if next.cost < best.cost { next } else { best })
}

/// The cheapest plane of an axis with at most `max` fragments on each side; ties go to the more balanced one.
fn cheapest(bins: &[Bin; MAX_BINS], grid: Grid, axis: usize, max: u32) -> Option<Candidate> {
    let mut rights = [(Aabb::EMPTY, 0); MAX_BINS];
    let mut right = (Aabb::EMPTY, 0);
    for i in (1..grid.n).rev() {
        right = (right.0.union(bins[i].aabb), right.1 + bins[i].end);
        rights[i] = right;
    }
    let (mut aabb, mut n, mut best) = (Aabb::EMPTY, 0, None::<Candidate>);
    for i in 1..grid.n {
        (aabb, n) = (aabb.union(bins[i - 1].aabb), n + bins[i - 1].begin);
        let (right, n_right) = rights[i];
        if n == 0 || n_right == 0 || n.max(n_right) > max {
            continue;
        }
        let cost = aabb.area() * f64::from(n) + right.area() * f64::from(n_right);
        let balance = |counts: [u32; 2]| counts[0].min(counts[1]);
        let counts = [n, n_right];
        if best.is_none_or(|best| cost < best.cost || cost == best.cost && balance(counts) > balance(best.counts)) {
            best = Some(Candidate { cost, axis, bin: i, grid, boxes: [aabb, right], counts });
        }
    }
    best
}
