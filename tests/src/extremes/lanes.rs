//! Axis-aligned boxes in eight-wide nodes on every available SIMD path: the cases of `slab`.
//!
//! Oriented boxes in wide nodes are covered by `hierarchy`: their test has no public entry point.

use canted_obb::Aabb;
use canted_trace::ScaledRay;
use canted_wide::{Config, SimdPath, WideBvh};

use super::{
    Oracle, Promise, Row,
    slab::{Case, Pair, cases},
};
use crate::fractions;

/// Boxes of one BVH, which fit one node.
const LANES: usize = 8;

pub(super) fn rows(effort: usize) -> Vec<Row> {
    let paths = || SimdPath::ALL.into_iter().filter(|path| path.is_available());
    let mut rows = vec![];
    for Case { name, pairs } in cases(effort) {
        let lost = Promise::none(
            "box in an eight-wide node",
            name,
            "no ray that hits the box is rejected",
            Oracle::Exact,
            "rays lost",
        );
        let reported =
            Promise { promise: "misses accepted because of padding", unit: "of all misses", ..lost }.reported();
        // A product and a sum may be rounded once or twice (`canted_wide`'s `simd`); padding covers both, and paths may differ.
        let same = Promise {
            promise: "rays that enter other boxes than on the scalar path (fused rounding)",
            oracle: Oracle::Same,
            unit: "of all rays",
            ..lost
        }
        .reported();
        // An oriented box lies in its axis-aligned bounds: a ray that hits it must enter those.
        let verdicts: Vec<bool> = pairs.iter().map(|(ray, obb)| fractions::intersects_box(ray, obb)).collect();
        let n_hit = verdicts.iter().filter(|&&hits| hits).count();
        let straight = pairs.iter().all(|(_, obb)| obb.frame == canted_obb::Obb::IDENTITY_FRAME);
        let wants = entered(&pairs, SimdPath::Scalar);
        let mut by_promise: [Vec<Row>; 3] = Default::default();
        for path in paths() {
            let found = entered(&pairs, path);
            let own = |hits: bool, enters: bool| {
                let is_so =
                    |(i, among): (usize, &Vec<usize>)| verdicts[i] == hits && among.contains(&(i % LANES)) == enters;
                found.iter().enumerate().filter(|&pair| is_so(pair)).count()
            };
            by_promise[0].push(lost.count(path.name(), n_hit, own(true, false)));
            if straight {
                by_promise[1].push(reported.share(path.name(), pairs.len() - n_hit, own(false, true)));
            }
            if path != SimdPath::Scalar {
                let n_other = found.iter().zip(&wants).filter(|(found, wanted)| found != wanted).count();
                by_promise[2].push(same.share(path.name(), pairs.len(), n_other));
            }
        }
        rows.extend(by_promise.concat());
    }
    rows
}

/// For each ray the indices of the boxes of its node that it enters, ascending; its own box keeps its index among the pairs.
fn entered(pairs: &[Pair], path: SimdPath) -> Vec<Vec<usize>> {
    let of_node = |pairs: &[Pair]| {
        let boxes: Vec<Aabb> = pairs.iter().map(|(_, obb)| obb.aabb()).collect();
        let tree = WideBvh::<Aabb>::build(boxes.clone(), &Config::default()).expect("boxes are finite").with_path(path);
        let of_ray = |(ray, _): &Pair| {
            let mut entered = vec![];
            if let Some(ray) = ScaledRay::new(ray) {
                tree.traverse_any(&ray, 0.0, &mut (), |number, t_max, ()| {
                    entered.push(number.index());
                    t_max
                });
            }
            entered.sort_unstable();
            entered
        };
        pairs.iter().map(of_ray).collect::<Vec<_>>()
    };
    pairs.chunks(LANES).flat_map(of_node).collect()
}
