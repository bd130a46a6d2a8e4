//! Merges of the boxes of two halves of a set, by rule.

use canted_obb::{
    Aabb, Dop, Fit, Moments, Obb, bound, eigen,
    merge::{self, Child, Weight},
};

use super::{fitted, inputs::Set};

/// Two halves of a set.
pub(super) struct Pair {
    boxes: [Obb; 2],
    /// The halves as BVH children: a half of one triangle is that triangle.
    children: [Child; 2],
    /// The data that some builders propagate upwards instead of boxes.
    carried: [Carried; 2],
    /// The points of both halves.
    points: Vec<[f32; 3]>,
}

/// The propagated data of a half.
struct Carried {
    moments: Moments,
    extents: Dop,
    aabb: Aabb,
}

/// A rule by name.
type Rule = (&'static str, fn(&Pair) -> Obb);

pub(super) const MERGES: [Rule; 8] = [
    ("axis-aligned, of both axis-aligned boxes", |Pair { boxes: [a, b], .. }| {
        Obb::from_aabb(&a.aabb().union(b.aabb()))
    }),
    ("principal axes of corners", |Pair { boxes: [a, b], .. }| {
        merge::bounded(&Child::Box(*a), &Child::Box(*b), Weight::Corners)
    }),
    ("the same, by area", |Pair { boxes: [a, b], .. }| merge::bounded(&Child::Box(*a), &Child::Box(*b), Weight::Area)),
    ("quaternion", |Pair { boxes: [a, b], .. }| merge::quaternion(a, b, [a.area(), b.area()])),
    ("combined, by kind of child", |Pair { children: [a, b], .. }| merge::combined(a, b)),
    ("best of five frames", |Pair { boxes: [a, b], .. }| merge::best(a, b, None)),
    ("principal axes of all descendants", unbounded),
    ("propagated extents", by_extents),
];

/// As `Strategy::PcaUnbounded`: the frame comes from joined moments, the box from all points.
fn unbounded(Pair { carried: [a, b], points, .. }: &Pair) -> Obb {
    bound(a.moments.merged(&b.moments).axes(eigen::COARSE), points.iter().copied())
}

/// As `Strategy::Dop`: axis-aligned if no other frame of the fixed directions has less area.
fn by_extents(Pair { carried: [a, b], .. }: &Pair) -> Obb {
    a.extents.union(&b.extents).best_box().unwrap_or_else(|| Obb::from_aabb(&a.aabb.union(b.aabb)))
}

impl Pair {
    /// The two halves of a set.
    pub(super) fn of(set: &Set) -> Self {
        let (a, b) = set.points.split_at(set.split);
        let boxes = [a, b].map(|points| fitted(&Set { points: points.to_vec(), split: 0 }, Fit::AreaPca));
        let child = |points: &[[f32; 3]], obb| {
            if let &[a, b, c] = points { Child::Triangle([a, b, c]) } else { Child::Box(obb) }
        };
        Self {
            boxes,
            children: [child(a, boxes[0]), child(b, boxes[1])],
            carried: [a, b].map(Carried::of),
            points: set.points.clone(),
        }
    }
}

impl Carried {
    fn of(points: &[[f32; 3]]) -> Self {
        let (triangles, _) = points.as_chunks::<3>();
        let join = |all: Moments, &triangle: &[[f32; 3]; 3]| all.merged(&Moments::from_triangle(triangle));
        Self {
            moments: triangles.iter().fold(Moments::EMPTY, join),
            extents: Dop::from_points(points.iter().copied()),
            aabb: Aabb::from_points(points.iter().copied()),
        }
    }
}

#[cfg(test)]
mod tests {
    use canted_lbvh::{self as lbvh, Bits, NodeId, Strategy, Volume, VolumeConfig};

    use super::*;

    /// Two triangles.
    const CORNERS: [[f32; 3]; 6] =
        [[0.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 3.0], [4.0, 5.0, 6.0], [5.0, 5.0, 7.0], [4.0, 6.0, 6.5]];

    #[test]
    fn merges_contain_both_halves_and_combined_uses_triangles() {
        let pair = Pair::of(&Set { points: CORNERS.to_vec(), split: 3 });
        assert!(pair.children.iter().all(|child| matches!(child, Child::Triangle(_))));
        for (name, rule) in MERGES {
            assert!(rule(&pair).volume() > 0.0 && rule(&pair).aabb().contains(CORNERS[5]), "{name}");
        }
        let of = |points: usize| Pair::of(&Set { points: [CORNERS, CORNERS].concat(), split: points });
        let [quaternion, combined] = [3, 4].map(|i| MERGES[i].1);
        assert_eq!(quaternion(&of(6)), combined(&of(6)));
        assert_ne!(quaternion(&of(3)), combined(&of(3)));
    }

    #[test]
    fn propagated_data_gives_the_boxes_of_a_bvh() {
        let (triangles, _) = CORNERS.as_chunks::<3>();
        let tree = lbvh::radix(lbvh::sort_by_code(&[0; 2], Bits::B30));
        let pair = Pair::of(&Set { points: CORNERS.to_vec(), split: 3 });
        for (strategy, rule) in [(Strategy::PcaUnbounded, MERGES[6].1), (Strategy::Dop, MERGES[7].1)] {
            let volumes = lbvh::volumes(&tree, triangles, &VolumeConfig { strategy, fallback: false });
            assert_eq!(volumes.of(NodeId::ROOT), Volume::Obb(&rule(&pair)), "{strategy:?}");
        }
    }
}
