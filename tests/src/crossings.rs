//! Surface crossings among all hits of a ray, and whether they alternate between entering and leaving.
//!
//! Not covered: devices, which return only first hits, and these within an error.

use canted_fixtures::Mesh;
use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Query, Ray, ScaledRay, Shear, Side};

use crate::reference::corners;

/// Records every hit of the first instance and accepts none, so that the query reports all of them.
struct Everything(Vec<Hit>);

impl Query for Everything {
    fn accepts(&mut self, hit: &Hit) -> bool {
        if hit.instance == InstanceId(0) {
            self.0.push(*hit);
        }
        false
    }
}

/// Every hit on the first instance that a closest-hit query considers, unordered and possibly repeated.
pub(crate) fn all_hits(ask: impl FnOnce(&mut dyn Query) -> Option<Hit>) -> Vec<Hit> {
    let mut everything = Everything(vec![]);
    let accepted = ask(&mut everything);
    assert!(accepted.is_none(), "the query accepted a hit: {accepted:?}");
    everything.0
}

/// Those hits of a ray on the watertight kernel's triangles that cross the surface, sorted by `t`.
///
/// They are the hits of the ray moved sideways by an infinitesimal `(ε, ε²)`, which hits no edge and no vertex.
/// `TriangleBvh::crossings` uses the same rule, but reports the lowest triangle around an edge.
#[must_use]
pub fn of_hits(mesh: &Mesh, ray: &Ray, mut hits: Vec<Hit>) -> Vec<Hit> {
    let Some(scaled) = ScaledRay::new(ray) else { return vec![] };
    let shear = Shear::new(&scaled);
    hits.sort_unstable_by_key(|hit| hit.primitive);
    hits.dedup_by_key(|hit| hit.primitive);
    hits.retain(|hit| is_crossed(&shear, &scaled, corners(mesh, &mesh.triangles[hit.primitive.index()])));
    hits.sort_by(|a, b| a.t.total_cmp(&b.t));
    hits
}

/// Whether the moved ray hits the triangle, in the kernel's own sheared coordinates.
fn is_crossed(shear: &Shear, ray: &ScaledRay, corners: [[f32; 3]; 3]) -> bool {
    let [s_x, s_y] = shear.factors();
    let [a, b, c] = corners.map(|corner| {
        let [x, y, z] = shear.axis().permute(std::array::from_fn(|k| corner[k] - ray.origin[k]));
        [x - s_x * z, y - s_y * z]
    });
    let sides = [side(a, b), side(b, c), side(c, a)];
    sides == [1; 3] || sides == [-1; 3]
}

/// On which side of the line from `p` to `q` the point `(ε, ε²)` lies; zero if the points coincide.
///
/// `(p - e) × (q - e) = p × q + (p_y - q_y)·ε + (q_x - p_x)·ε²`. The first term is exact in `f64`; the first nonzero term
/// decides.
fn side(p: [f32; 2], q: [f32; 2]) -> i8 {
    let [[p_x, p_y], [q_x, q_y]] = [p, q].map(|point| point.map(f64::from));
    let terms = [p_x * q_y - p_y * q_x, p_y - q_y, q_x - p_x];
    terms.into_iter().find(|&term| term != 0.0).map_or(0, |term| if term > 0.0 { 1 } else { -1 })
}

/// The other side.
#[must_use]
pub fn opposite(side: Side) -> Side {
    match side {
        Side::Front => Side::Back,
        Side::Back => Side::Front,
    }
}

/// Whether the crossings of a closed surface, sorted by `t`, are balanced for a ray known to hit it: at least one crossing,
/// no triangle twice, and as many entering as leaving, less one if the ray starts inside.
#[must_use]
pub fn are_balanced(crossings: &[Hit], inward: Side, from_inside: bool) -> bool {
    let mut primitives: Vec<PrimId> = crossings.iter().map(|hit| hit.primitive).collect();
    primitives.sort_unstable();
    let n_inward = crossings.iter().filter(|hit| hit.side == inward).count();
    let are_once = primitives.windows(2).all(|pair| pair[0] != pair[1]);
    are_once && !crossings.is_empty() && n_inward + usize::from(from_inside) == crossings.len() - n_inward
}

/// Whether the crossings also alternate, as required for a surface without self-intersections.
///
/// A mesh near the true one, with vertices where the kernel sees them, has alternating crossings. Division and rounding of `t`
/// keep their order except among neighbors: crossings whose `t` are equal or adjacent may come in any order.
#[must_use]
pub fn are_alternating(crossings: &[Hit], inward: Side, from_inside: bool) -> bool {
    let mut n_around = usize::from(from_inside);
    let leads_on = |around: &[Hit]| {
        let n_inward = around.iter().filter(|hit| hit.side == inward).count();
        n_around = (n_around + n_inward).wrapping_sub(around.len() - n_inward);
        n_around <= 1
    };
    let is_one_place = |a: &Hit, b: &Hit| b.t <= a.t.next_up();
    are_balanced(crossings, inward, from_inside) && crossings.chunk_by(is_one_place).all(leads_on)
}

#[cfg(test)]
mod tests {
    use canted_obb::Affine;
    use canted_trace::{Crossings, Intersect};
    use canted_wide::TriangleBvh;

    use super::*;
    use crate::closed::{Closed, closed, rays};

    /// A ray, all its hits and its crossings.
    type Traced = (Ray, Vec<Hit>, Vec<Hit>);

    /// Rays at vertices and edges of closed meshes; even ones start inside.
    fn traced() -> Vec<(Mesh, Vec<Traced>)> {
        let of = |closed: Closed| {
            let tree = TriangleBvh::build(&closed.mesh.positions, &closed.mesh.triangles).expect("fixtures are valid");
            let both = |ray: Ray| {
                let (mut hits, mut crossings) = (vec![], vec![]);
                tree.all_hits(&ray, &mut hits);
                tree.crossings(&ray, &mut crossings);
                (ray, hits, crossings)
            };
            let rays = rays(&closed.mesh, &closed, &Affine::IDENTITY, 600, 9);
            (closed.mesh, rays.into_iter().map(both).collect())
        };
        closed().into_iter().map(of).collect()
    }

    #[test]
    fn both_methods_count_the_same_crossings() {
        let mut n_more = 0;
        for (mesh, traced) in traced() {
            for (ray, hits, crossings) in traced {
                n_more += usize::from(hits.len() > crossings.len());
                let sides = |hits: &[Hit], side| hits.iter().filter(|hit| hit.side == side).count();
                let found = of_hits(&mesh, &ray, hits);
                for side in [Side::Front, Side::Back] {
                    assert_eq!(sides(&found, side), sides(&crossings, side), "{ray:?}: {found:?}, {crossings:?}");
                }
            }
        }
        // These rays would count a crossing twice without the rule.
        assert!(n_more > 300, "{n_more} rays hit an edge or a vertex");
    }

    #[test]
    fn duplicate_missing_and_extra_crossings_are_detected() {
        let elsewhere = |hit: &Hit| Hit { primitive: PrimId(hit.primitive.0 + 10_000), ..*hit };
        for (_, traced) in traced() {
            for (i, (ray, _, crossings)) in traced.into_iter().enumerate() {
                let check = |crossings: &[Hit]| are_alternating(crossings, Side::Front, i % 2 == 0);
                assert!(check(&crossings), "{ray:?}: {crossings:?}");
                assert!(!check(&[]), "no crossings must be rejected");
                for k in 0..crossings.len() {
                    let (mut missing, mut duplicate, mut extra) =
                        (crossings.clone(), crossings.clone(), crossings.clone());
                    missing.remove(k);
                    duplicate.insert(k, crossings[k]);
                    extra.insert(k, elsewhere(&crossings[k]));
                    assert!(![missing, duplicate, extra].iter().any(|bad| check(bad)), "{ray:?}: {crossings:?}, {k}");
                }
                let all_duplicate: Vec<Hit> = crossings.iter().flat_map(|hit| [*hit, elsewhere(hit)]).collect();
                assert!(!check(&all_duplicate), "{ray:?}");
                // With the other winding the ray would start inside.
                assert!(!are_alternating(&crossings, Side::Back, i % 2 == 0), "{ray:?}");
            }
        }
    }

    #[test]
    fn balanced_crossings_need_not_alternate() {
        let at = |t: f32, side, primitive| Hit {
            t,
            u: 0.0,
            v: 0.0,
            primitive: PrimId(primitive),
            instance: InstanceId(0),
            side,
        };
        let out_and_in = [at(1.0, Side::Back, 0), at(2.0, Side::Front, 1)];
        assert!(are_balanced(&out_and_in, Side::Front, false) && !are_alternating(&out_and_in, Side::Front, false));
        // Crossings with adjacent `t` may come in any order.
        let near = [at(1.0, Side::Back, 0), at(1.0f32.next_up(), Side::Front, 1)];
        assert!(are_alternating(&near, Side::Front, false));
    }
}
