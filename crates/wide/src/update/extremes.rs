//! Boxes of nodes and their part in the predicted cost, eight children at a time.

use canted_obb::Aabb;

use super::boxes::frame_of;
use crate::config::Costs;
use crate::node::{ChildWord, DecodedWord, NOWHERE, NodeKind, Row, write_intervals};
use crate::simd::Simd;
use crate::traverse::BoxPads;

/// What the predicted cost is computed from; sums of pieces add up.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    /// Surface areas of all items.
    pub(crate) area: f64,
    /// Over all children of nodes: half of the area of the box, times the cost of a visit.
    pub(crate) weighted: f64,
    /// Costs of a visit to every child.
    pub(crate) visits: f64,
}

impl Sums {
    pub(super) fn add(&mut self, other: Self) {
        self.area += other.area;
        self.weighted += other.weighted;
        self.visits += other.visits;
    }
}

/// Half of the surface area of a box.
pub(crate) fn half_area(lo: [f64; 3], hi: [f64; 3]) -> f64 {
    let [x, y, z]: [f64; 3] = std::array::from_fn(|k| (hi[k] - lo[k]).max(0.0));
    x * y + y * z + z * x
}

/// Cost of a visit to what a word names.
pub(crate) fn visit(word: ChildWord, costs: &Costs) -> f64 {
    match word.kind() {
        DecodedWord::Empty => 0.0,
        DecodedWord::Node(kind, _) => f64::from(costs.node(kind)),
        DecodedWord::Leaf { n, .. } => f64::from(costs.leaf) + f64::from(costs.block) * f64::from(n.div_ceil(8)),
    }
}

/// What the boxes around a leaf or a node depend on, in numbers whose least values over several are those of all together: the least
/// coordinates of the box in the mesh frame, minus the reach, and minus the greatest coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub(super) struct Extremes(pub(super) [f32; 8]);

/// The place of minus the reach.
pub(super) const REACH: usize = 3;

impl Extremes {
    /// Of nothing.
    pub(super) const EMPTY: Self = {
        let mut all = [f32::INFINITY; 8];
        all[REACH] = 0.0;
        Self(all)
    };

    /// Of a box in the mesh frame, relative to the reference point, and the greatest coordinate of what is inside.
    #[inline(always)]
    pub(super) fn new(aligned: &Aabb, reach: f32) -> Self {
        let ([x, y, z], [to_x, to_y, to_z]) = (aligned.min, aligned.max);
        Self([x, y, z, -reach, -to_x, -to_y, -to_z, 0.0])
    }

    #[inline(always)]
    pub(super) fn aligned(&self) -> Aabb {
        let [x, y, z, _, to_x, to_y, to_z, _] = self.0;
        Aabb { min: [x, y, z], max: [-to_x, -to_y, -to_z] }
    }

    #[inline(always)]
    pub(super) fn reach(&self) -> f32 {
        -self.0[REACH]
    }
}

/// The [`Slabs::ends`](canted_trace::Slabs::ends) of the box around a leaf or a node along three rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ends {
    pub(super) lo: [f64; 3],
    pub(super) hi: [f64; 3],
}

impl Ends {
    /// Of nothing.
    pub(super) const EMPTY: Self = Self { lo: [f64::MAX; 3], hi: [f64::MIN; 3] };

    /// Of both.
    pub(super) fn union(mut self, other: Self) -> Self {
        for k in 0..3 {
            self.lo[k] = self.lo[k].min(other.lo[k]);
            self.hi[k] = self.hi[k].max(other.hi[k]);
        }
        self
    }
}

/// A node whose children are known.
pub(super) struct Closing<'a> {
    pub(super) kind: NodeKind,
    pub(super) words: &'a [ChildWord; 8],
    /// Empty ones in empty slots.
    pub(super) children: [&'a Extremes; 8],
    pub(super) costs: &'a Costs,
}

impl Closing<'_> {
    /// Adds the boxes of the node to `sums`, writes them if pads are given, and returns what the boxes around the node depend on. `ends`
    /// are those of the content of a slot along these rows.
    #[inline(always)]
    pub(super) fn close<S: Simd>(
        self,
        simd: S,
        rows: &mut [Row],
        pads: Option<&BoxPads>,
        sums: &mut Sums,
        ends: impl Fn(usize, [[f32; 3]; 3]) -> Ends,
    ) -> Extremes {
        let children = self.children.map(|child| simd.load(&child.0));
        let all = children.iter().skip(1).fold(children[0], |least, &child| simd.min(child, least));
        let by_number = simd.transpose(children).map(|lanes| simd.store(lanes));
        let mut pad = [0.0; 8];
        if let Some(pads) = pads {
            for lane in 0..8 {
                pad[lane] = pads.of(self.kind, -by_number[REACH][lane]);
            }
        }
        let mut planes = [[[0.0; 8]; 3]; 2];
        match self.kind {
            NodeKind::Aligned => {
                for k in 0..3 {
                    (planes[0][k], planes[1][k]) = (by_number[k], by_number[REACH + 1 + k]);
                    if pads.is_some() {
                        rows[2 * k] = lowered(&planes[0][k], &pad);
                        rows[2 * k + 1] = lowered(&planes[1][k], &pad).map(|x| -x);
                    }
                }
            }
            NodeKind::Oriented => {
                let mut of_slots = [[[0.0; 8]; 3]; 2];
                for (i, word) in self.words.iter().enumerate() {
                    let ends = if *word == ChildWord::EMPTY { Ends::EMPTY } else { ends(i, frame_of(rows, i)) };
                    let [lo, minus_hi] = &mut of_slots;
                    lo.iter_mut().zip(ends.lo).for_each(|(row, x)| row[i] = x);
                    minus_hi.iter_mut().zip(ends.hi).for_each(|(row, x)| row[i] = -x);
                }
                for k in 0..3 {
                    (planes[0][k], planes[1][k]) = (down_eight(&of_slots[0][k]), down_eight(&of_slots[1][k]));
                    if pads.is_some() {
                        write_intervals(rows, k, [&planes[0][k], &planes[1][k].map(|x| -x)], &pad);
                    }
                }
            }
        }
        let areas = half_areas(&planes);
        for (area, &word) in areas.iter().zip(self.words) {
            let visit = visit(word, self.costs);
            sums.weighted += visit * area;
            sums.visits += visit;
        }
        Extremes(simd.store(all))
    }
}

/// Half of the surface areas of eight boxes, of least coordinates and minus the greatest ones.
#[inline(always)]
fn half_areas([lo, minus_hi]: &[[[f32; 8]; 3]; 2]) -> [f64; 8] {
    let mut areas = [0.0; 8];
    for lane in 0..8 {
        let extent = |k: usize| {
            let extent = -f64::from(minus_hi[k][lane]) - f64::from(lo[k][lane]);
            if extent > 0.0 { extent } else { 0.0 }
        };
        let (x, y, z) = (extent(0), extent(1), extent(2));
        areas[lane] = x * y + y * z + z * x;
    }
    areas
}

/// The greatest `f32` that are at most `x`, without branches.
#[inline(always)]
fn down_eight(x: &[f64; 8]) -> [f32; 8] {
    let mut all = [0.0; 8];
    for lane in 0..8 {
        let nearest = x[lane] as f32;
        let bits = nearest.to_bits();
        let step = if bits >> 31 == 1 { 1 } else { u32::MAX };
        let below = if nearest == 0.0 { 0x8000_0001 } else { bits.wrapping_add(step) };
        all[lane] = f32::from_bits(if f64::from(nearest) > x[lane] { below } else { bits });
    }
    all
}

/// [`lower`](canted_trace::lanes::lower) without branches; [`NOWHERE`] where `x` is infinite, as it is in empty slots.
#[inline(always)]
fn lowered(x: &[f32; 8], pad: &[f64; 8]) -> [f32; 8] {
    let mut exact = [0.0; 8];
    for lane in 0..8 {
        exact[lane] = f64::from(x[lane]) - pad[lane];
    }
    let mut planes = down_eight(&exact);
    for lane in 0..8 {
        let plane = if planes[lane] < f32::MIN { f32::MIN } else { planes[lane] };
        planes[lane] = if x[lane] == f32::INFINITY { NOWHERE } else { plane };
    }
    planes
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_trace::lanes::lower;

    use super::*;

    #[test]
    fn planes_are_those_of_single_boxes() {
        let mut rng = SplitMix64::new(3);
        let special =
            [0.0, -0.0, f32::MIN_POSITIVE, -f32::MIN_POSITIVE, f32::MIN, f32::MAX, 1e-45, -1e-45, f32::NEG_INFINITY];
        let mut n_rounded = 0;
        for round in 0..5_000 {
            let x: [f32; 8] = std::array::from_fn(|lane| match (round + lane) % 4 {
                0 => special[rng.next_u64() as usize % special.len()],
                1 => (1e-40 * rng.signed()) as f32,
                _ => (1e3 * rng.signed()) as f32,
            });
            let pad: [f64; 8] = std::array::from_fn(|lane| match (round / 4 + lane) % 4 {
                0 => 0.0,
                1 => f64::from(x[lane]).abs().min(f64::from(f32::MAX)) * 1e-7,
                2 => 1e-46,
                _ => 1e-4 * rng.unit(),
            });
            let planes = lowered(&x, &pad);
            for lane in 0..8 {
                let want = lower(x[lane], pad[lane]);
                assert_eq!(planes[lane].to_bits(), want.to_bits(), "{} {}", x[lane], pad[lane]);
                n_rounded += usize::from(want != (f64::from(x[lane]) - pad[lane]) as f32);
            }
        }
        assert!(n_rounded > 1000, "{n_rounded} are not the nearest");
        assert_eq!(lowered(&[f32::INFINITY; 8], &[0.0; 8]), [NOWHERE; 8]);
    }
}
