//! How far triangles reach along a direction.

use canted_obb::vector::{Vector, cross, dot, reach, scale, sub, to_f64};

use crate::bvh::TriangleBvh;
use crate::node::NodeBox;
use crate::subtree::Subtree;

/// More than what roundings of `f64` add to a sum of a few products, relative to the sum of their absolute values.
const ROUNDINGS: f64 = 64.0 * f64::EPSILON;

impl TriangleBvh {
    /// At least the product of `direction` with each vertex, by less than 2^-40 of the greatest terms; 0 without triangles.
    ///
    /// A search through the nodes, those first that reach the farthest.
    pub(crate) fn farthest_along(&self, direction: Vector) -> f64 {
        let Some(root) = self.root() else { return 0.0 };
        let (reference, whole) = (to_f64(self.reference_point()), self.root_box());
        let extent = reach(whole.lo).max(reach(whole.hi));
        let start = dot(direction, reference);
        let mut farthest = f64::NEG_INFINITY;
        let mut open: Vec<(f64, Subtree)> = vec![(f64::INFINITY, root)];
        while let Some((bound, subtree)) = open.pop() {
            if bound <= farthest {
                continue;
            }
            self.for_each_in(subtree, |_, vertices| {
                farthest = vertices.iter().fold(farthest, |most, &vertex| most.max(dot(direction, to_f64(vertex))));
            });
            let first = open.len();
            let children = (0..8).filter_map(|lane| self.child(subtree, lane));
            open.extend(children.map(|(child, of_child)| (start + limit(&of_child, direction, extent), child)));
            open[first..].sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));
        }
        farthest + ROUNDINGS * (reach(direction) * 3.0 * (extent + reach(reference)))
    }
}

/// At least the product of `direction` with each point that the box contains and whose coordinates are at most `extent`.
///
/// The direction is a sum of the rows, times factors, and a rest that is a rounding.
fn limit(NodeBox { rows, lo, hi }: &NodeBox, direction: Vector, extent: f64) -> f64 {
    let rows = rows.map(to_f64);
    let cofactors: [Vector; 3] = std::array::from_fn(|k| cross(rows[(k + 1) % 3], rows[(k + 2) % 3]));
    let determinant = dot(rows[0], cofactors[0]);
    let factors = cofactors.map(|cofactor| dot(direction, cofactor) / determinant);
    let rest = (0..3).fold(direction, |rest, k| sub(rest, scale(rows[k], factors[k])));
    let along: f64 = (0..3).map(|k| (factors[k] * lo[k]).max(factors[k] * hi[k])).sum();
    let size: f64 = (0..3).map(|k| factors[k].abs() * (lo[k].abs().max(hi[k].abs()) + extent)).sum();
    let limit = along + 3.0 * reach(rest) * extent + ROUNDINGS * (size + 3.0 * reach(direction) * extent);
    // Rows that are dependent say nothing.
    if limit.is_finite() { limit } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::{SplitMix64, kinds};

    use super::*;
    use crate::{Config, Preset};

    /// The greatest product of a loop over all vertices.
    #[test]
    fn no_vertex_is_farther_and_one_is_as_far() {
        let mut rng = SplitMix64::new(5);
        for (name, is_oriented) in [("scan_knot", false), ("lattice", true), ("far_1e6", false)] {
            let mesh = kinds::named(name).expect("a kind").generate(4_000, 1).meshes.swap_remove(0);
            let config = Config { oriented: is_oriented, ..Preset::Quality.into() };
            let bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap();
            let used = || mesh.triangles.iter().flatten().map(|&i| to_f64(mesh.positions[i as usize]));
            let size = used().map(reach).fold(0.0, f64::max);
            for step in 0..60 {
                let axis = |k: usize| if k == step { 1.0 } else { 0.0 };
                let direction: Vector = if step < 3 { std::array::from_fn(axis) } else { rng.signed3() };
                let farthest = used().map(|p| dot(direction, p)).fold(f64::NEG_INFINITY, f64::max);
                let found = bvh.farthest_along(direction);
                assert!(found >= farthest && found <= farthest + 1e-11 * size, "{name}: {found} {farthest}");
            }
        }
    }

    #[test]
    fn nothing_reaches_nowhere() {
        let bvh = TriangleBvh::build::<[f32; 3], u32>(&[], &[]).unwrap();
        assert_eq!(bvh.farthest_along([1.0, 2.0, 3.0]), 0.0);
    }
}
