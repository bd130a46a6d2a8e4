use canted_lbvh::Corners;
use canted_obb::Aabb;

use crate::{
    clip::clip,
    fragment::{Fragment, around},
};

/// Most slices an axis.
pub(crate) const MAX_SLICES: usize = 64;

/// What lies in a slice, and how many fragments begin and end there.
#[derive(Clone, Copy)]
struct Slice {
    aabb: Aabb,
    begin: u32,
    end: u32,
}

const EMPTY: Slice = Slice { aabb: Aabb::EMPTY, begin: 0, end: 0 };

/// A way to part fragments in two, weighed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cut {
    /// Each side's area times its number of fragments.
    pub(crate) cost: f64,
    pub(crate) axis: usize,
    /// First slice on the right.
    pub(crate) slice: usize,
    pub(crate) ruler: Ruler,
    pub(crate) boxes: [Aabb; 2],
    pub(crate) counts: [u32; 2],
}

/// Slices of equal width along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ruler {
    low: f64,
    width: f64,
    n: usize,
}

impl Ruler {
    #[expect(clippy::cast_precision_loss, reason = "at most 64 slices")]
    fn new(low: f64, high: f64, n: usize) -> Self {
        let n = n.clamp(2, MAX_SLICES);
        Self { low, width: (high - low) / n as f64, n }
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturating, NaN to 0")]
    pub(crate) fn slice(&self, x: f64) -> usize {
        (((x - self.low) / self.width) as usize).min(self.n - 1)
    }

    /// The plane below a slice.
    #[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "any plane will do")]
    pub(crate) fn plane(&self, slice: usize) -> f32 {
        (self.low + slice as f64 * self.width) as f32
    }
}

/// The cheapest cut between slices by the fragments' middles, each whole on one side; `None` where all middles agree.
pub(crate) fn between(fragments: &[Fragment], n_slices: usize) -> Option<Cut> {
    let mut centers = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for center in fragments.iter().map(|fragment| fragment.aabb.center()) {
        centers.0 = std::array::from_fn(|k| centers.0[k].min(center[k]));
        centers.1 = std::array::from_fn(|k| centers.1[k].max(center[k]));
    }
    let on = |axis: usize| {
        let ruler = Ruler::new(centers.0[axis], centers.1[axis], n_slices);
        let mut slices = [EMPTY; MAX_SLICES];
        for fragment in fragments {
            let slice = &mut slices[ruler.slice(fragment.aabb.center()[axis])];
            *slice = Slice { aabb: slice.aabb.union(fragment.aabb), begin: slice.begin + 1, end: slice.end + 1 };
        }
        cheapest(&slices, ruler, axis, u32::MAX)
    };
    least((0..3).filter_map(on))
}

/// The cheapest cut through fragments along a plane; `None` where none leaves both sides fewer than there are.
pub(crate) fn through(fragments: &[Fragment], corners: &[Corners], n_slices: usize) -> Option<Cut> {
    let bounds = around(fragments);
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^30 fragments")]
    let n = fragments.len() as u32;
    let on = |axis: usize| {
        let ruler = Ruler::new(bounds.min[axis].into(), bounds.max[axis].into(), n_slices);
        let mut slices = [EMPTY; MAX_SLICES];
        for fragment in fragments {
            let [first, last] = [fragment.aabb.min, fragment.aabb.max].map(|end| ruler.slice(end[axis].into()));
            slices[first].begin += 1;
            slices[last].end += 1;
            let mut rest = Some(fragment.aabb);
            for (i, slice) in (first + 1..).zip(&mut slices[first..last]) {
                let Some(aabb) = rest else { break };
                let [left, right] = clip(&corners[fragment.primitive.index()], &aabb, axis, ruler.plane(i));
                slice.aabb = slice.aabb.union(left.unwrap_or(Aabb::EMPTY));
                rest = right;
            }
            slices[last].aabb = slices[last].aabb.union(rest.unwrap_or(Aabb::EMPTY));
        }
        cheapest(&slices, ruler, axis, n - 1)
    };
    least((0..3).filter_map(on))
}

/// The first of least cost.
fn least(cuts: impl Iterator<Item = Cut>) -> Option<Cut> {
    cuts.reduce(|best, cut| if cut.cost < best.cost { cut } else { best })
}

/// The cheapest cut between slices of an axis with at most `most` fragments on either side; of equals the most even.
fn cheapest(slices: &[Slice; MAX_SLICES], ruler: Ruler, axis: usize, most: u32) -> Option<Cut> {
    let mut rights = [(Aabb::EMPTY, 0); MAX_SLICES];
    let mut right = (Aabb::EMPTY, 0);
    for i in (1..ruler.n).rev() {
        right = (right.0.union(slices[i].aabb), right.1 + slices[i].end);
        rights[i] = right;
    }
    let (mut aabb, mut n, mut best) = (Aabb::EMPTY, 0, None::<Cut>);
    for i in 1..ruler.n {
        (aabb, n) = (aabb.union(slices[i - 1].aabb), n + slices[i - 1].begin);
        let (right, n_right) = rights[i];
        if n == 0 || n_right == 0 || n.max(n_right) > most {
            continue;
        }
        let cost = aabb.area() * f64::from(n) + right.area() * f64::from(n_right);
        let even = |counts: [u32; 2]| counts[0].min(counts[1]);
        let counts = [n, n_right];
        if best.is_none_or(|best| cost < best.cost || cost == best.cost && even(counts) > even(best.counts)) {
            best = Some(Cut { cost, axis, slice: i, ruler, boxes: [aabb, right], counts });
        }
    }
    best
}
